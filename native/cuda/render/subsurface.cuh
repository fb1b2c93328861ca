// Surfaces where light goes under: the walks themselves are the kernel of walks.cu.
#pragma once
#include "luch/integrator/subsurface.h"
#include "render/stage.cuh"

namespace luch {

// Whether the path goes under the surface (or ends in the attempt) instead of being scattered. ray: that brought it.
__device__ __noinline__ bool goes_inside(const RenderTask& task, PathState& path, const ShadePoints& points,
                                         const ClosureSet& set, const SurfacePoint& spawn, u32 ray) {
    Vec3 u = sample_3d(path.sampler, path.dimension + DIM_BSDF);
    int lobe = chosen_subsurface(set, u.z);
    if (lobe < 0) return false;
    SubsurfaceWalk walk;
    if (enter_subsurface(path, points, 0, set, lobe, spawn, {u.x, u.y}, ray, &walk))
        task.wave.walks[append(task.wave, WAVE_WALKS)] = walk;
    return true;
}

}  // namespace luch
