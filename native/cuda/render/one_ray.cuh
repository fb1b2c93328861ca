// Single rays from within a stage.
#pragma once
#include LUCH_STRUCTURE_HEADER
#include "luch/accel/two_level.h"

namespace luch {

using SceneTrees = TwoLevelView<LUCH_STRUCTURE>;

// One ray, for those that look through surfaces one by one.
struct OneRay {
    const SceneTrees& trees;
    float time;
    __device__ __forceinline__ Hit closest(const Ray& ray) { return closest(ray, RAY_SHADOW); }
    __device__ __forceinline__ Hit closest_of_all(const Ray& ray) { return closest(ray, RAY_ALL); }
    __device__ __noinline__ Hit closest(const Ray& ray, u32 kind) {
        return closest_hit<Precision::LUCH_PRECISION>(trees, ray, kind, time);
    }
};

}  // namespace luch
