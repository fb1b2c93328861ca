// Between surfaces, where a scene has media: lamps seen through them, light scattered and given by them, and the paths
// that turn there.
#include "cpu/integrator/batch.h"
#include "cpu/integrator/scratch.h"
#include "luch/integrator/found_light.h"

namespace luch::cpu {

void Batch::cross_media() {
    for (int k = 0; k < ray_count_ && !stops(); k++) {
        cross_media(k);
        charge_rays(k, k + 1);
    }
}

void Batch::cross_media(int k) {
    const u32 path_index = ray_path_[k];
    PathState& path = paths_[path_index];
    const MediumStack& stack = media_[path_index];
    OnePoint shader{*this};
    if (scene_.has_visible_lamps) {
        counts_.lamp_searches++;
        find_lamps(scene_, writer_, path, rays_[k], hits_[k].t, &stack, shader, scratch_->light_points);
    }
    if (!is_in_medium(scene_.media, stack)) return;
    counts_.flights++;
    const Flight flight = make_flight(scene_.media, stack, path, hits_[k].t);
    if (may_scatter(path, flight) &&
        light_flight(scene_, path, path_index, stack, rays_[k], flight, time_of(u32(k)), shader, scratch_->light_points,
                     &shadow_rays_[shadow_count_], &shadows_[shadow_count_])) {
        shadow_media_[shadow_count_] = stack;
        push_shadow(true, u32(k));
    }
    FlightEnd end = fly(scene_, writer_, path, stack, rays_[k], flight, &next_rays_[next_count_]);
    if (end == FlightEnd::AT_SURFACE) return;
    hits_[k].instance = NONE, hits_[k].prim = ENDED_IN_MEDIUM;
    if (end == FlightEnd::SCATTERED) go_on(path_index, u32(k));
}

// The next ray, which stands at the end of its queue, goes on from ray k.
void Batch::go_on(u32 path_index, u32 k) {
    if (!next_time_.empty()) next_time_[next_count_] = ray_time_[k];
    next_path_[next_count_++] = path_index;
}

// Rays that met nothing but the border of a volume go straight on.
void Batch::pass_borders(u32 begin, u32 end) {
    for (u32 i = begin; i < end; i++) {
        const u32 k = sorted_[i], path_index = ray_path_[k];
        paths_[path_index].travelled += hits_[k].t;
        Ray& next = next_rays_[next_count_];
        next = rays_[k];
        next.t_min = 0.0f, next.t_max = INFINITE_DISTANCE;
        pass_surface(scene_.view, media_[path_index], hits_[k], time_of(k), &next);
        go_on(path_index, k);
    }
}

}  // namespace luch::cpu
