// Light under the surface: a path goes in, walks from one scattering to the next within the same object, and comes out
// elsewhere, where it is lit and goes on as from a diffuse surface. Source: Chiang, Kutz, Burley 2016, "Practical and
// controllable subsurface scattering for production path tracing".
#pragma once
#include "luch/bsdf/setup_context.h"
#include "luch/integrator/scatter.h"
#include "luch/integrator/subsurface_medium.h"
#include "luch/math/bounds.h"

namespace luch {

// What is still inside after so many steps is dropped (as in Cycles).
inline constexpr u32 WALK_STEPS = 256;
// From this step on directions are forgotten: isotropic scattering of the same reduced coefficients (the similarity
// relation of Wyman, Patterson and Wilson 1989), which guides well.
inline constexpr u32 WALK_ISOTROPIC_FROM = 10;
inline constexpr float WALK_ISOTROPIC_GUIDED = 0.75f;  // share of steps that are guided there
// A first step looks this many mean free paths ahead for an opposite side.
inline constexpr float WALK_LOOKS_AHEAD = 10.0f;
// Steps whose random numbers are of the path's sequence; later ones are hashed: dimensions so high gain nothing.
inline constexpr u32 WALK_SEQUENCE_STEPS = 2;
inline constexpr u32 WALK_FIRST_DIMENSION = 0x10000u;  // above those of every path

// A path under the surface. The queue between the stage at a surface and that where it comes out.
struct alignas(16) SubsurfaceWalk {
    Vec3 entry;           // where it went in, world; of a walk just under the surface
    u32 ray;              // that brought it, of this generation
    Vec3 normal;          // unit, where it went in, outwards: interpolated, of a probe the face's
    u32 instance;         // that it is in
    Vec3 position;        // where the last step began
    u32 steps;
    Vec3 direction;       // of the last step, unit
    float opposite;       // depth at which the first step saw the other side; < 0: it saw none
    Color throughput;     // of the path
    u32 random;           // state of the hashed numbers
    Color radius, color;  // of the lobe
    float anisotropy;
    bool older;           // albedo by the fit of Blender's older methods
    bool probe;           // no walk, but a probe of a profile (integrator/subsurface_disk.h)
    bool back;            // of a probe: it went in where the face is seen from behind
    Sampler sampler;
    u32 dimension;        // of the numbers of the first steps
    Hit hit;              // where it comes out; instance NONE: it does not
};

// The lobe under the surface that scatter() would choose, or -1: it chooses another, or goes straight on.
LUCH_FN int chosen_subsurface(const ClosureSet& set, float u_lobe) {
    bool any = false;
    for (int i = 0; i < set.count; ++i) any = any || is_subsurface(set.lobes[i].type);
    if (!any) return -1;
    float through = average(set.transparent), lobes = lobe_weight_sum(set);
    float through_probability = through / (through + lobes);
    if (u_lobe < through_probability) return -1;
    u_lobe = min_f((u_lobe - through_probability) / (1.0f - through_probability), BELOW_ONE);
    int chosen = set.count > 1 ? choose_lobe(set, lobes, &u_lobe) : 0;
    return is_subsurface(set.lobes[chosen].type) ? chosen : -1;
}

// Into the medium through a rough interface, unweighted: only where light goes matters. False: it does not go in.
LUCH_FN bool refract_inside(const Lobe& lobe, Vec3 wo, Vec2 u, Vec3* inside) {
    Vec3 t, b;
    if (lobe.type == LobeType::SUBSURFACE_SKIN) {  // half of it is diffuse already
        if (u.x < 0.5f) {
            *inside = sample_cosine_around(-lobe.normal, {2.0f * u.x, u.y});
            return true;
        }
        u.x = 2.0f * u.x - 1.0f;
    }
    float cos_wo = dot(lobe.normal, wo);
    if (!(cos_wo > 0.0f)) return false;
    make_frame(lobe.normal, &t, &b);
    Vec3 local = sample_visible_ggx(lobe, {dot(t, wo), dot(b, wo), cos_wo}, 1.0f, u);
    Vec3 facet = to_world(local, t, b, lobe.normal);
    float eta = 1.0f / lobe.ior, cos_facet = dot(facet, wo);
    float cos_inside = sqrt_f(max_f(1.0f - sqr(eta) * (1.0f - sqr(cos_facet)), ENTRY_COSINE2));
    *inside = normalize(-(eta * wo) + (eta * cos_facet - cos_inside) * facet);
    return true;
}

// A path that goes in at a surface; false where it ends. chosen: lobe that chosen_subsurface named; u: two numbers.
LUCH_FN bool enter_subsurface(PathState& path, const ShadePoints& points, int lane, const ClosureSet& set, int chosen,
                              const SurfacePoint& spawn, Vec2 u, u32 ray, SubsurfaceWalk* walk) {
    const Lobe& lobe = set.lobes[chosen];
    Vec3 ng = lane_face_normal(points, lane);
    float probability = lobe.sample_weight / (average(set.transparent) + lobe_weight_sum(set));
    walk->throughput = path.throughput * lobe.weight * (1.0f / probability);
    walk->probe = lobe.type == LobeType::SUBSURFACE_DISK;
    walk->back = points.flags[lane] & PATH_BACKFACING;
    walk->entry = spawn.p;
    walk->normal = ng;
    if (!walk->probe) {
        if (!refract_inside(lobe, lane_to_viewer(points, lane), u, &walk->direction)) return false;
        if (!(dot(ng, walk->direction) < 0.0f)) return false;
        // The albedo comes back by scattering.
        walk->throughput = share(walk->throughput, lobe.c0);
        walk->entry = walk->position = offset_origin(spawn, ng, walk->direction);
        walk->normal = lane_normal(points, lane);
    }
    path.flags &= ~u32(PATH_CAMERA);
    walk->instance = points.instance[lane];
    walk->ray = ray;
    walk->color = lobe.c0;
    walk->radius = lobe.c1;
    walk->anisotropy = lobe.extra;
    walk->older = lobe.type != LobeType::SUBSURFACE;
    walk->sampler = path.sampler;
    walk->dimension = (path.dimension & FAMILY_BITS) + WALK_FIRST_DIMENSION +
                      2u * WALK_SEQUENCE_STEPS * (path.dimension & ~FAMILY_BITS);
    walk->random = hash_u32(path.sampler.seed, path.sampler.index, path.dimension);
    path.dimension += DIMENSIONS_PER_EVENT;  // lit and scattered again where it comes out
    return true;
}

struct StepNumbers {
    Vec2 direction;
    float distance, channel, strategy, side;
};

LUCH_FN float next_hashed(u32* state) {
    *state += 0x9e3779b9u;
    return unit_float(mix_u32(*state));
}

LUCH_FN StepNumbers step_numbers(SubsurfaceWalk& walk) {
    if (walk.steps < WALK_SEQUENCE_STEPS) {
        Vec3 a = sample_3d(walk.sampler, walk.dimension + 2u * walk.steps);
        Vec3 b = sample_3d(walk.sampler, walk.dimension + 2u * walk.steps + 1u);
        return {{a.x, a.y}, a.z, b.x, b.y, b.z};
    }
    StepNumbers n;
    n.direction.x = next_hashed(&walk.random);
    n.direction.y = next_hashed(&walk.random);
    n.distance = next_hashed(&walk.random);
    n.channel = next_hashed(&walk.random);
    n.strategy = next_hashed(&walk.random);
    n.side = next_hashed(&walk.random);
    return n;
}

// One step before its ray is traced: how far it would go, and what finish_step needs for its weight.
struct WalkStep {
    Color extinction, scattering;
    Color chances;               // of the channels
    float distance;              // drawn, metres
    float reach;                 // of its ray: t_max
    float guided;                // share of steps that are guided
    float forward, backward;  // by which guided steps, towards the surface and away from it, stretch the extinction
    float forward_ratio, backward_ratio;  // their densities of direction over the phase function's
    float backward_share;
};

LUCH_FN Color channel_chances(Color light) {
    Color weight = abs_v(light);
    float sum = weight.x + weight.y + weight.z;
    return sum > 0.0f && finite_f(sum) ? weight * (1.0f / sum) : make_vec3(1.0f / 3.0f);
}

// Turns the walk, by the phase function or by one of the guides.
LUCH_FN void choose_direction(SubsurfaceWalk& walk, const Guide& guide, float g, const StepNumbers& u, float* stretch,
                              WalkStep& step) {
    bool guided = u.strategy < step.guided, back = false;
    if (walk.opposite >= 0.0f) {
        // Away from the entry the nearer the other side is; both guides share one diffusion length.
        float depth = clamp_f(dot(walk.entry - walk.position, walk.normal), 0.0f, walk.opposite);
        float paths = (walk.opposite - 2.0f * depth) * dot(step.chances, step.extinction);  // mean free paths
        step.backward_share = 1.0f / (1.0f + exp_f(paths / guide.length));
        back = u.side < step.backward_share;
    }
    float cosine, phase;  // with the normal; of the phase function
    Vec3 before = walk.direction;
    if (guided) {
        cosine = sample_guided(guide, u.direction.x);
        cosine = back ? -cosine : cosine;
        walk.direction = direction_at(walk.normal, cosine, u.direction.y);
        phase = henyey_greenstein(dot(before, walk.direction), g);
    } else {
        float turn = sample_henyey_greenstein(g, u.direction.x);
        walk.direction = direction_at(before, turn, u.direction.y);
        phase = henyey_greenstein(turn, g);
        cosine = clamp_f(dot(walk.direction, walk.normal), -1.0f, 1.0f);
    }
    step.forward_ratio = guided_pdf(guide, cosine) / phase;
    step.backward_ratio = guided_pdf(guide, -cosine) / phase;
    step.forward = 1.0f - cosine / guide.length;
    step.backward = 1.0f + cosine / guide.length;
    if (guided) *stretch = back ? step.backward : step.forward;
}

// What a walk keeps from step to step beside its state.
struct WalkPlan {
    Medium medium;
    Guide guide;
    float guided;  // share of steps that are guided at first; narrow phase functions leave little to guide
};

LUCH_FN WalkStep begin_step(SubsurfaceWalk& walk, const WalkPlan& plan) {
    const Medium& medium = plan.medium;
    StepNumbers u = step_numbers(walk);
    WalkStep step;
    float g = medium.anisotropy;
    step.extinction = medium.extinction;
    step.scattering = medium.extinction * medium.albedo;
    step.guided = plan.guided;
    if (walk.steps >= WALK_ISOTROPIC_FROM) {
        Color reduced = step.scattering * (1.0f - g);
        step.extinction += reduced - step.scattering;
        step.scattering = reduced;
        step.guided = WALK_ISOTROPIC_GUIDED;
        g = 0.0f;
    }
    step.chances = channel_chances(walk.throughput * medium.albedo);
    int channel = u.channel < step.chances.x ? 0 : (u.channel < step.chances.x + step.chances.y ? 1 : 2);
    step.forward = step.backward = 1.0f;
    step.forward_ratio = step.backward_ratio = step.backward_share = 0.0f;
    float stretch = 1.0f;
    if (walk.steps > 0) choose_direction(walk, plan.guide, g, u, &stretch, step);
    step.distance = step.reach = -log_f(1.0f - u.distance) / (stretch * step.extinction[channel]);
    if (walk.steps == 0) {
        float thinnest = min_f(step.extinction.x, min_f(step.extinction.y, step.extinction.z));
        step.reach = max_f(step.distance, WALK_LOOKS_AHEAD / thinnest);
    }
    return step;
}

LUCH_FN Color transmittance(Color extinction, float distance) {
    return {exp_f(-extinction.x * distance), exp_f(-extinction.y * distance), exp_f(-extinction.z * distance)};
}
// Density, channel by channel, of ending at `distance`: of scattering there, or of coming so far.
LUCH_FN Color distance_density(Color extinction, float distance, bool leaves) {
    Color through = transmittance(extinction, distance);
    return leaves ? through : extinction * through;
}

enum class WalkFate : u8 { GOES_ON, LEAVES, LOST };

// hit: of the step's ray. The weight is the balance heuristic over all ways to have made the step: three channels,
// each by the phase function or guided to either side.
LUCH_FN WalkFate finish_step(SubsurfaceWalk& walk, const WalkStep& step, const Hit& hit) {
    bool leaves = hit.instance != NONE;
    if (walk.steps == 0) {
        if (leaves) walk.opposite = max_f(-dot(walk.direction, walk.normal) * hit.t, 0.0f);
        leaves = leaves && hit.t < step.distance;
    }
    float distance = leaves ? hit.t : step.distance;
    Color through = transmittance(step.extinction, distance);
    Color density = leaves ? through : step.extinction * through;
    if (walk.steps > 0) {
        Color guided = distance_density(step.forward * step.extinction, distance, leaves) * step.forward_ratio;
        if (walk.opposite >= 0.0f) {
            Color back = distance_density(step.backward * step.extinction, distance, leaves) * step.backward_ratio;
            guided = mix(guided, back, step.backward_share);
        }
        density = mix(density, guided, step.guided);
    }
    float pdf = dot(step.chances, density);
    walk.throughput *= (leaves ? through : step.scattering * through) * (1.0f / pdf);
    walk.hit = hit;
    if (!(pdf > 0.0f) || !(max_component(walk.throughput) >= WALK_CUTOFF) || !finite_v(walk.throughput))
        return WalkFate::LOST;  // NaN: lost
    if (leaves) return WalkFate::LEAVES;
    walk.position += distance * walk.direction;
    return ++walk.steps < WALK_STEPS ? WalkFate::GOES_ON : WalkFate::LOST;
}

LUCH_FN WalkPlan begin_walk(SubsurfaceWalk& walk) {
    Medium medium = medium_of(walk.color, walk.radius, walk.anisotropy, walk.older, &walk.throughput);
    walk.steps = 0;
    walk.opposite = -1.0f;
    // One guide for all channels: that of the brightest is safe for the others, a tighter one makes fireflies.
    return {medium, guide_of(max_component(medium.albedo)), min_f(0.5f, 1.0f - pow_f(abs_f(walk.anisotropy), 0.125f))};
}

// tracer.closest(instance, ray): the nearest hit in that instance alone.
template <class Tracer>
LUCH_FN WalkFate take_step(SubsurfaceWalk& walk, const WalkPlan& plan, Tracer& tracer) {
    WalkStep step = begin_step(walk, plan);
    Ray ray = {walk.position, 0.0f, walk.direction, step.reach};
    Hit hit = tracer.closest(walk.instance, ray);
    return finish_step(walk, step, hit);
}

// *steps counts rays.
template <class Tracer>
LUCH_FN void walk_inside(SubsurfaceWalk& walk, Tracer& tracer, u64* steps) {
    WalkPlan plan = begin_walk(walk);
    WalkFate fate;
    do {
        fate = take_step(walk, plan, tracer);
        ++*steps;
    } while (fate == WalkFate::GOES_ON);
    if (fate == WalkFate::LOST) walk.hit.instance = NONE;
}

// -- where it comes out ---------------------------------------------------------------------------

// What the material's program reads there, if its normals are bent; else only geometry is asked. As if the ray had
// come from outside: normals face outwards.
LUCH_FN LaneInputs exit_inputs(const PathState& path, u32 path_index, const SubsurfaceWalk& walk,
                               const SurfacePoint& at, float time) {
    return surface_inputs(path, path_index, walk.hit, at, -walk.direction, time);
}
LUCH_FN SurfacePoint exit_point(const RenderView& scene, const SubsurfaceWalk& walk, float time) {
    return surface_point(scene.view, walk.hit, {walk.position, 0.0f, walk.direction, INFINITE_DISTANCE}, time);
}

// The normal of the lobes under the surface, as the program at the exit made them.
LUCH_FN Vec3 exit_normal(const ClosureSet& set, Vec3 fallback) {
    Vec3 sum = make_vec3(0.0f);
    for (int i = 0; i < set.count; ++i)
        if (is_subsurface(set.lobes[i].type)) sum += set.lobes[i].normal * average(set.lobes[i].weight);
    return normalize_or(sum, fallback);
}

// White and diffuse: the colour is in the path's throughput already.
LUCH_FN void setup_exit(ClosureSet& set, const ShadePoints& points, int lane, Vec3 normal) {
    SetupContext context;
    context.n = lane_normal(points, lane);
    context.ng = lane_face_normal(points, lane);
    context.wo = lane_to_viewer(points, lane);
    clear_closures(set);
    Lobe lobe;
    if (start_lobe(lobe, LobeType::DIFFUSE, make_vec3(1.0f), normal, context)) add_lobe(set, lobe, context);
}

}  // namespace luch
