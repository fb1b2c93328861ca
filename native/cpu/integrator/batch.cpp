#include "cpu/integrator/batch.h"

#include <algorithm>

#include "cpu/integrator/scratch.h"
#include "luch/light/closest_lamp.h"
#include "luch/light/sample.h"

namespace luch::cpu {

Batch::Batch(const RenderScene& scene, const FilmView& film)
    : scene_(scene),
      writer_{film, 0},
      scratch_(std::make_unique<Scratch>()),
      registers_(scene.max_registers * SHADE_LANES) {
    paths_.resize(BATCH_PATHS);
    rays_.resize(BATCH_PATHS);
    next_rays_.resize(BATCH_PATHS);
    ray_path_.resize(BATCH_PATHS);
    next_path_.resize(BATCH_PATHS);
    ray_kind_.resize(BATCH_PATHS);
    hits_.resize(BATCH_PATHS);
    sorted_.resize(BATCH_PATHS);
    hit_material_.resize(BATCH_PATHS);
    // A path casts one shadow ray and one for ambient occlusion at each point.
    shadow_rays_.resize(BATCH_PATHS * 2);
    shadows_.resize(BATCH_PATHS * 2);
    shadow_kind_.resize(BATCH_PATHS * 2);
    blocked_.resize(BATCH_PATHS * 2);
    material_first_.resize(scene.view.material_count + 1);
    aovs_.resize(size_t(film.layout.aov_count) * 4 * SHADE_LANES);
}

Batch::~Batch() = default;

void BatchCounts::add(const BatchCounts& other) {
    paths += other.paths;
    rays += other.rays;
    shadow_rays += other.shadow_rays;
    surface_points += other.surface_points;
    bad_samples += other.bad_samples;
    lens_samples += other.lens_samples;
    lamp_searches += other.lamp_searches;
    transparent_steps += other.transparent_steps;
    world_points += other.world_points;
    light_points += other.light_points;
}

BatchCounts Batch::counts() const {
    BatchCounts counts = counts_;
    counts.bad_samples += writer_.rejected;
    return counts;
}

bool Batch::wants_features() const {
    const FilmLayout& layout = writer_.film.layout;
    return layout.denoising_albedo != NONE || layout.denoising_normal != NONE;
}

void Batch::trace(const PixelBlock& block) {
    generate(block);
    while (ray_count_ > 0) {
        traverse();
        find_lamps();
        shade_misses();
        sort_hits_by_material();
        next_count_ = 0;
        shadow_count_ = 0;
        shade_hits();
        trace_shadows();
        std::swap(rays_, next_rays_);
        std::swap(ray_path_, next_path_);
        ray_count_ = next_count_;
    }
}

void Batch::generate(const PixelBlock& block) {
    ray_count_ = 0;
    u32 end = block.first_sample + block.sample_count;
    u32 others = scene_.halves ? end / 2u - block.first_sample / 2u : 0u;  // odd ones
    for (int y = 0; y < block.height; y++) {
        for (int x = 0; x < block.width; x++) {
            u32 px = u32(block.x0 + x), py = u32(block.y0 + y);
            film_count_samples(writer_, film_pixel(px, py), block.sample_count, others);
            PixelSequences pixel = make_pixel_sequences(px, py, scene_.seed, scene_.log2_samples, scene_.halves);
            for (u32 s = 0; s < block.sample_count; s += CAMERA_LANES) {
                u32 count = std::min(u32(CAMERA_LANES), block.sample_count - s);
                generate_pixel(pixel, px, py, block.first_sample + s, count);
            }
        }
    }
    counts_.paths += u64(ray_count_);
}

void Batch::generate_pixel(const PixelSequences& pixel, u32 px, u32 py, u32 first_sample, u32 count) {
    // Random numbers first, of all samples: that loop vectorises.
    float filter_u[2][CAMERA_LANES], lens_u[2][CAMERA_LANES] = {};
    for (u32 i = 0; i < count; i++) {
        Vec2 u = sample_2d(make_sampler(pixel, first_sample + i), 0);
        filter_u[0][i] = u.x, filter_u[1][i] = u.y;
    }
    for (u32 i = 0; i < count && scene_.camera.aperture_radius > 0.0f; i++) {
        Vec2 u = sample_2d(make_sampler(pixel, first_sample + i), 1);
        lens_u[0][i] = u.x, lens_u[1][i] = u.y;
        counts_.lens_samples++;
    }
    for (u32 i = 0; i < count; i++) {
        int k = ray_count_++;
        PathState& path = paths_[k];
        path = PathState{};
        path.sampler = make_sampler(pixel, first_sample + i);
        path.sample = first_sample + i;
        Vec2 offset = sample_filter(scene_.filter, Vec2{filter_u[0][i], filter_u[1][i]});
        Vec2 lens = scene_.camera.aperture_radius > 0.0f ? Vec2{lens_u[0][i], lens_u[1][i]} : Vec2{0.5f, 0.5f};
        CameraRay camera = generate_ray(scene_.camera, {px + 0.5f + offset.x, py + 0.5f + offset.y}, lens);
        path.throughput = path.feature_throughput = make_vec3(1.0f);
        path.continuation = 1.0f;
        path.min_pdf = 1e30f;
        path.flags = u32(PATH_CAMERA) | PATH_NO_MIS | PATH_THROUGH_FILM | (wants_features() ? u32(PATH_FEATURES) : 0u);
        if (path.sample & u32(scene_.halves)) path.flags |= PATH_OTHER_HALF;
        path.visibility = RAY_CAMERA;
        path.dimension = DIMENSIONS_CAMERA;
        path.pixel = film_pixel(px, py);
        path.mis_origin = camera.ray.origin;
        path.footprint = camera.footprint;
        path.spread = camera.spread;
        rays_[k] = camera.ray;
        ray_path_[k] = u32(k);
    }
}

void Batch::traverse() {
    for (int k = 0; k < ray_count_; k++) ray_kind_[k] = paths_[ray_path_[k]].visibility;
    scene_.accel->closest(rays_.data(), ray_kind_.data(), hits_.data(), size_t(ray_count_));
    counts_.rays += u64(ray_count_);
}

// Lamps do not stop rays: every lamp in front of the surface adds its light.
void Batch::find_lamps() {
    if (!scene_.has_visible_lamps) return;
    counts_.lamp_searches += u64(ray_count_);
    for (int k = 0; k < ray_count_; k++) {
        PathState& path = paths_[ray_path_[k]];
        Ray ray = rays_[k];
        ray.t_max = min_f(hits_[k].t, ray.t_max);
        for (u32 passed = 0; passed < scene_.limits.transparent + 1; passed++) {
            LampHit lamp = closest_lamp(scene_.view, ray, path.visibility);
            if (lamp.lamp == NONE) break;
            add_lamp(path, lamp, ray);
            // Past this lamp: the next float after its distance.
            ray.t_min = bits_float(float_bits(max_f(lamp.t, 1e-30f)) + 1u);
            if (!(ray.t_min < ray.t_max)) break;
        }
    }
}

// Light of a lamp or sun that a path found by itself.
void Batch::add_lamp(const PathState& path, const LampHit& hit, const Ray& ray) {
    float pdf = 0.0f;
    if (!(path.flags & PATH_NO_MIS)) {
        pdf = pdf_lamp(scene_.view, path.mis_origin, path.mis_normal, path.flags & PATH_MIS_TRANSMITS, hit,
                       ray.direction);
    }
    Color light = eval_lamp(path, hit, ray) * hit.radiance;
    add_emission(path, light * mis_weight(path.mis_pdf, pdf), writer_.film.layout.emission,
                 scene_.view.lights->lamps[hit.lamp].lightgroup);
}

void Batch::shade_misses() {
    u32 chunk[SHADE_LANES];
    int count = 0;
    for (int k = 0; k < ray_count_; k++) {
        if (hits_[k].instance != NONE) continue;
        const PathState& path = paths_[ray_path_[k]];
        add_suns(path, rays_[k]);
        bool data_open = (path.flags & PATH_THROUGH_FILM) && !(path.flags & PATH_DATA_DONE);
        if (data_open && path.sample == 0) film_set_background(writer_, path.pixel);
        bool as_alpha = scene_.limits.film_transparent && (path.flags & PATH_THROUGH_FILM);
        if (as_alpha) add_alpha_hole(path, average(path.throughput));
        if (as_alpha && writer_.film.layout.environment == NONE) continue;
        if (!scene_.has_world || !(scene_.world_visibility & path.visibility)) continue;
        chunk[count++] = u32(k);
        if (count == SHADE_LANES) {
            add_world(chunk, count);
            count = 0;
        }
    }
    if (count > 0) add_world(chunk, count);
}

// Suns with an angle, as a ray that leaves the scene sees them.
void Batch::add_suns(const PathState& path, const Ray& ray) {
    for (u32 sun = 0; sun < scene_.view.lights->sun_count; sun++) {
        LampHit hit = sun_hit(scene_.view, sun, ray.direction, path.visibility);
        if (hit.lamp != NONE) add_lamp(path, hit, ray);
    }
}

void Batch::add_world(const u32* queue, int count) {
    Color* radiance = scratch_->emission;
    if (scene_.world_emission.constant) {
        for (int i = 0; i < count; i++) radiance[i] = scene_.world_emission.radiance;
    } else {
        counts_.world_points += u64(count);
        ShadePoints& points = scratch_->light_points;
        points.count = count;
        for (int i = 0; i < count; i++) {
            u32 k = queue[i];
            const PathState& path = paths_[ray_path_[k]];
            LaneInputs in{};
            in.point = rays_[k].direction;
            in.to_viewer = -rays_[k].direction;
            in.instance = in.prim = NONE;
            in.footprint = path.spread;
            in.flags = path.flags & 0xffffu;
            in.depth = depth_word(path);
            in.transparent_depth = path.transparent_bounce;
            setup_free_lane(in, -rays_[k].direction, points, i);
        }
        run_program(scene_.view, scene_.view.world_program, points, scratch_->light_sets, registers_.data());
        for (int i = 0; i < count; i++) radiance[i] = scratch_->light_sets[i].emission;
    }
    for (int i = 0; i < count; i++) {
        u32 k = queue[i];
        const PathState& path = paths_[ray_path_[k]];
        float pdf = 0.0f;
        if (!(path.flags & PATH_NO_MIS)) {
            pdf = pdf_world(scene_.view, path.mis_origin, path.mis_normal, path.flags & PATH_MIS_TRANSMITS,
                            rays_[k].direction);
        }
        Color light = radiance[i] * mis_weight(path.mis_pdf, pdf);
        if (scene_.limits.film_transparent && (path.flags & PATH_THROUGH_FILM)) {
            add_environment_only(path, light);
        } else {
            add_emission(path, light, writer_.film.layout.environment, scene_.world_lightgroup);
        }
    }
}

void Batch::sort_hits_by_material() {
    std::fill(material_first_.begin(), material_first_.end(), 0u);
    for (int k = 0; k < ray_count_; k++) {
        if (hits_[k].instance == NONE) continue;
        hit_material_[k] = material_at(scene_.view, hits_[k].instance, hits_[k].prim);
        material_first_[hit_material_[k] + 1]++;
    }
    for (size_t m = 1; m < material_first_.size(); m++) material_first_[m] += material_first_[m - 1];
    for (int k = 0; k < ray_count_; k++) {
        if (hits_[k].instance != NONE) sorted_[material_first_[hit_material_[k]]++] = u32(k);
    }
    // material_first_[m] has moved to the end of group m, the start of group m + 1.
}

// After its last bounce a path brings back nothing but light that it meets, unless the film or a denoiser's pass
// waits for what lies behind.
bool Batch::looks_for_light_alone(const PathState& path) {
    constexpr u32 more = u32(PATH_FEATURES) | u32(PATH_THROUGH_FILM);
    return (path.flags & PATH_LAST_BOUNCE) && !(path.flags & more);
}

// Decides Russian roulette before shading: a path that ends on a surface without emission is dropped unseen.
bool Batch::survives(PathState& path, const MaterialView& material) {
    path.continuation = continuation_probability(path, scene_.limits);
    bool emits = material.program.flags & PROGRAM_EMISSION;
    if (path.flags & PATH_ENDS_AT_SURFACE) return emits;
    bool lets_through = material.program.flags & PROGRAM_TRANSPARENT;
    if (!emits && !lets_through && looks_for_light_alone(path)) return false;
    if (path.continuation == 1.0f) return true;
    float u = sample_1d(path.sampler, path.dimension + DIM_TERMINATE);
    if (path.continuation > 0.0f && u < path.continuation) return true;
    path.flags |= PATH_ENDS_AT_SURFACE;
    return emits;
}

void Batch::shade_hits() {
    u32 begin = 0;
    for (u32 m = 0; m < scene_.view.material_count; m++) {
        u32 end = material_first_[m];
        u32 chunk[SHADE_LANES];
        int count = 0;
        for (u32 i = begin; i < end; i++) {
            u32 k = sorted_[i];
            if (!survives(paths_[ray_path_[k]], scene_.view.materials[m])) continue;
            chunk[count++] = k;
            if (count == SHADE_LANES) {
                shade_chunk(m, chunk, count);
                count = 0;
            }
        }
        if (count > 0) shade_chunk(m, chunk, count);
        begin = end;
    }
}

void Batch::trace_shadows() {
    if (shadow_count_ == 0) return;
    scene_.accel->any(shadow_rays_.data(), shadow_kind_.data(), blocked_.data(), size_t(shadow_count_));
    counts_.shadow_rays += u64(shadow_count_);
    for (int k = 0; k < shadow_count_; k++) {
        const ShadowRay& shadow = shadows_[k];
        Color through = make_vec3(1.0f);
        if (shadow.casts) {
            if (blocked_[k] == BLOCKED_OPAQUE) continue;
            if (blocked_[k] == BLOCKED_MAYBE) through = walk_transparent(shadow_rays_[k], paths_[shadow.path]);
        }
        if (!is_zero(through)) add_direct(paths_[shadow.path], shadow, through);
    }
}

u32 Batch::film_pixel(u32 x, u32 y) const { return (y - writer_.film.y0) * writer_.film.width + (x - writer_.film.x0); }

u32 Batch::depth_word(const PathState& path) const {
    auto byte = [](u32 n) { return n < 255u ? n : 255u; };
    return byte(path.bounce) | byte(path.diffuse_bounce) << 8 | byte(path.glossy_bounce) << 16 |
           byte(path.transmission_bounce) << 24;
}

}  // namespace luch::cpu
