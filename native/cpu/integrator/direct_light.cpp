// Next-event estimation for a chunk: one light per shaded point, the lights' programs, the shadow rays.
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"

namespace luch::cpu {

void Batch::push_shadow(bool made, u32 k) {
    if (!made) return;
    if (!shadow_time_.empty()) shadow_time_[shadow_count_] = ray_time_[k];
    shadow_kind_[shadow_count_++] = RAY_SHADOW;
}

void Batch::sample_lights(const u32* queue, int lit_count) {
    const ShadePoints& points = scratch_->points;
    const auto& u = scratch_->light_u;
    int wanted[SHADE_LANES], wanted_count = 0;
    for (int i = 0; i < lit_count; i++) {
        int lane = scratch_->lit_lanes[i];
        if (choose_light(scene_, paths_[ray_path_[queue[lane]]], points, lane, scratch_->sets[lane],
                         {u[0][i], u[1][i], u[2][i]}, &scratch_->samples[lane]))
            wanted[wanted_count++] = lane;
    }
    if (wanted_count == 0) return;
    emission_of_samples(queue, wanted, wanted_count);
    for (int i = 0; i < wanted_count; i++) {
        int lane = wanted[i];
        u32 path = ray_path_[queue[lane]];
        Ray& ray = shadow_rays_[shadow_count_];
        bool made = make_shadow_ray(writer_.film.layout, paths_[path], path, points, lane, scratch_->sets[lane],
                                    scratch_->spawn[lane], scratch_->samples[lane], scratch_->emission[lane], &ray,
                                    &shadows_[shadow_count_]);
        if (made && scene_.has_media)
            shadow_media_[shadow_count_] = media_towards(scene_, media_[path], points, lane, ray.direction);
        push_shadow(made, queue[lane]);
    }
}

// Emission at sampled points: constants by table, the rest through their programs, chunk by chunk.
void Batch::emission_of_samples(const u32* queue, const int* lanes, int count) {
    int open[SHADE_LANES], open_count = 0;
    for (int i = 0; i < count; i++) {
        const ConstantEmission constant =
            emission_of(scene_, scratch_->samples[lanes[i]], lane_time(scratch_->points, lanes[i]));
        if (constant.constant) {
            scratch_->emission[lanes[i]] = constant.radiance;
        } else {
            open[open_count++] = lanes[i];
        }
    }
    while (open_count > 0) {
        // All samples of one program at a time.
        const Program* program = &program_of(scene_, scratch_->samples[open[0]]);
        int chosen[SHADE_LANES], chosen_count = 0, left = 0;
        for (int i = 0; i < open_count; i++) {
            if (&program_of(scene_, scratch_->samples[open[i]]) == program)
                chosen[chosen_count++] = open[i];
            else
                open[left++] = open[i];
        }
        open_count = left;
        ShadePoints& points = scratch_->light_points;
        points.count = chosen_count;
        counts_.light_points += u64(chosen_count);
        for (int i = 0; i < chosen_count; i++) {
            u32 path = ray_path_[queue[chosen[i]]];
            setup_light_lane(scene_, paths_[path], path, scratch_->samples[chosen[i]],
                             scratch_->points.footprint[chosen[i]], lane_time(scratch_->points, chosen[i]), points, i);
        }
        run_program(scene_.view, *program, points, scratch_->light_sets, registers_.data(), nullptr, 0, Wanted::LIGHT);
        for (int i = 0; i < chosen_count; i++) scratch_->emission[chosen[i]] = scratch_->light_sets[i].emission;
    }
}

}  // namespace luch::cpu
