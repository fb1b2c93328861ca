// A group: the triangles of one mesh in its own space, or of several instances taken to the world. It has
// one tree. A triangle's ref is its member's first_ref + its index in the mesh, so refs sort as
// (instance, prim) do.
#pragma once
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/accel/bvh8.h"
#include "cpu/thread_pool.h"
#include "luch/accel/primitives.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

struct LaneRay;  // traverse.h

struct Member {
    u32 mesh;
    u32 instance;  // NONE: the mesh in its own space
    u32 first_ref;
};

struct Group {
    std::vector<Member> members;  // by instance
    Precision precision = Precision::WATERTIGHT;
    HugeArray<Node8> nodes;       // the wide tree; none: structure holds the group
    HugeArray<Block4> blocks;
    std::unique_ptr<Structure> structure;
    std::vector<float> corners;   // of structure's triangles: nine floats a ref
    std::vector<u8> flags;        // PrimitiveFlag by ref; empty: none
    Box root;
    u64 triangles = 0, dropped = 0;

    const Member& member_of(u32 ref) const;
};

// Fills everything but members, which say what to gather. flags: per mesh, per triangle PrimitiveFlag.
void build_group(Group& group, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                 const AccelChoice& choice, ThreadPool& pool);

// The ray in the group's space, valid, 0 <= t_min; hit->t its upper end.
void closest_in_group(const Group& group, const LaneRay& ray, float t_min, RefHit* hit);
// A Blocked value.
u8 any_in_group(const Group& group, const LaneRay& ray, float t_min, float t_max);

}  // namespace luch::cpu
