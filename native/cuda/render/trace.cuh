// Rays of a render through the scene's trees (luch/accel/two_level.h): what every kernel that traces them takes.
//
// A module has trace_closest and trace_any: BLOCK of luch/cuda/trace.py threads a block, as many blocks as fit at once;
// warps fetch rays until there are none. That of the compressed wide tree has trace_closest_one and trace_any_one too,
// for a group that stands apart in the world, and trace_closest_simple and trace_any_simple, which the race compares.
#pragma once
#include "render/trace_plan.cuh"

#ifndef LUCH_TIMED_RAYS
#define LUCH_TIMED_RAYS 0
#endif
#include "luch/accel/two_level.h"
#include "rays/structure.cuh"
#include "render/append.cuh"

namespace luch {

// Passed by value; luch/cuda/trace.py packs the same bytes.
struct TraceTask {
    const Ray* rays;  // as they stand in the scene; 16 bytes aligned
    const u32* kinds;  // RayKind bits of each; null: all see all
    Hit* hits;  // of trace_closest, by ray
    u8* blocked;  // of trace_any: Blocked values, by ray
    const u32* count;  // rays
    // 0 when the kernel begins; how many rays were fetched when it ends, at least. Three: the second is of the kernel
    // that comes after, for what moves, the third counts near_movers.
    u32* next;
    const float* times;  // of each ray; null: the shutter's middle. Read where LUCH_PLAN_MOTION is 1
    u32* ticks;  // of each ray, its clock cycles. Written where LUCH_TIMED_RAYS is 1
    u32* near_movers;  // rays that the second kernel is to trace: the first writes them
};

__device__ __forceinline__ u32 ray_count(const TraceTask& task) { return __ldg(task.count); }
__device__ __forceinline__ u32* next_ray(const TraceTask& task) { return task.next; }
__device__ __forceinline__ u32 kinds_of(const TraceTask& task, u32 i) {
    return task.kinds ? __ldg(task.kinds + i) : u32(RAY_ALL);
}
__device__ __forceinline__ float time_of(const TraceTask& task, u32 i) {
    return plan::MOTION && task.times ? __ldg(task.times + i) : SHUTTER_MIDDLE;
}
__device__ __forceinline__ Ray ray_of(const TraceTask& task, u32 i) {
    const float4* quads = reinterpret_cast<const float4*>(task.rays) + 2 * u64(i);
    float4 a = __ldg(quads), b = __ldg(quads + 1);
    return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, b.w};
}
__device__ __forceinline__ void store_blocked(const TraceTask& task, u32 i, u8 blocked) { task.blocked[i] = blocked; }

// How many rays the kernel after the world's has to trace, and which.
__device__ __forceinline__ u32 near_count(const TraceTask& task) { return __ldg(task.next + 2); }
__device__ __forceinline__ u32 near_ray(const TraceTask& task, u32 i) { return __ldg(task.near_movers + i); }
__device__ __forceinline__ void note_near_movers(const TraceTask& task, u32 i) {
    task.near_movers[append_to(task.next + 2)] = i;
}

// Calls trace(i) for every ray of the task, a warp's worth at a time.
template <class Trace>
__device__ __forceinline__ void for_each_ray(const TraceTask& task, Trace&& trace) {
    u32 count = ray_count(task), lane = threadIdx.x % 32u;
    for (;;) {
        u32 first = 0;
        if (lane == 0) first = atomicAdd(task.next, 32u);
        first = __shfl_sync(0xffffffffu, first, 0);
        if (first >= count) return;
        if (first + lane >= count) continue;
#if LUCH_TIMED_RAYS
        long long began = clock64();
#endif
        trace(first + lane);
#if LUCH_TIMED_RAYS
        task.ticks[first + lane] = static_cast<u32>(clock64() - began);
#endif
    }
}

template <Precision P, class View>
__device__ __forceinline__ void trace_closest_simple(const TwoLevelView<View>& scene, const TraceTask& task) {
    for_each_ray(task, [&](u32 i) {
        task.hits[i] = closest_hit<P>(scene, ray_of(task, i), kinds_of(task, i), time_of(task, i));
    });
}
template <Precision P, class View>
__device__ __forceinline__ void trace_any_simple(const TwoLevelView<View>& scene, const TraceTask& task) {
    for_each_ray(task, [&](u32 i) {
        task.blocked[i] = any_hit<P>(scene, ray_of(task, i), kinds_of(task, i), time_of(task, i));
    });
}

}  // namespace luch

#define LUCH_TRACE_ARGUMENTS const luch::TwoLevelView<LUCH_VIEW> scene, const luch::TraceTask task
#define LUCH_TRACE_KERNEL(name) extern "C" __global__ void __launch_bounds__(luch::RAY_BLOCK) name
