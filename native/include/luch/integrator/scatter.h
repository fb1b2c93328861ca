// What happens to a path at a surface: whether it goes on, what it sees of the closures, where it goes next.
#pragma once
#include "luch/bsdf/bsdf.h"
#include "luch/geometry/surface.h"
#include "luch/integrator/accumulate.h"
#include "luch/integrator/caustics.h"
#include "luch/light/sample.h"
#include "luch/math/bounds.h"

namespace luch {

// Decides Russian roulette before shading: a path that ends on a surface without emission is dropped unseen.
LUCH_FN bool survives(const RenderView& scene, FilmWriter& writer, PathState& path, const MaterialView& material) {
    path.continuation = continuation_probability(path, scene.limits);
    bool emits = material.program.flags & PROGRAM_EMISSION;
    if (path.flags & PATH_ENDS_AT_SURFACE) return emits;
    bool lets_through = material.program.flags & PROGRAM_TRANSPARENT;
    if (!emits && !lets_through && looks_for_light_alone(path)) {
        note_cut(writer, path, 1.0f);
        return false;
    }
    if (path.continuation == 1.0f) return true;
    float u = sample_1d(path.sampler, path.dimension + DIM_TERMINATE);
    if (path.continuation > 0.0f && u < path.continuation) return true;
    path.flags |= PATH_ENDS_AT_SURFACE;
    return emits;
}

// What the material's program reads of a hit.
LUCH_FN LaneInputs surface_inputs(const PathState& path, u32 path_index, const Hit& hit, const SurfacePoint& at,
                                  Vec3 direction, float time) {
    LaneInputs in;
    in.point = at.p, in.radial = at.radial;
    in.to_viewer = -direction;
    in.instance = hit.instance, in.prim = hit.prim;
    in.u = hit.u, in.v = hit.v;
    in.ray_length = hit.t + path.travelled;
    in.footprint = path.footprint + in.ray_length * path.spread;
    in.flags = path.flags & 0xffffu;
    in.depth = depth_word(path);
    in.transparent_depth = path.transparent_bounce;
    in.path = path_index;
    in.seed = path.sampler.seed ^ path.sampler.index * 0x9e3779b9u;
    in.time = time;
    return in;
}

// A lane of points for a hit, and where it is. path_index, time: of the path; ray: the one that found the hit.
LUCH_FN SurfacePoint setup_hit_lane(const RenderView& scene, const PathState& path, u32 path_index, const Hit& hit,
                                    const Ray& ray, float time, ShadePoints& points, int lane) {
    SurfacePoint at = surface_point(scene.view, hit, ray, time);
    setup_surface_lane(scene.view, surface_inputs(path, path_index, hit, at, ray.direction, time), points, lane);
    return at;
}

// Filter Glossy: after improbable bounces sharp lobes are blurred.
LUCH_FN void soften(const PathLimits& limits, const PathState& path, ClosureSet& set) {
    if (!plan::FILTER_GLOSSY || !(limits.filter_glossy > 0.0f)) return;
    // Blender's knob is a roughness; its inverse bounds the density that stays sharp.
    float blur_pdf = path.min_pdf / limits.filter_glossy;
    if (blur_pdf < 1.0f) blur_closures(set, sqrt_f(1.0f - blur_pdf) * 0.5f);
}

// True when nothing is left of the path.
LUCH_FN bool apply_holdout(const RenderView& scene, FilmWriter& writer, PathState& path, u32 instance,
                           ClosureSet& set) {
    bool whole = plan::HOLDOUT && (scene.view.instances[instance].flags & INSTANCE_HOLDOUT);
    if (!plan::HOLDOUT) return false;
    if ((!whole && !(set.holdout > 0.0f)) || !(path.flags & PATH_THROUGH_FILM)) return false;
    float weight = whole ? 1.0f - average(set.transparent) : set.holdout;
    add_alpha_hole(writer, path, average(path.throughput) * weight);
    if (whole) {
        set.count = 0;
        set.emission = make_vec3(0.0f);
        return is_zero(set.transparent);
    }
    return weight >= 1.0f;
}

LUCH_FN void add_surface_emission(const RenderView& scene, FilmWriter& writer, const PathState& path,
                                  const ShadePoints& points, int lane, Color emission) {
    float pdf = 0.0f;
    u32 instance = points.instance[lane];
    if (plan::EMISSIVE_MESHES && is_caustic(path) &&
        pdf_triangle(scene.view, path.mis_origin, path.mis_normal, true, instance, points.prim[lane],
                     -lane_to_viewer(points, lane), points.ray_length[lane], lane_time(points, lane)) > 0.0f)
        return;
    if (plan::EMISSIVE_MESHES && !(path.flags & PATH_NO_MIS)) {
        pdf = pdf_triangle(scene.view, path.mis_origin, path.mis_normal, path.flags & PATH_MIS_TRANSMITS, instance,
                           points.prim[lane], -lane_to_viewer(points, lane), points.ray_length[lane],
                           lane_time(points, lane));
    }
    add_emission(scene, writer, path, emission * mis_weight(path.mis_pdf, pdf), writer.film.layout.emission,
                 scene.view.objects[scene.view.instances[instance].object].lightgroup);
}

// All that a path leaves at a surface before it is lit and goes on; false when it ends here. aovs: of this point, or
// null where the film has none.
LUCH_FN bool meet_surface(const RenderView& scene, FilmWriter& writer, PathState& path, const ShadePoints& points,
                          int lane, ClosureSet& set, u32 material, const float* aovs) {
    soften(scene.limits, path, set);
    if (apply_holdout(scene, writer, path, points.instance[lane], set)) return false;
    if (!is_zero(set.emission)) add_surface_emission(scene, writer, path, points, lane, set.emission);
    if (path.flags & PATH_ENDS_AT_SURFACE) return false;
    if (path.continuation != 1.0f) path.throughput *= 1.0f / path.continuation;
    if (aovs) write_aovs(writer, path, aovs);
    if (wants_data_passes(writer.film.layout)) write_data_passes(scene, writer, path, points, lane, set, material);
    if (gathers_features(path)) write_features(scene, writer, path, set, lane_to_viewer(points, lane));
    if (path.flags & PATH_LAST_BOUNCE) {  // only straight-through light goes on
        if (set.count > 0) note_cut(writer, path, 1.0f - average(set.transparent));
        set.count = 0;
    }
    return true;
}

LUCH_FN bool set_transmits(const ClosureSet& set) {
    for (int i = 0; i < set.count; i++) {
        const Lobe& lobe = set.lobes[i];
        if (lobe.type == LobeType::TRANSLUCENT || lobe.type == LobeType::MICROFACET_REFRACTION ||
            lobe.type == LobeType::MICROFACET_GLASS || lobe.type == LobeType::HAIR_FIBRE ||
            lobe.type == LobeType::HAIR_TRANSMISSION || (lobe.flags & LOBE_MIRRORED)) {
            return true;
        }
    }
    return false;
}

// The first bounce decides how its later light is shared among the light passes.
LUCH_FN void choose_passes(const FilmLayout& layout, PathState& path, const BsdfSample& s) {
    if (!wants_light_passes(layout)) return;
    path.pass_diffuse = make_vec3(s.lobe_class == CLASS_DIFFUSE ? 1.0f : 0.0f);
    path.pass_glossy = make_vec3(s.lobe_class == CLASS_GLOSSY ? 1.0f : 0.0f);
    if (s.delta) return;
    Color sum = total(s.value);
    path.pass_diffuse = share(s.value.diffuse, sum);
    path.pass_glossy = share(s.value.glossy, sum);
}

LUCH_FN Ray ray_from(const SurfacePoint& spawn, Vec3 ng, Vec3 direction) {
    return {offset_origin(spawn, ng, direction), 0.0f, direction, INFINITE_DISTANCE};
}

// Chooses where the path goes on; false when it ends. u: two numbers for the direction, one for the choice of lobe;
// incoming: direction and hit distance of the ray that came here. The next ray goes to *next.
LUCH_FN bool scatter(const RenderView& scene, FilmWriter& writer, PathState& path, const ShadePoints& points, int lane,
                     const ClosureSet& set, const SurfacePoint& spawn, Vec3 u, Vec3 incoming, float distance,
                     Ray* next) {
    float through = average(set.transparent), lobes = lobe_weight_sum(set);
    if (!(through + lobes > 0.0f)) return false;
    Vec3 ng = lane_face_normal(points, lane);
    float u_lobe = u.z;
    float through_probability = through / (through + lobes);
    if (u_lobe < through_probability) {
        // Straight on, with the same direction, pdf and origin for the lights' weights.
        path.throughput *= set.transparent * (1.0f / through_probability);
        path.travelled += distance;
        count_transparent(path, scene.limits);
        *next = ray_from(spawn, ng, incoming);
        return true;
    }
    u_lobe = min_f((u_lobe - through_probability) / (1.0f - through_probability), BELOW_ONE);
    BsdfSample s;
    float lobe_probability = 1.0f - through_probability;
    bool sharp = false;
    if (has_photons(scene)) {
        ClosureSet part;
        bool casts = casts_caustics(scene.view, points.instance[lane], points.prim[lane]);
        lobe_probability *= choose_part(set, casts, &u_lobe, &sharp, &part);
        s = sample_closures(part, ng, lane_to_viewer(points, lane), u_lobe, {u.x, u.y});
    } else {
        s = sample_closures(set, ng, lane_to_viewer(points, lane), u_lobe, {u.x, u.y});
    }
    if (!(s.pdf_sa > 0.0f) || is_zero(s.throughput)) return false;
    if (!finite_v(s.throughput)) {
        count_one(writer.refused + REFUSED_SCATTER);
        return false;
    }
    if (!(path.flags & PATH_PASS_CHOSEN)) choose_passes(writer.film.layout, path, s);
    path.throughput *= s.throughput * (1.0f / lobe_probability);
    path.mis_pdf = s.pdf_sa * lobe_probability;
    path.min_pdf = min_f(path.min_pdf, s.delta ? path.min_pdf : path.mis_pdf);
    path.mis_origin = lane_position(points, lane);
    path.mis_normal = lane_normal(points, lane);
    path.footprint = points.footprint[lane];
    path.travelled = 0.0f;
    bool see_through = s.transmitted && scene.limits.film_transparent_glass && scene.limits.film_transparent &&
                       s.roughness <= sqr(scene.limits.film_transparent_roughness);
    count_bounce(path, scene.limits, s, set_transmits(set), see_through);
    if (has_photons(scene)) note_part(path, sharp);
    if (looks_for_light_alone(path) && !scene.can_meet_light) {
        note_cut(writer, path, 1.0f);
        return false;
    }
    *next = ray_from(spawn, ng, s.direction);
    return true;
}

}  // namespace luch
