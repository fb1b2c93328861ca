#include "cpu/lights.h"

#include <cmath>

#include "cpu/light/build.h"
#include "cpu/thread_pool.h"
#include "luch/light/triangle.h"

namespace luch::cpu {

struct LightStore::Arrays {
    std::vector<LampView> lamps;
    std::vector<Emitter> emitters;
    std::vector<EmitterBounds> bounds;
    std::vector<LightTreeNode> nodes;
    std::vector<LampBoxNode> boxes;
    std::vector<u32> instance_emitters, triangle_emitters, suns;
    std::vector<float> sun_irradiance;
    std::vector<u8> instance_sides, mesh_sides;  // mesh_sides: 0: not asked yet
    WorldArrays world;

    void add_lamps(const std::vector<LampInput>& inputs);
    void add_triangles(const SceneView& scene, const std::vector<Color>& estimates);
    u8 sides_of(const SceneView& scene, const InstanceView& at);
    void add_instance(const SceneView& scene, u32 instance, const std::vector<Color>& estimates);
};

namespace {

const MaterialView& material_of(const SceneView& scene, const InstanceView& at, u32 slot, u32* index) {
    u32 last = at.material_count > 0u ? at.material_count - 1u : 0u;
    *index = scene.material_table[at.first_material + std::min(slot, last)];
    return scene.materials[*index];
}

bool samples_as_light(const MaterialView& material) {
    return (material.program.flags & PROGRAM_EMISSION) != 0u && material.emission_sampling != 0u;
}

bool any_light(const SceneView& scene, const InstanceView& at) {
    if (at.visibility == 0u) return false;
    for (u32 slot = 0; slot < std::max(at.material_count, 1u); ++slot) {
        u32 index;
        if (samples_as_light(material_of(scene, at, slot, &index))) return true;
    }
    return false;
}

// Everything on it emits and hides what lies behind.
bool all_light(const SceneView& scene, const InstanceView& at) {
    for (u32 slot = 0; slot < std::max(at.material_count, 1u); ++slot) {
        u32 index;
        const MaterialView& material = material_of(scene, at, slot, &index);
        if (!samples_as_light(material) || (material.program.flags & PROGRAM_TRANSPARENT) != 0u) return false;
    }
    return true;
}

// False: no area, or not finite. sides: 1 front, 2 back, 3 both.
bool triangle_bounds(const SceneView& scene, u32 instance, u32 prim, u32 sides, Color estimate, EmitterBounds* b) {
    const InstanceView& at = scene.instances[instance];
    const MeshView& mesh = scene.meshes[at.mesh];
    const u32* index = scene.triangles + static_cast<u64>(mesh.first_triangle + prim) * 3u;
    Vec3 corner[3];
    for (int i = 0; i < 3; ++i)
        corner[i] = transform_point(at.to_world, load_position(scene, mesh.first_vertex + index[i]));
    Vec3 normal = cross(corner[1] - corner[0], corner[2] - corner[0]);
    float double_area = length(normal);
    if (!(double_area > 0.0f && finite_f(double_area))) return false;
    bool back_only = sides == 2u;
    bool flip = back_only != ((at.flags & INSTANCE_MIRRORED) != 0u);
    b->low = min_v(corner[0], min_v(corner[1], corner[2]));
    b->high = max_v(corner[0], max_v(corner[1], corner[2]));
    b->axis = normal / (flip ? -double_area : double_area);
    b->normals_rad = 0.0f;
    b->emission_rad = HALF_PI;
    b->two_sided = sides == 3u;
    float strength = luminance(abs_v(estimate));
    b->intensity =
        clamp_f((strength > 0.0f && finite_f(strength) ? strength : 1.0f) * 0.5f * double_area, 1e-30f, 1e30f);
    return finite_v(b->low) && finite_v(b->high);
}

}  // namespace

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

u8 LightStore::Arrays::sides_of(const SceneView& scene, const InstanceView& at) {
    if (!all_light(scene, at)) return 3;
    if (mesh_sides.size() <= at.mesh) mesh_sides.resize(at.mesh + 1, 0);
    if (mesh_sides[at.mesh] == 0) mesh_sides[at.mesh] = outer_sides(scene, scene.meshes[at.mesh]);
    return mesh_sides[at.mesh];
}

void LightStore::Arrays::add_instance(const SceneView& scene, u32 instance, const std::vector<Color>& estimates) {
    const InstanceView& at = scene.instances[instance];
    const MeshView& mesh = scene.meshes[at.mesh];
    u32 first = static_cast<u32>(triangle_emitters.size());
    triangle_emitters.resize(first + mesh.triangle_count, NONE);
    instance_emitters[instance] = first;
    instance_sides[instance] = sides_of(scene, at);
    for (u32 prim = 0; prim < mesh.triangle_count; ++prim) {
        u32 index;
        const MaterialView& material = material_of(scene, at, scene.material_slots[mesh.first_triangle + prim], &index);
        EmitterBounds b{};
        u32 sides = material.emission_sampling & instance_sides[instance];
        if (!samples_as_light(material) || sides == 0u) continue;
        Color estimate = index < estimates.size() ? estimates[index] : Color{1.0f, 1.0f, 1.0f};
        if (!triangle_bounds(scene, instance, prim, sides, estimate, &b)) continue;
        triangle_emitters[first + prim] = static_cast<u32>(emitters.size());
        emitters.push_back({NONE, instance, prim, NONE});
        bounds.push_back(b);
    }
}

void LightStore::Arrays::add_triangles(const SceneView& scene, const std::vector<Color>& estimates) {
    instance_emitters.assign(scene.instance_count, NONE);
    instance_sides.assign(scene.instance_count, 3);
    for (u32 i = 0; i < scene.instance_count; ++i)
        if (any_light(scene, scene.instances[i])) add_instance(scene, i, estimates);
}

LightStore::LightStore() = default;
LightStore::~LightStore() = default;

void LightStore::build(const SceneView& scene, const std::vector<LampInput>& lamps, const WorldInput& world,
                       const std::vector<Color>& material_emission_estimate, bool use_light_tree, ThreadPool& pool) {
    arrays_ = std::make_unique<Arrays>();
    Arrays& a = *arrays_;
    a.add_lamps(lamps);
    a.add_triangles(scene, material_emission_estimate);
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
    v.instance_emitters = a.instance_emitters.data();
    v.triangle_emitters = a.triangle_emitters.data();
    v.instance_sides = a.instance_sides.data();
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

}  // namespace luch::cpu
