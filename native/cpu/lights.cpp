#include "cpu/lights.h"

#include <cmath>

#include "cpu/light/build.h"
#include "cpu/thread_pool.h"

namespace luch::cpu {

struct LightStore::Arrays {
    std::vector<LampView> lamps;
    std::vector<Emitter> emitters;
    std::vector<EmitterBounds> bounds;
    std::vector<LightTreeNode> nodes;
    std::vector<LampBoxNode> boxes;
    std::vector<u32> suns;
    EmissiveArrays emissive;
    std::vector<float> sun_irradiance;
    WorldArrays world;

    void add_lamps(const std::vector<LampInput>& inputs);
};

void LightStore::Arrays::add_lamps(const std::vector<LampInput>& inputs) {
    lamps.reserve(inputs.size());
    for (const LampInput& input : inputs) {
        u32 index = static_cast<u32>(lamps.size());
        lamps.push_back(make_lamp(input));
        LampView& lamp = lamps.back();
        if (!lamp_emits(lamp)) continue;
        if (lamp.kind == LampKind::SUN) {
            lamp.emitter = static_cast<u32>(suns.size());
            suns.push_back(index);
            float sine = std::sin(0.5f * clamp_f(input.angle, 0.0f, PI));
            sun_irradiance.push_back(luminance(abs_v(lamp.radiance)) * (lamp.delta ? 1.0f : PI * sine * sine));
            continue;
        }
        lamp.emitter = static_cast<u32>(emitters.size());
        emitters.push_back({index, NONE, NONE, NONE});
        bounds.push_back(lamp_bounds(lamp));
    }
}

LightStore::LightStore() = default;
LightStore::~LightStore() = default;

void LightStore::build(const SceneView& scene, const std::vector<LampInput>& lamps, const WorldInput& world,
                       const std::vector<Color>& material_emission_estimate, bool use_light_tree, ThreadPool& pool,
                       size_t most_triangles) {
    arrays_ = std::make_unique<Arrays>();
    Arrays& a = *arrays_;
    a.add_lamps(lamps);
    collect_emissive(scene, material_emission_estimate, most_triangles, &a.emissive, &a.emitters, &a.bounds);
    std::vector<u32> slots;
    build_light_tree(a.bounds, pool, &a.nodes, &slots);
    for (size_t i = 0; i < slots.size(); ++i) a.emitters[i].slot = slots[i];
    a.bounds = {};
    a.boxes = build_lamp_boxes(a.lamps);

    LightsView& v = view_;
    v = {};
    v.lamps = a.lamps.data();
    v.emitters = a.emitters.data();
    v.nodes = a.nodes.data();
    v.instances = a.emissive.instances.data();
    v.triangle_emitters = a.emissive.triangle_emitters.data();
    v.cluster_cdf = a.emissive.cluster_cdf.data();
    v.boxes = a.boxes.data();
    v.suns = a.suns.data();
    v.sun_irradiance = a.sun_irradiance.data();
    v.lamp_count = static_cast<u32>(a.lamps.size());
    v.emitter_count = static_cast<u32>(a.emitters.size());
    v.node_count = static_cast<u32>(a.nodes.size());
    v.box_count = static_cast<u32>(a.boxes.size());
    v.sun_count = static_cast<u32>(a.suns.size());
    for (const LampView& lamp : a.lamps)
        if (lamp.kind != LampKind::SUN && !lamp.delta && lamp_emits(lamp))
            v.hittable |= lamp.visibility & (lamp.mis ? RAY_ALL : RAY_CAMERA);
    v.uniform = !use_light_tree;
    v.world = build_world(world, &a.world);
}

u32 LightStore::describe(DeviceImage& image) const {
    const Arrays& a = *arrays_;
    const LightsView& v = view_;
    u32 block = image.add("lights", &v, sizeof(v));
    image.add_array("lamps", block, v.lamps, a.lamps.size());
    image.add_array("emitters", block, v.emitters, a.emitters.size());
    image.add_array("light_nodes", block, v.nodes, a.nodes.size());
    image.add_array("instance_lights", block, v.instances, a.emissive.instances.size());
    image.add_array("triangle_emitters", block, v.triangle_emitters, a.emissive.triangle_emitters.size());
    image.add_array("cluster_cdf", block, v.cluster_cdf, a.emissive.cluster_cdf.size());
    image.add_array("lamp_boxes", block, v.boxes, a.boxes.size());
    image.add_array("suns", block, v.suns, a.suns.size());
    image.add_array("sun_irradiance", block, v.sun_irradiance, a.sun_irradiance.size());
    image.add_array("world_density", block, v.world.density, a.world.density.size());
    image.add_array("world_row_cdf", block, v.world.row_cdf, a.world.row_cdf.size());
    image.add_array("world_column_cdf", block, v.world.column_cdf, a.world.column_cdf.size());
    return block;
}

}  // namespace luch::cpu
