// Shading of one chunk: up to SHADE_LANES hits that share a material.
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"

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
        const float* aov = aovs ? aovs + size_t(lane) * size_t(writer_.film.layout.aov_count) * 4 : nullptr;
        PathState& path = paths_[ray_path_[queue[lane]]];
        if (meet_surface(scene_, writer_, path, points, lane, sets[lane], material_index, aov))
            scratch_->lit_lanes[lit_count++] = lane;
    }
    if (lit_count == 0) return;
    draw_numbers(queue, lit_count);
    if (scene_.has_lights) sample_lights(queue, lit_count);
    gather(queue, lit_count);
    const auto& u = scratch_->scatter_u;
    for (int i = 0; i < lit_count; i++) {
        int lane = scratch_->lit_lanes[i];
        u32 k = queue[lane], path_index = ray_path_[k];
        PathState& path = paths_[path_index];
        const ClosureSet& set = sets[lane];
        const SurfacePoint& spawn = scratch_->spawn[lane];
        if (wants_ao(writer_.film.layout, path)) {
            make_ao_ray(scene_, path, path_index, points, lane, set, spawn, &shadow_rays_[shadow_count_],
                        &shadows_[shadow_count_]);
            if (scene_.has_media) shadow_media_[shadow_count_] = media_[path_index];
            push_shadow(true, k);
        }
        if (scene_.has_subsurface && enters_subsurface(k, lane, set, spawn, {u[0][i], u[1][i], u[2][i]})) continue;
        next_path_[next_count_] = path_index;
        if (scatter(scene_, writer_, path, points, lane, set, spawn, {u[0][i], u[1][i], u[2][i]}, rays_[k].direction,
                    hits_[k].t, &next_rays_[next_count_]))
            send_next(points, lane);
    }
}

// The next ray, which stands at the end of its queue, goes on.
void Batch::send_next(const ShadePoints& points, int lane) {
    if (!next_time_.empty()) next_time_[next_count_] = lane_time(points, lane);
    if (scene_.has_media) {
        MediumStack& media = media_[next_path_[next_count_]];
        media = media_towards(scene_, media, points, lane, next_rays_[next_count_].direction);
    }
    next_count_++;
}

// All random numbers of the chunk in two loops, which vectorise: one by one they took a tenth of the time.
void Batch::draw_numbers(const u32* queue, int lit_count) {
    u32 seed[SHADE_LANES], index[SHADE_LANES], dimension[SHADE_LANES];
    for (int i = 0; i < lit_count; i++) {
        const PathState& path = paths_[ray_path_[queue[scratch_->lit_lanes[i]]]];
        seed[i] = path.sampler.seed, index[i] = path.sampler.index, dimension[i] = path.dimension;
    }
    auto draw = [&](u32 event_dimension, float (&to)[3][SHADE_LANES]) {
        with_family(scene_.sampler, [&](auto family) {
            for (int i = 0; i < lit_count; i++) {
                Vec3 u = sample_3d_of<family.VALUE>(Sampler{seed[i], index[i]}, dimension[i] + event_dimension);
                to[0][i] = u.x, to[1][i] = u.y, to[2][i] = u.z;
            }
        });
    };
    if (scene_.has_lights) draw(DIM_LIGHT, scratch_->light_u);
    draw(DIM_BSDF, scratch_->scatter_u);
}

void Batch::setup_chunk(const u32* queue, int count, ShadePoints& points) {
    points.count = count;
    for (int lane = 0; lane < count; lane++) {
        u32 k = queue[lane];
        scratch_->spawn[lane] =
            setup_hit_lane(scene_, paths_[ray_path_[k]], ray_path_[k], hits_[k], rays_[k], time_of(k), points, lane);
    }
}

}  // namespace luch::cpu
