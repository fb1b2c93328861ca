// One scene, ready to render: the view that paths read, and what owns the arrays behind it.
#pragma once
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/integrator/casters.h"
#include "cpu/integrator/photon_map.h"
#include "luch/integrator/render_view.h"

namespace luch::cpu {

class LocalTrees;

struct RenderScene : RenderView {
    const Accel* accel = nullptr;
    const LocalTrees* walk_trees = nullptr;  // null: nothing scatters under its surface
    PixelFilter filter_table;
    std::vector<ConstantEmission> emission_of_materials;
    ShutterView shutter_view{};
    std::vector<TransformKey> camera_keys;
    std::vector<float> shutter_times;
    size_t max_registers = 0;  // of any program
    CasterStore casters_store;
    PhotonPilot photon_pilot;
    PhotonStore photon_store;  // the map that serves the samples under way

    RenderScene() : RenderView{} {}
};

}  // namespace luch::cpu
