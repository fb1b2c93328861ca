// The one group in the world that is all of a scene, or all that stands still: the persistent kernels of rays/, with hits of the scene.
#pragma once
#include "rays/persistent.cuh"
#include "render/trace.cuh"

namespace luch {

struct OneGroupRays {
    const TwoLevelView<Cwbvh>& scene;
    const TraceTask& task;
};

__device__ __forceinline__ const Cwbvh& tree_of(const OneGroupRays& rays) { return rays.scene.world.structure; }
__device__ __forceinline__ const CurveSet& curves_in(const OneGroupRays& rays) {
    return rays.scene.world.primitives.curves;
}
__device__ __forceinline__ u32 ray_count(const OneGroupRays& rays) { return ray_count(rays.task); }
__device__ __forceinline__ u32* next_ray(const OneGroupRays& rays) { return rays.task.next; }
__device__ __forceinline__ bool load_ray(const OneGroupRays& rays, u32 i, Ray* ray) {
    *ray = ray_of(rays.task, i);
    bool valid = clamp_interval(ray);
    if (plan::MOTION && valid && !passes_movers_by(rays.scene, *ray, ray->t_max)) note_near_movers(rays.task, i);
    return valid && (rays.scene.world_visibility & kinds_of(rays.task, i)) != 0u;
}
__device__ __forceinline__ void store_hit(const OneGroupRays& rays, u32 i, const RefHit& hit) {
    rays.task.hits[i] = hit.ref == NONE ? no_scene_hit() : hit_in_scene(rays.scene.world, NONE, hit);
}
__device__ __forceinline__ void store_blocked(const OneGroupRays& rays, u32 i, u8 blocked) {
    store_blocked(rays.task, i, blocked);
}

}  // namespace luch
