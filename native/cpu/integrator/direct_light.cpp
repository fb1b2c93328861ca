// Next-event estimation: one light per shaded point, its emission, and the shadow ray.
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"
#include "luch/bsdf/bsdf.h"
#include "luch/geometry/surface.h"
#include "luch/light/sample.h"

namespace luch::cpu {
namespace {

// The shadow ray stops this fraction short of a sampled point, so that the light does not block itself: 84 ulp
// of the distance, where the point on the light and the ray to it are each off by a few.
constexpr float LIGHT_SHORTENING = 1e-5f;

Color only(BsdfValue& value, u32 visibility) {
    if (!(visibility & RAY_DIFFUSE)) value.diffuse = make_vec3(0.0f);
    if (!(visibility & RAY_GLOSSY)) value.glossy = make_vec3(0.0f);
    if (!(visibility & RAY_TRANSMISSION)) value.transmission = make_vec3(0.0f);
    return total(value);
}

// Blender's Max Bounces of a lamp or of the world, as Cycles hears it: it ends sampling, not seeing.
bool light_is_spent(const LightsView& lights, const LightSample& s, u32 bounce) {
    if (s.kind == EmitterKind::LAMP) return bounce > lights.lamps[s.lamp].max_bounces;
    return s.kind == EmitterKind::WORLD && bounce > lights.world.max_bounces;
}

}  // namespace

void Batch::sample_lights(const u32* queue, int lit_count) {
    const ShadePoints& points = scratch_->points;
    LightSample* samples = scratch_->samples;
    int wanted[SHADE_LANES], wanted_count = 0;
    for (int i = 0; i < lit_count; i++) {
        int lane = scratch_->lit_lanes[i];
        const ClosureSet& set = scratch_->sets[lane];
        if (set.count == 0 || !has_smooth_lobe(set)) continue;
        Vec3 u = {scratch_->light_u[0][i], scratch_->light_u[1][i], scratch_->light_u[2][i]};
        samples[lane] = sample_light(scene_.view, lane_position(points, lane), lane_normal(points, lane),
                                     set_transmits(set), u.z, {u.x, u.y});
        const LightSample& s = samples[lane];
        if (s.kind == EmitterKind::NONE_ || !(s.pdf_sa > 0.0f)) continue;
        if (light_is_spent(*scene_.view.lights, s, paths_[ray_path_[queue[lane]]].bounce)) continue;
        wanted[wanted_count++] = lane;
    }
    if (wanted_count == 0) return;
    emission_of_samples(queue, wanted, wanted_count);
    for (int i = 0; i < wanted_count; i++) cast_shadow_ray(queue[wanted[i]], wanted[i]);
}

void Batch::cast_shadow_ray(u32 k, int lane) {
    const LightSample& s = scratch_->samples[lane];
    Color light = scratch_->emission[lane] * s.radiance;
    if (is_zero(light)) return;
    const ShadePoints& points = scratch_->points;
    const ClosureSet& set = scratch_->sets[lane];
    const PathState& path = paths_[ray_path_[k]];
    Vec3 ng = lane_face_normal(points, lane);
    float bsdf_pdf = 0.0f;
    BsdfValue value = eval_closures(set, ng, lane_to_viewer(points, lane), s.direction, &bsdf_pdf);
    Color reflected = only(value, s.visibility);
    if (is_zero(reflected)) return;
    float lobes = lobe_weight_sum(set);
    bsdf_pdf *= lobes / (lobes + average(set.transparent));
    float weight = (s.mis ? mis_weight(s.pdf_sa, bsdf_pdf) : 1.0f) / s.pdf_sa;
    Ray ray;
    ray.origin = offset_origin(scratch_->spawn[lane], ng, s.direction);
    ray.t_min = 0.0f;
    ray.direction = s.direction;
    ray.t_max = s.distance;
    if (finite_f(s.distance)) {
        // From the moved origin to the very point on the light, stopped short of it.
        Vec3 to_light = s.point - ray.origin;
        float distance = length(to_light);
        if (!(distance > 0.0f)) return;
        ray.direction = to_light * (1.0f / distance);
        ray.t_max = distance * (1.0f - LIGHT_SHORTENING);
    }
    ShadowRay& shadow = shadows_[shadow_count_];
    shadow.contribution = path.throughput * reflected * light * weight;
    shadow.pass_diffuse = path.pass_diffuse;
    shadow.pass_glossy = path.pass_glossy;
    if (writer_.film.layout.any_light_pass && !(path.flags & PATH_PASS_CHOSEN)) {
        shadow.pass_diffuse = share(value.diffuse, reflected);
        shadow.pass_glossy = share(value.glossy, reflected);
    }
    shadow.path = ray_path_[k];
    shadow.bounce = path.bounce;
    shadow.lightgroup = s.lightgroup;
    shadow.for_ao = false;
    shadow.casts = s.cast_shadow;
    shadow_rays_[shadow_count_] = ray;
    shadow_kind_[shadow_count_++] = RAY_SHADOW;
}

// Emission at sampled points: constants by table, the rest through their programs, chunk by chunk.
void Batch::emission_of_samples(const u32* queue, const int* lanes, int count) {
    int open[SHADE_LANES], open_count = 0;
    for (int i = 0; i < count; i++) {
        const LightSample& s = scratch_->samples[lanes[i]];
        const ConstantEmission* constant = constant_emission_of(s);
        if (constant) {
            scratch_->emission[lanes[i]] = constant->radiance;
        } else {
            open[open_count++] = lanes[i];
        }
    }
    while (open_count > 0) {
        // All samples of one program at a time.
        const Program* program = program_of(scratch_->samples[open[0]]);
        int chosen[SHADE_LANES], chosen_count = 0, left = 0;
        for (int i = 0; i < open_count; i++) {
            if (program_of(scratch_->samples[open[i]]) == program)
                chosen[chosen_count++] = open[i];
            else
                open[left++] = open[i];
        }
        open_count = left;
        ShadePoints& points = scratch_->light_points;
        points.count = chosen_count;
        counts_.light_points += u64(chosen_count);
        for (int i = 0; i < chosen_count; i++) setup_light_lane(queue[chosen[i]], chosen[i], points, i);
        run_program(scene_.view, *program, points, scratch_->light_sets, registers_.data(), nullptr, 0, Wanted::LIGHT);
        for (int i = 0; i < chosen_count; i++) scratch_->emission[chosen[i]] = scratch_->light_sets[i].emission;
    }
}

const ConstantEmission* Batch::constant_emission_of(const LightSample& s) const {
    static const ConstantEmission one{true, {1.0f, 1.0f, 1.0f}};
    if (s.kind == EmitterKind::LAMP) return scene_.view.lights->lamps[s.lamp].has_program ? nullptr : &one;
    const ConstantEmission& found = s.kind == EmitterKind::WORLD
                                        ? scene_.world_emission
                                        : scene_.material_emission[material_at(scene_.view, s.instance, s.prim)];
    return found.constant ? &found : nullptr;
}

const Program* Batch::program_of(const LightSample& s) const {
    if (s.kind == EmitterKind::LAMP) return &scene_.view.lights->lamps[s.lamp].program;
    if (s.kind == EmitterKind::WORLD) return &scene_.view.world_program;
    return &scene_.view.materials[material_at(scene_.view, s.instance, s.prim)].program;
}

void Batch::setup_light_lane(u32 k, int lane, ShadePoints& points, int out) {
    const LightSample& s = scratch_->samples[lane];
    const PathState& path = paths_[ray_path_[k]];
    LaneInputs in;
    in.point = s.kind == EmitterKind::WORLD ? s.direction : s.point;
    in.to_viewer = -s.direction;
    in.instance = s.instance, in.prim = s.prim;
    in.u = s.u, in.v = s.v;
    in.ray_length = finite_f(s.distance) ? s.distance : 0.0f;
    in.footprint = scratch_->points.footprint[lane];
    in.flags = (path.flags & 0xffffu & ~u32(PATH_CAMERA)) | PATH_EMISSION_ONLY;
    in.depth = depth_word(path);
    in.transparent_depth = path.transparent_bounce;
    in.path = ray_path_[k];
    in.seed = 0;
    if (s.kind == EmitterKind::TRIANGLE) {
        setup_surface_lane(scene_.view, in, points, out);
        return;
    }
    in.prim = s.kind == EmitterKind::LAMP ? s.lamp : NONE;
    setup_free_lane(in, s.kind == EmitterKind::LAMP ? s.normal : -s.direction, points, out);
}

Color Batch::eval_lamp(const PathState& path, const LampHit& hit, const Ray& ray) {
    const LampView& lamp = scene_.view.lights->lamps[hit.lamp];
    if (!lamp.has_program) return make_vec3(1.0f);
    ShadePoints& points = scratch_->light_points;
    points.count = 1;
    LaneInputs in;
    in.point = finite_f(hit.t) ? ray.origin + ray.direction * hit.t : ray.direction;
    in.to_viewer = -ray.direction;
    in.instance = NONE, in.prim = hit.lamp;
    in.u = hit.u, in.v = hit.v;
    in.ray_length = finite_f(hit.t) ? hit.t + path.travelled : 0.0f;
    in.footprint = 0.0f;
    in.flags = (path.flags & 0xffffu) | PATH_EMISSION_ONLY;
    in.depth = depth_word(path);
    in.transparent_depth = path.transparent_bounce;
    in.path = 0, in.seed = 0;
    setup_free_lane(in, hit.normal, points, 0);
    run_program(scene_.view, lamp.program, points, scratch_->light_sets, registers_.data(), nullptr, 0, Wanted::LIGHT);
    return scratch_->light_sets[0].emission;
}

// A shadow ray that met only surfaces that may be transparent: from one to the next, until it is dark.
Color Batch::walk_transparent(const Ray& shadow, const PathState& path) {
    Color through = make_vec3(1.0f);
    Ray ray = shadow;
    u32 kind = RAY_SHADOW;
    for (u32 passed = path.transparent_bounce; passed <= scene_.limits.transparent; passed++) {
        Hit hit;
        scene_.accel->closest(&ray, &kind, &hit, 1);
        counts_.shadow_rays++;
        if (hit.instance == NONE) return through;
        if (passed == scene_.limits.transparent) return make_vec3(0.0f);
        const MaterialView& material = scene_.view.materials[material_at(scene_.view, hit.instance, hit.prim)];
        if (!(material.program.flags & PROGRAM_TRANSPARENT) || !material.transparent_shadows) return make_vec3(0.0f);
        counts_.transparent_steps++;
        SurfacePoint spot = surface_point(scene_.view, hit);
        ShadePoints& points = scratch_->light_points;
        points.count = 1;
        LaneInputs in;
        in.point = spot.p;
        in.to_viewer = -ray.direction;
        in.instance = hit.instance, in.prim = hit.prim;
        in.u = hit.u, in.v = hit.v;
        in.ray_length = hit.t;
        in.footprint = path.footprint;
        in.flags = PATH_SHADOW | PATH_TRANSPARENT_ONLY;
        in.depth = depth_word(path);
        in.transparent_depth = passed;
        in.path = 0, in.seed = 0;
        setup_surface_lane(scene_.view, in, points, 0);
        run_program(scene_.view, material.program, points, scratch_->light_sets, registers_.data(), nullptr, 0,
                    Wanted::LIGHT);
        through *= scratch_->light_sets[0].transparent;
        if (!(max_component(through) > 0.0f)) return make_vec3(0.0f);
        Vec3 origin = offset_origin(spot, lane_face_normal(points, 0), ray.direction);
        if (finite_f(ray.t_max)) ray.t_max -= dot(origin - ray.origin, ray.direction);
        ray.origin = origin;
        if (!(ray.t_max > 0.0f)) return through;
    }
    return make_vec3(0.0f);
}

void Batch::sample_ao(const PathState& path, u32 path_index, int lane) {
    const ShadePoints& points = scratch_->points;
    const ClosureSet& set = scratch_->sets[lane];
    Vec3 n = shading_normal(set, lane_normal(points, lane));
    Vec2 u = sample_2d(path.sampler, path.dimension + DIM_AO);
    Vec3 t, b;
    make_frame(n, &t, &b);
    Vec3 direction = to_world(sample_cosine_hemisphere(u), t, b, n);
    Vec3 ng = lane_face_normal(points, lane);
    shadow_rays_[shadow_count_] = {offset_origin(scratch_->spawn[lane], ng, direction), 0.0f, direction,
                                   scene_.limits.ao_distance};
    ShadowRay& shadow = shadows_[shadow_count_];
    shadow = ShadowRay{};
    shadow.contribution = path.throughput * (make_vec3(1.0f) - set.transparent);
    shadow.path = path_index;
    shadow.for_ao = true;
    shadow.casts = true;
    shadow_kind_[shadow_count_++] = RAY_SHADOW;
}

}  // namespace luch::cpu
