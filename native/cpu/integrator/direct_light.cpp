// Next-event estimation for a chunk: one light per shaded point, the lights' programs, the shadow rays.
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"

namespace luch::cpu {

void Batch::push_shadow(bool made, u32 k) {
    if (!made) return;
    if (!shadow_time_.empty()) shadow_time_[shadow_count_] = ray_time_[k];
    shadow_kind_[shadow_count_++] = RAY_SHADOW;
}

// Lanes that a sample may light, in order; returns their number. Area lamps are chosen lane by lane and sampled together.
int Batch::choose_lights(const u32* queue, int lit_count, int* wanted) {
    constexpr int NO_AREA = -1;
    const ShadePoints& points = scratch_->points;
    const LightsView& lights = *scene_.view.lights;
    const auto& u = scratch_->light_u;
    AreaLamps& area_lamps = scratch_->area_lamps;
    int chosen[SHADE_LANES], area[SHADE_LANES], chosen_count = 0;
    area_lamps.clear();
    for (int i = 0; i < lit_count; i++) {
        int lane = scratch_->lit_lanes[i];
        const ClosureSet& set = scratch_->sets[lane];
        if (!takes_light(set)) continue;
        LightQuery q = make_light_query(lane_position(points, lane), lane_normal(points, lane), set_transmits(set));
        Vec2 place{u[0][i], u[1][i]};
        LightChoice choice = choose_source(lights, q, u[2][i], place);
        if (choice.kind == EmitterKind::NONE_) continue;
        bool is_wide = choice.kind == EmitterKind::LAMP && is_wide_area(lights.lamps[choice.lamp]);
        area[chosen_count] = is_wide ? area_lamps.add(lights, choice, q.p, place) : NO_AREA;
        if (!is_wide) scratch_->samples[lane] = sample_source(scene_.view, choice, q, place, lane_time(points, lane));
        chosen[chosen_count++] = lane;
    }
    area_lamps.sample_places();
    int wanted_count = 0;
    for (int i = 0; i < chosen_count; i++) {
        int lane = chosen[i];
        LightSample& sample = scratch_->samples[lane];
        if (area[i] != NO_AREA) sample = area_lamps.sample(lights, area[i], lane_position(points, lane));
        if (may_light(scene_, paths_[ray_path_[queue[lane]]], sample)) wanted[wanted_count++] = lane;
    }
    return wanted_count;
}

void Batch::sample_lights(const u32* queue, int lit_count) {
    const ShadePoints& points = scratch_->points;
    int wanted[SHADE_LANES];
    const int wanted_count = choose_lights(queue, lit_count, wanted);
    if (wanted_count == 0) return;
    emission_of_samples(queue, wanted, wanted_count);
    for (int i = 0; i < wanted_count; i++) {
        int lane = wanted[i];
        u32 path = ray_path_[queue[lane]];
        Ray& ray = shadow_rays_[shadow_count_];
        bool made = make_shadow_ray(scene_, writer_.film.layout, paths_[path], path, points, lane, scratch_->sets[lane],
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
