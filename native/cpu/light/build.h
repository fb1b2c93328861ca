// The parts of LightStore::build, one file each.
#pragma once
#include <cstdlib>
#include <new>
#include <vector>

#include "cpu/lights.h"
#include "luch/light/closest_lamp.h"
#include "luch/light/tree.h"

namespace luch::cpu {

// What the tree knows of one emitter.
struct EmitterBounds {
    Vec3 low, high;        // box
    Vec3 axis;             // unit, of the cone of normals
    float normals_rad;     // half angle of that cone: 0 for one direction, pi for all
    float emission_rad;    // how far from a normal light goes: pi/2 for a plain surface
    bool two_sided;        // light leaves along -normal too
    bool omni;             // as strong in all directions
    float intensity;       // W/sr along a normal, luminance; > 0 and finite
};

LampView make_lamp(const LampInput& input);
// False: the lamp gives no light (energy 0 or not finite, a matrix that flattens it away).
bool lamp_emits(const LampView& lamp);
EmitterBounds lamp_bounds(const LampView& lamp);

// slots[i]: where emitter i hangs.
void build_light_tree(const std::vector<EmitterBounds>& bounds, ThreadPool& pool, std::vector<LightTreeNode>* nodes,
                      std::vector<u32>* slots);

struct EmissiveArrays {
    std::vector<InstanceLight> instances;
    std::vector<u32> triangle_emitters;
    std::vector<float> cluster_cdf;
};
void collect_emissive(const SceneView& scene, const std::vector<Color>& estimates, size_t most_triangles,
                      EmissiveArrays* out, std::vector<Emitter>* emitters, std::vector<EmitterBounds>* bounds);

// Sides of a mesh's triangles that are worth sampling when all of it emits: 1 (front) for a closed mesh, 2 if it
// is inside out, 3 for an open one. From inside a closed emitter every ray finds it by itself.
u8 outer_sides(const SceneView& scene, const MeshView& mesh);

std::vector<LampBoxNode> build_lamp_boxes(const std::vector<LampView>& lamps);

struct WorldArrays {
    std::vector<float> density, row_cdf, column_cdf;
};
WorldLight build_world(const WorldInput& input, WorldArrays* arrays);

}  // namespace luch::cpu
