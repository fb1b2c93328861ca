// What the stages of the wavefront share: who a thread is, appending to queues, a program at one point.
#pragma once
#include "luch/integrator/wavefront.h"
#include "render/append.cuh"
#include "render/clock.cuh"
#include "render/launch.cuh"
#include "render/programs.cuh"

namespace luch {

__device__ __forceinline__ u32 append(const Wavefront& wave, WaveCounter queue) {
    return append_to(in_global(wave.counters) + queue);
}

__device__ __forceinline__ void add_total(const Wavefront& wave, WaveTotal total, u64 amount) {
    if (amount != 0) atomicAdd(in_global(wave.totals) + total, amount);
}

// What a writer has counted.
__device__ __forceinline__ void add_totals(const Wavefront& wave, const FilmWriter& writer) {
    add_total(wave, TOTAL_CLAMPED, writer.clamped);
    add_total(wave, TOTAL_CUT, writer.cut);
}

// time: of the path; media: around the ray's beginning; null without any.
__device__ __forceinline__ void push_shadow(const Wavefront& wave, const Ray& ray, float time, const ShadowRay& shadow,
                                            const MediumStack* media) {
    u32 at = append(wave, WAVE_SHADOWS);
    wave.shadow_rays[at] = ray;
    wave.shadows[at] = shadow;
    if (plan::MOTION && wave.shadow_time) wave.shadow_time[at] = time;
    if (plan::VOLUMES && media) wave.shadow_media[at] = *media;
}

__device__ __forceinline__ void push_ray(const Wavefront& wave, const Ray& ray, float time, u32 slot, u32 kind) {
    u32 at = append(wave, WAVE_NEXT_RAYS);
    wave.next_rays[at] = ray;
    if (plan::MOTION && wave.next_time) wave.next_time[at] = time;
    wave.next_slot[at] = slot;
    wave.next_kind[at] = kind;
}

__device__ __forceinline__ OpContext context_of(const SceneView& scene, const Program& program,
                                                const ShadePoints& points, ClosureSet& set, float* aovs) {
    clear_closures(set);
    return {&scene, &program, &points, 0, &set, aovs};
}

// What luch/integrator's functions ask for: the light of a program at a point. SURFACES: of any surface; else of the
// world, a lamp or a light that was chosen.
template <bool SURFACES>
struct ProgramShader {
    const SceneView& scene;
    ClosureSet& set;

    __device__ __forceinline__ const ClosureSet& light(const Program& program, const ShadePoints& points) {
        const OpContext context = context_of(scene, program, points, set, nullptr);
        if constexpr (SURFACES)
            run_surface_light(context);
        else
            run_light_program(context);
        return set;
    }
};
using PointShader = ProgramShader<false>;
using SurfaceShader = ProgramShader<true>;

}  // namespace luch

// Blocks of a stage that a multiprocessor must hold: what a thread may keep in registers (4: 128, 5: 96, 6: 80, 8: 64).
#ifndef LUCH_STAGE_BLOCKS
#define LUCH_STAGE_BLOCKS 4
#endif

#define LUCH_STAGE(name)                                                               \
    extern "C" __global__ void __launch_bounds__(luch::STAGE_BLOCK, LUCH_STAGE_BLOCKS) \
        name(const __grid_constant__ luch::RenderTask task)
