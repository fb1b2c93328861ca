// Photons of a batch: from lights over sharp surfaces to where they lie.
#include "luch/integrator/photon.h"

#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"

namespace luch::cpu {

void Batch::trace_photons(u32 map, u32 first, u32 count, std::vector<Photon>* landed) {
    OnePoint one{*this};
    auto emission = [&](const LightSample& sample, const PathState& path, float time) {
        ConstantEmission constant = emission_of(scene_, sample, time);
        if (constant.constant) return constant.radiance;
        ShadePoints& points = scratch_->light_points;
        points.count = 1;
        counts_.light_points++;
        setup_light_lane(scene_, path, 0, sample, 0.0f, time, points, 0);
        return one.light(program_of(scene_, sample), points).emission;
    };
    ray_count_ = 0;
    for (u32 i = 0; i < count; i++) {
        const u32 k = u32(ray_count_);
        float time;
        if (!begin_photon(scene_, map, first + i, emission, paths_[k], &rays_[k], &time)) continue;
        if (!ray_time_.empty()) ray_time_[k] = time;
        ray_path_[k] = k;
        ray_count_++;
    }
    counts_.photons += count;
    const u32 rounds = most_rounds(scene_.limits);
    for (u32 round = 0; ray_count_ > 0 && round < rounds && !stops(); round++) {
        next_count_ = 0;
        traverse();
        sort_hits_by_material();
        u32 begin = 0;
        for (u32 m = 0; m < scene_.view.material_count; m++) {
            const u32 end = material_first_[m];
            for (u32 i = begin; i < end; i += SHADE_LANES)
                shade_photons(m, sorted_.data() + i, int(std::min(u32(SHADE_LANES), end - i)), landed);
            begin = end;
        }
        next_generation();
    }
    ray_count_ = 0;
}

void Batch::shade_photons(u32 material, const u32* queue, int count, std::vector<Photon>* landed) {
    ShadePoints& points = scratch_->points;
    setup_chunk(queue, count, points);
    run_program(scene_.view, scene_.view.materials[material].program, points, scratch_->sets, registers_.data());
    for (int lane = 0; lane < count; lane++) {
        const u32 k = queue[lane], index = ray_path_[k];
        Photon photon;
        bool lands;
        next_path_[next_count_] = index;
        const bool goes_on = photon_at_surface(scene_, counts_.refused, paths_[index], points, lane,
                                               scratch_->sets[lane], scratch_->spawn[lane], rays_[k].direction,
                                               hits_[k].t, &next_rays_[next_count_], &photon, &lands);
        if (lands) {
            landed->push_back(photon);
            counts_.photons_landed++;
        }
        if (goes_on) send_next(points, lane);
    }
}

void Batch::gather(const u32* queue, int lit_count) {
    if (!scene_.photon_maps) return;
    for (int i = 0; i < lit_count; i++) {
        const int lane = scratch_->lit_lanes[i];
        add_photons(scene_, writer_, paths_[ray_path_[queue[lane]]], scratch_->points, lane, scratch_->sets[lane]);
    }
}

}  // namespace luch::cpu
