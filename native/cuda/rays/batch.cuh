// A launch's rays and where their results go. The same checks and misses as on the CPU (bindings/structure.cpp).
#pragma once
#include "luch/accel/primitives.h"

namespace luch {

// Passed by value; luch/cuda/structures.py packs the same bytes. Arrays that a kernel does not write are null.
struct RayBatch {
    const float4* rays;  // two a ray: origin and t_min, direction and t_max
    float* t;
    i32* prim;
    float* u;
    float* v;
    u8* blocked;
    u64* counters;  // nodes, boxes, primitives, bytes of all rays together
    u32* next;      // first ray that no warp has taken yet, for persistent threads
    u32 count;
};

inline constexpr float LARGEST_FLOAT = 3.402823466e+38f;

// False for a ray that can hit nothing; else it is ready to be traced.
__device__ __forceinline__ bool load_ray(const RayBatch& batch, u32 i, Ray* ray) {
    float4 a = __ldg(batch.rays + 2 * u64(i)), b = __ldg(batch.rays + 2 * u64(i) + 1);
    *ray = {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, b.w};
    bool valid = ray_is_valid(*ray);
    ray->t_min = max_f(ray->t_min, 0.0f);
    ray->t_max = min_f(ray->t_max, LARGEST_FLOAT);
    return valid;
}

__device__ __forceinline__ RefHit no_hit(const Ray& ray) { return {ray.t_max, NONE, 0.0f, 0.0f}; }

__device__ __forceinline__ void store_hit(const RayBatch& batch, u32 i, const RefHit& hit) {
    batch.t[i] = hit.ref == NONE ? INFINITE_DISTANCE : hit.t;
    batch.prim[i] = i32(hit.ref);  // NONE is -1
    batch.u[i] = hit.u;
    batch.v[i] = hit.v;
}

__device__ __forceinline__ void add_counters(const RayBatch& batch, const Counters& kept) {
    atomicAdd(batch.counters + 0, kept.nodes);
    atomicAdd(batch.counters + 1, kept.boxes);
    atomicAdd(batch.counters + 2, kept.primitives);
    atomicAdd(batch.counters + 3, kept.bytes);
}
__device__ __forceinline__ void add_counters(const RayBatch&, const NoCounters&) {}

__device__ __forceinline__ u32 thread_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

}  // namespace luch
