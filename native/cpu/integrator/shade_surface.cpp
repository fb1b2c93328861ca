// Shading of one chunk: up to SHADE_LANES hits that share a material.
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"
#include "luch/bsdf/bsdf.h"
#include "luch/geometry/surface.h"
#include "luch/light/sample.h"

namespace luch::cpu {

void Batch::shade_chunk(u32 material_index, const u32* queue, int count) {
    const MaterialView& material = scene_.view.materials[material_index];
    ShadePoints& points = scratch_->points;
    ClosureSet* sets = scratch_->sets;
    counts_.surface_points += u64(count);
    setup_chunk(queue, count, points);
    float* aovs = aovs_.empty() ? nullptr : aovs_.data();
    if (aovs) std::fill(aovs_.begin(), aovs_.end(), 0.0f);
    run_program(scene_.view, material.program, points, sets, registers_.data(), aovs,
                size_t(writer_.film.layout.aov_count) * 4);

    int lit_count = 0;
    for (int lane = 0; lane < count; lane++) {
        u32 k = queue[lane];
        PathState& path = paths_[ray_path_[k]];
        ClosureSet& set = sets[lane];
        soften(path, set);
        if (apply_holdout(path, points, lane, set)) continue;
        if (!is_zero(set.emission)) add_surface_emission(path, hits_[k], points, lane, set.emission);
        if (path.flags & PATH_ENDS_AT_SURFACE) continue;
        if (path.continuation != 1.0f) path.throughput *= 1.0f / path.continuation;
        if (aovs) write_aovs(path, aovs + size_t(lane) * size_t(writer_.film.layout.aov_count) * 4);
        if (writer_.film.layout.any_data_pass) write_data_passes(path, points, lane, set, material_index);
        if (path.flags & PATH_FEATURES) write_features(path, set, lane_to_viewer(points, lane));
        if (path.flags & PATH_LAST_BOUNCE) set.count = 0;  // only straight-through light goes on
        scratch_->lit_lanes[lit_count++] = lane;
    }
    if (lit_count == 0) return;
    draw_numbers(queue, lit_count);
    if (scene_.has_lights) sample_lights(queue, lit_count);
    for (int i = 0; i < lit_count; i++) {
        int lane = scratch_->lit_lanes[i];
        u32 k = queue[lane];
        PathState& path = paths_[ray_path_[k]];
        if (writer_.film.layout.ambient_occlusion != NONE && (path.flags & PATH_CAMERA))
            sample_ao(path, ray_path_[k], lane);
        const auto& u = scratch_->scatter_u;
        scatter(path, k, lane, {u[0][i], u[1][i], u[2][i]});
    }
}

// All random numbers of the chunk in two loops, which vectorise: one by one they took a tenth of the time.
void Batch::draw_numbers(const u32* queue, int lit_count) {
    u32 seed[SHADE_LANES], index[SHADE_LANES], dimension[SHADE_LANES];
    for (int i = 0; i < lit_count; i++) {
        const PathState& path = paths_[ray_path_[queue[scratch_->lit_lanes[i]]]];
        seed[i] = path.sampler.seed, index[i] = path.sampler.index, dimension[i] = path.dimension;
    }
    auto draw = [&](u32 event_dimension, float (&to)[3][SHADE_LANES]) {
        for (int i = 0; i < lit_count; i++) {
            Vec3 u = sample_3d(Sampler{seed[i], index[i]}, dimension[i] + event_dimension);
            to[0][i] = u.x, to[1][i] = u.y, to[2][i] = u.z;
        }
    };
    if (scene_.has_lights) draw(DIM_LIGHT, scratch_->light_u);
    draw(DIM_BSDF, scratch_->scatter_u);
}

void Batch::setup_chunk(const u32* queue, int count, ShadePoints& points) {
    points.count = count;
    for (int lane = 0; lane < count; lane++) {
        u32 k = queue[lane];
        const PathState& path = paths_[ray_path_[k]];
        const Hit& hit = hits_[k];
        SurfacePoint& spawn = scratch_->spawn[lane];
        spawn = surface_point(scene_.view, hit);
        LaneInputs in;
        in.point = spawn.p;
        in.to_viewer = -rays_[k].direction;
        in.instance = hit.instance, in.prim = hit.prim;
        in.u = hit.u, in.v = hit.v;
        in.ray_length = hit.t + path.travelled;
        in.footprint = path.footprint + in.ray_length * path.spread;
        in.flags = path.flags & 0xffffu;
        in.depth = depth_word(path);
        in.transparent_depth = path.transparent_bounce;
        in.path = ray_path_[k];
        in.seed = path.sampler.seed ^ path.sampler.index * 0x9e3779b9u;
        setup_surface_lane(scene_.view, in, points, lane);
    }
}

// Filter Glossy: after improbable bounces sharp lobes are blurred.
void Batch::soften(const PathState& path, ClosureSet& set) const {
    if (!(scene_.limits.filter_glossy > 0.0f)) return;
    // Blender's knob is a roughness; its inverse bounds the density that stays sharp.
    float blur_pdf = path.min_pdf / scene_.limits.filter_glossy;
    if (blur_pdf < 1.0f) blur_closures(set, sqrt_f(1.0f - blur_pdf) * 0.5f);
}

// True when nothing is left of the path.
bool Batch::apply_holdout(PathState& path, const ShadePoints& points, int lane, ClosureSet& set) {
    bool whole = scene_.view.instances[points.instance[lane]].flags & INSTANCE_HOLDOUT;
    if ((!whole && !(set.holdout > 0.0f)) || !(path.flags & PATH_THROUGH_FILM)) return false;
    float weight = whole ? 1.0f - average(set.transparent) : set.holdout;
    add_alpha_hole(path, average(path.throughput) * weight);
    if (whole) {
        set.count = 0;
        set.emission = make_vec3(0.0f);
        return is_zero(set.transparent);
    }
    return weight >= 1.0f;
}

void Batch::add_surface_emission(PathState& path, const Hit& hit, const ShadePoints& points, int lane, Color emission) {
    float pdf = 0.0f;
    if (!(path.flags & PATH_NO_MIS)) {
        pdf = pdf_triangle(scene_.view, path.mis_origin, path.mis_normal, path.flags & PATH_MIS_TRANSMITS, hit.instance,
                           hit.prim, -lane_to_viewer(points, lane), points.ray_length[lane]);
    }
    u32 object = scene_.view.instances[hit.instance].object;
    add_emission(path, emission * mis_weight(path.mis_pdf, pdf), writer_.film.layout.emission,
                 scene_.view.objects[object].lightgroup);
}

bool Batch::set_transmits(const ClosureSet& set) {
    for (int i = 0; i < set.count; i++) {
        const Lobe& lobe = set.lobes[i];
        if (lobe.type == LobeType::TRANSLUCENT || lobe.type == LobeType::MICROFACET_REFRACTION ||
            lobe.type == LobeType::MICROFACET_GLASS || (lobe.flags & LOBE_MIRRORED)) {
            return true;
        }
    }
    return false;
}

void Batch::push_ray(u32 path, Vec3 origin, Vec3 direction) {
    next_rays_[next_count_] = {origin, 0.0f, direction, INFINITE_DISTANCE};
    next_path_[next_count_++] = path;
}

// Straight on, with the same direction, pdf and origin for the lights' weights.
void Batch::pass_through(PathState& path, u32 k, int lane, Color weight) {
    path.throughput *= weight;
    path.travelled += hits_[k].t;
    count_transparent(path, scene_.limits);
    Vec3 origin = offset_origin(scratch_->spawn[lane], lane_face_normal(scratch_->points, lane), rays_[k].direction);
    push_ray(ray_path_[k], origin, rays_[k].direction);
}

void Batch::scatter(PathState& path, u32 k, int lane, Vec3 u) {
    const ShadePoints& points = scratch_->points;
    const ClosureSet& set = scratch_->sets[lane];
    float through = average(set.transparent), lobes = lobe_weight_sum(set);
    if (!(through + lobes > 0.0f)) return;
    float u_lobe = u.z;
    float through_probability = through / (through + lobes);
    if (u_lobe < through_probability) {
        pass_through(path, k, lane, set.transparent * (1.0f / through_probability));
        return;
    }
    u_lobe = min_f((u_lobe - through_probability) / (1.0f - through_probability), 0.99999994f);
    Vec3 ng = lane_face_normal(points, lane);
    BsdfSample s = sample_closures(set, ng, lane_to_viewer(points, lane), u_lobe, {u.x, u.y});
    if (!(s.pdf_sa > 0.0f) || is_zero(s.throughput)) return;
    if (!finite_v(s.throughput)) {
        counts_.bad_samples++;
        return;
    }
    if (!(path.flags & PATH_PASS_CHOSEN)) choose_passes(path, s);
    float lobe_probability = 1.0f - through_probability;
    path.throughput *= s.throughput * (1.0f / lobe_probability);
    path.mis_pdf = s.pdf_sa * lobe_probability;
    path.min_pdf = min_f(path.min_pdf, s.delta ? path.min_pdf : path.mis_pdf);
    path.mis_origin = lane_position(points, lane);
    path.mis_normal = lane_normal(points, lane);
    path.footprint = points.footprint[lane];
    path.travelled = 0.0f;
    bool see_through = s.transmitted && scene_.limits.film_transparent_glass && scene_.limits.film_transparent &&
                       s.roughness <= sqr(scene_.limits.film_transparent_roughness);
    count_bounce(path, scene_.limits, s, set_transmits(set), see_through);
    if (looks_for_light_alone(path) && !scene_.can_meet_light) return;
    push_ray(ray_path_[k], offset_origin(scratch_->spawn[lane], ng, s.direction), s.direction);
}

// The first bounce decides how its later light is shared among the light passes.
void Batch::choose_passes(PathState& path, const BsdfSample& s) {
    if (!writer_.film.layout.any_light_pass) return;
    path.pass_diffuse = make_vec3(s.lobe_class == CLASS_DIFFUSE ? 1.0f : 0.0f);
    path.pass_glossy = make_vec3(s.lobe_class == CLASS_GLOSSY ? 1.0f : 0.0f);
    if (s.delta) return;
    Color sum = total(s.value);
    path.pass_diffuse = share(s.value.diffuse, sum);
    path.pass_glossy = share(s.value.glossy, sum);
}

}  // namespace luch::cpu
