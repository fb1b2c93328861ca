// Everything a batch reads while it traces: one scene, ready to render. Nothing in it changes meanwhile.
#pragma once
#include <vector>

#include "cpu/accel/accel.h"
#include "luch/camera/camera.h"
#include "luch/film/filter.h"
#include "luch/integrator/path.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

// Emission of a program that is the same everywhere, evaluated once.
struct ConstantEmission {
    bool constant = false;
    Color radiance{};
};

struct RenderScene {
    SceneView view;
    const Accel* accel = nullptr;
    CameraView camera;
    PixelFilter filter;
    PathLimits limits;
    u32 seed = 0;
    u32 log2_samples = 0;           // the sampler leaves this much room for each pixel
    bool halves = false;            // two independent sequences a pixel, kept apart in the film
    bool has_lights = false;        // anything that sample_light could choose
    bool has_visible_lamps = false; // lamps of finite size that rays may meet
    bool has_world = false;         // one that is not black
    bool can_meet_light = true;     // a ray may come upon an emitter, a lamp or the world by itself
    u32 world_visibility = 0, world_lightgroup = 0;
    ConstantEmission world_emission;
    std::vector<ConstantEmission> material_emission;
    size_t max_registers = 0;       // of any program
    double origin[3] = {0.0, 0.0, 0.0};  // of Scene.origin, for Position
    float mist_start = 0.0f, mist_inverse_depth = 0.0f, mist_exponent = 2.0f;
};

}  // namespace luch::cpu
