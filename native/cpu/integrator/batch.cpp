#include "cpu/integrator/batch.h"

#include <algorithm>

#include "cpu/integrator/scratch.h"
#include "luch/integrator/borders.h"
#include "luch/integrator/camera_path.h"
#include "luch/integrator/found_light.h"

namespace luch::cpu {
namespace {

const float* times_of(const std::vector<float>& times, int from) {
    return times.empty() ? nullptr : times.data() + from;
}

}  // namespace

Batch::Batch(const RenderScene& scene, const FilmView& film, const std::atomic<bool>& stop)
    : scene_(scene),
      writer_{film, counts_.refused},
      stop_(stop),
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
    // A path casts one shadow ray and one for ambient occlusion at each point, one where it leaves a medium under a
    // surface, and one on its way through a volume.
    const size_t shadows = size_t(BATCH_PATHS) * size_t(2 + scene.has_subsurface + scene.has_media);
    shadow_rays_.resize(shadows);
    shadows_.resize(shadows);
    shadow_kind_.resize(shadows);
    blocked_.resize(shadows);
    if (scene.has_subsurface) walks_.resize(BATCH_PATHS);
    media_.resize(scene.has_media ? BATCH_PATHS : 0);
    shadow_media_.resize(scene.has_media ? shadows : 0);
    material_first_.resize(scene.view.material_count + 1);
    if (has_motion(scene)) {
        ray_time_.resize(BATCH_PATHS);
        next_time_.resize(BATCH_PATHS);
        shadow_time_.resize(shadows);
    }
    aovs_.resize(size_t(film.layout.aov_count) * 4 * SHADE_LANES);
}

Batch::~Batch() = default;

void BatchCounts::add(const BatchCounts& other) {
    paths += other.paths;
    rays += other.rays;
    shadow_rays += other.shadow_rays;
    surface_points += other.surface_points;
    for (u32 cause = 0; cause < REFUSALS; cause++) refused[cause] += other.refused[cause];
    clamped += other.clamped;
    cut += other.cut;
    lens_samples += other.lens_samples;
    time_samples += other.time_samples;
    lamp_searches += other.lamp_searches;
    transparent_steps += other.transparent_steps;
    world_points += other.world_points;
    light_points += other.light_points;
    subsurface_walks += other.subsurface_walks;
    subsurface_steps += other.subsurface_steps;
    flights += other.flights;
    photons += other.photons;
    photons_landed += other.photons_landed;
}

BatchCounts Batch::counts() const {
    BatchCounts counts = counts_;
    counts.clamped += writer_.clamped;
    counts.cut += writer_.cut;
    return counts;
}

void Batch::trace(const PixelBlock& block) {
    if (timed()) clock_.start();
    generate(block);
    const u32 rounds = most_rounds(scene_.limits);
    for (u32 round = 0; ray_count_ > 0 && round < rounds && !stops(); round++) {
        next_count_ = 0;
        shadow_count_ = 0;
        traverse();
        if (scene_.has_media) cross_media();
        meet_lamps();
        charge_rays(0, ray_count_);
        shade_misses();
        sort_hits_by_material();
        charge_rays(0, ray_count_);
        walk_count_ = 0;
        shade_hits();
        if (walk_count_ > 0) walk_subsurface();
        trace_shadows();
        next_generation();
    }
    if (stops()) undo(block.sample_count);
}

void Batch::next_generation() {
    std::swap(rays_, next_rays_);
    std::swap(ray_path_, next_path_);
    std::swap(ray_time_, next_time_);
    ray_count_ = next_count_;
}

void Batch::keep_pixel(u32 pixel) {
    const FilmSum* row = film_row(writer_.film, pixel);
    before_.pixels.push_back(pixel);
    before_.rows.insert(before_.rows.end(), row, row + writer_.film.layout.stride);
}

// Paths that were cut off would darken their pixels.
void Batch::undo(u32 sample_count) {
    const u32 stride = writer_.film.layout.stride;
    for (size_t i = 0; i < before_.pixels.size(); i++) {
        std::copy_n(before_.rows.data() + i * stride, stride, film_row(writer_.film, before_.pixels[i]));
        writer_.film.sample_counts[before_.pixels[i]] -= sample_count;
    }
    counts_ = before_.counts;
    writer_.clamped = before_.clamped, writer_.cut = before_.cut;
}

void Batch::generate(const PixelBlock& block) {
    ray_count_ = 0;
    before_.pixels.clear(), before_.rows.clear();
    before_.counts = counts_, before_.clamped = writer_.clamped, before_.cut = writer_.cut;
    for (int y = 0; y < block.height; y++) {
        for (int x = 0; x < block.width; x++) {
            if (!block.holds(x, y)) continue;
            u32 px = u32(block.x0 + x), py = u32(block.y0 + y);
            u32 row = film_pixel(writer_.film, px, py);
            keep_pixel(row);
            if (is_mark(block.first_sample)) film_mark(writer_, row, block.first_sample);
            film_count_samples(writer_, row, block.sample_count);
            PixelSampler pixel = make_pixel_sampler(px, py, scene_.seed, scene_.log2_samples, scene_.sampler);
            for (u32 s = 0; s < block.sample_count; s += CAMERA_LANES) {
                u32 count = std::min(u32(CAMERA_LANES), block.sample_count - s);
                generate_pixel(pixel, px, py, block.first_sample + s, count);
            }
            charge_pixel(row);
        }
    }
    counts_.paths += u64(ray_count_);
    if (has_motion(scene_)) counts_.time_samples += u64(ray_count_);
}

void Batch::generate_pixel(const PixelSampler& pixel, u32 px, u32 py, u32 first_sample, u32 count) {
    // Random numbers first, of all samples: that loop vectorises.
    float filter_u[2][CAMERA_LANES], lens_u[2][CAMERA_LANES] = {}, time_u[CAMERA_LANES];
    auto draw = [&](u32 dimension, float (&to)[2][CAMERA_LANES]) {
        with_family(scene_.sampler, [&](auto family) {
            for (u32 i = 0; i < count; i++) {
                Vec2 u = sample_2d_of<family.VALUE>(make_sampler(pixel, first_sample + i), dimension);
                to[0][i] = u.x, to[1][i] = u.y;
            }
        });
    };
    auto draw_with_time = [&](u32 dimension) {
        with_family(scene_.sampler, [&](auto family) {
            for (u32 i = 0; i < count; i++) {
                Vec3 u = sample_3d_of<family.VALUE>(make_sampler(pixel, first_sample + i), dimension);
                filter_u[0][i] = u.x, filter_u[1][i] = u.y, time_u[i] = u.z;
            }
        });
    };
    if (has_motion(scene_))
        draw_with_time(first_dimension(scene_.sampler) + DIM_PIXEL);
    else
        draw(first_dimension(scene_.sampler) + DIM_PIXEL, filter_u);
    if (scene_.has_lens) {
        draw(first_dimension(scene_.sampler) + DIM_LENS, lens_u);
        counts_.lens_samples += count;
    }
    for (u32 i = 0; i < count; i++) {
        int k = ray_count_++;
        u32 sample = first_sample + i;
        Sampler sampler = make_sampler(pixel, sample);
        if (has_motion(scene_)) ray_time_[k] = path_time(scene_, time_u[i], py);
        rays_[k] = begin_path(scene_, writer_.film, px, py, sample, sampler, {filter_u[0][i], filter_u[1][i]},
                              {lens_u[0][i], lens_u[1][i]}, time_of(u32(k)), paths_[k]);
        ray_path_[k] = u32(k);
        if (scene_.has_media) {
            OnePoint one{*this, time_of(u32(k))};
            media_[k] = media_at_lens(scene_, rays_[k].origin, one);
        }
    }
}

void Batch::traverse() {
    for (int k = 0; k < ray_count_; k++) ray_kind_[k] = paths_[ray_path_[k]].visibility;
    const int at_once = timed() ? TIMED_RAYS : ray_count_;
    for (int k = 0; k < ray_count_; k += at_once) {
        const int count = std::min(at_once, ray_count_ - k);
        scene_.accel->closest(rays_.data() + k, ray_kind_.data() + k, hits_.data() + k, size_t(count),
                              times_of(ray_time_, k));
        charge_rays(k, k + count);
    }
    counts_.rays += u64(ray_count_);
}

void Batch::meet_lamps() {
    if (!scene_.has_visible_lamps || scene_.has_media) return;  // through media: cross_media
    counts_.lamp_searches += u64(ray_count_);
    OnePoint shader{*this};
    for (int k = 0; k < ray_count_; k++)
        find_lamps(scene_, writer_, paths_[ray_path_[k]], rays_[k], hits_[k].t, nullptr, shader,
                   scratch_->light_points);
}

void Batch::shade_misses() {
    OnePoint shader{*this};
    u32 chunk[SHADE_LANES];
    int count = 0;
    for (int k = 0; k < ray_count_; k++) {
        if (!missed_all(hits_[k])) continue;
        if (!leave_scene(scene_, writer_, paths_[ray_path_[k]], rays_[k], shader, scratch_->light_points)) continue;
        chunk[count++] = u32(k);
        if (count == SHADE_LANES) {
            shade_world(chunk, count);
            count = 0;
        }
    }
    if (count > 0) shade_world(chunk, count);
}

void Batch::shade_world(const u32* queue, int count) {
    Color* radiance = scratch_->emission;
    if (scene_.world_emission.constant) {
        for (int i = 0; i < count; i++) radiance[i] = scene_.world_emission.radiance;
    } else {
        counts_.world_points += u64(count);
        ShadePoints& points = scratch_->light_points;
        points.count = count;
        for (int i = 0; i < count; i++)
            setup_world_lane(paths_[ray_path_[queue[i]]], rays_[queue[i]].direction, points, i);
        run_program(scene_.view, scene_.view.world_program, points, scratch_->light_sets, registers_.data());
        for (int i = 0; i < count; i++) radiance[i] = scratch_->light_sets[i].emission;
    }
    for (int i = 0; i < count; i++)
        add_world(scene_, writer_, paths_[ray_path_[queue[i]]], rays_[queue[i]].direction, radiance[i]);
    charge_queue(queue, count);
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

void Batch::shade_hits() {
    u32 begin = 0;
    for (u32 m = 0; m < scene_.view.material_count; m++) {
        u32 end = material_first_[m];
        if (scene_.view.materials[m].only_volume) {
            pass_borders(begin, end);
            begin = end;
            continue;
        }
        u32 chunk[SHADE_LANES];
        int count = 0;
        for (u32 i = begin; i < end; i++) {
            u32 k = sorted_[i];
            if (!survives(scene_, writer_, paths_[ray_path_[k]], scene_.view.materials[m])) continue;
            chunk[count++] = k;
            if (count == SHADE_LANES) {
                if (stops()) return;
                shade_chunk(m, chunk, count);
                charge_queue(chunk, count);
                count = 0;
            }
        }
        if (count > 0) {
            shade_chunk(m, chunk, count);
            charge_queue(chunk, count);
        }
        begin = end;
    }
}

void Batch::trace_shadows() {
    if (shadow_count_ == 0) return;
    const int at_once = timed() ? TIMED_RAYS : shadow_count_;
    for (int k = 0; k < shadow_count_; k += at_once) {
        const int count = std::min(at_once, shadow_count_ - k);
        scene_.accel->any(shadow_rays_.data() + k, shadow_kind_.data() + k, blocked_.data() + k, size_t(count),
                          times_of(shadow_time_, k));
        charge_shadows(k, k + count);
    }
    counts_.shadow_rays += u64(shadow_count_);
    OnePoint one{*this};
    int from = 0;  // whose time was not charged yet
    for (int k = 0; k < shadow_count_; k++) {
        if (!shadow_time_.empty()) one.time = shadow_time_[k];
        const ShadowRay& shadow = shadows_[k];
        const PathState& path = paths_[shadow.path];
        Color through = make_vec3(1.0f);
        if (shadow.casts) {
            if (blocked_[k] == BLOCKED_OPAQUE) continue;
            if (blocked_[k] == BLOCKED_MAYBE) {
                if (stops()) return;
                MediumStack* stack = scene_.has_media ? &shadow_media_[k] : nullptr;
                charge_shadows(from, k);
                through = walk_transparent(scene_, shadow_rays_[k], shadow, stack, one, one, scratch_->light_points,
                                           &counts_.transparent_steps, &counts_.shadow_rays);
                charge_shadows(k, k + 1);
                from = k + 1;
            } else if (scene_.has_media) {
                through = media_transmittance(scene_.media, shadow_media_[k], shadow_rays_[k].t_max);
            }
        }
        if (!is_zero(through)) add_direct(scene_, writer_, path, shadow, through);
    }
    charge_shadows(from, shadow_count_);
}

}  // namespace luch::cpu
