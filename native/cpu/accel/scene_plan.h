// How a scene is cut into groups of primitives, and what the entries' boxes are: for every scheme of two levels.
#pragma once
#include <vector>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/build_moving.h"
#include "cpu/accel/group.h"
#include "luch/accel/instances.h"

namespace luch::cpu {

struct ScenePlan {
    std::vector<Group> groups;                       // what to gather
    std::vector<GroupEntry> entries;
    SceneMotion motion;
    u64 dropped_triangles = 0, dropped_spheres = 0, dropped_pieces = 0;  // of instances whose transforms are not finite
};

// By instance: whether its triangles are taken to the world (one user of the mesh alone, or few copies), not moving.
std::vector<u8> instances_in_world(const SceneView& scene, u64 flatten_triangles);

// flatten_triangles: how many copies of triangles there may be of instances taken to the world.
ScenePlan plan_scene(const SceneView& scene, u64 flatten_triangles);

// Builds every group's structure, then leaves out entries whose groups have no primitives.
void build_groups(ScenePlan& plan, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                  const AccelChoice& choice, ThreadPool& pool);

// Adds a built group's primitives.
void count_primitives(const Group& group, AccelStats* stats);

struct EntryBoxes {
    HugeArray<PrimBox> boxes;  // id: the entry; finite
    EntryError error;
};
// Takes out the entry of what stands still in the world, where all other entries move: rays look for it first, as if
// nothing moved. Its visibility is 0 where there is none such. Before bound_entries.
GroupEntry take_world_apart(ScenePlan& plan);
EntryBoxes bound_entries(const ScenePlan& plan, const SceneView& scene);

}  // namespace luch::cpu
