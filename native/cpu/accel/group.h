// A group: the triangles of one mesh in its own space, or of several instances taken to the world; or the spheres or
// the curves of one mesh in its own space (an instance may stretch it, so they are never taken to the world). It has one
// tree.
#pragma once
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/accel/bvh8.h"
#include "cpu/thread_pool.h"
#include "luch/accel/instances.h"
#include "luch/accel/primitives.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

struct LaneRay;  // traverse.h
struct MovingTrees;  // build_moving.h

using Member = GroupMember;

enum class GroupKind : u8 { TRIANGLES, SPHERES, CURVES };

struct Group {
    std::vector<Member> members;  // by instance
    GroupKind kind = GroupKind::TRIANGLES;
    Precision precision = Precision::WATERTIGHT;
    HugeArray<Node8> nodes;  // the wide tree; none: structure holds the group
    HugeArray<Block4> blocks;
    HugeArray<SphereBlock> sphere_blocks;
    HugeArray<CurveBlock> curve_blocks;
    std::unique_ptr<Structure> structure;
    std::vector<float> corners;  // of structure's triangles: nine floats a ref
    std::vector<float> spheres;  // of structure's spheres: four floats a ref
    CurveSet curves = {};  // of the two arrays below; a ref is a piece
    std::vector<float> curve_points;
    std::vector<u32> curve_segments;
    std::vector<u8> flags;  // PrimitiveFlag by ref; empty: none
    bool left = false;  // a device builds its structure from corners (zeros where dropped) and flags
    Box root;
    bool deforms = false;  // its mesh changes its shape: moving holds it, and nothing above
    std::unique_ptr<MovingTrees> moving;
    u64 kept = 0, dropped = 0, duplicates = 0;  // primitives
    std::vector<LeftOut> left_out;  // by mesh

    Group();
    Group(Group&&) noexcept;
    Group& operator=(Group&&) noexcept;
    ~Group();

    const Member& member_of(u32 ref) const { return luch::member_of(members.data(), u32(members.size()), ref); }
};

// Adds to the row of the same mesh; rows are sorted by mesh.
void add_left_out(const LeftOut& more, std::vector<LeftOut>* all);

// Fills everything but members, kind and deforms, which say what to gather. flags: per mesh, per primitive PrimitiveFlag.
void build_group(Group& group, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                 const AccelChoice& choice, ThreadPool& pool);

// The ray in the group's space, valid, 0 <= t_min; hit->t its upper end. Count: Counters, or NoCounters.
template <class Count>
void closest_in_group(const Group& group, const LaneRay& ray, float t_min, RefHit* hit, Count& count);
// A Blocked value.
template <class Count>
u8 any_in_group(const Group& group, const LaneRay& ray, float t_min, float t_max, Count& count);

// The same of a group that changes its shape, at a time.
template <class Count>
void closest_in_moving(const Group& group, const LaneRay& ray, float t_min, float time, RefHit* hit, Count& count);
template <class Count>
u8 any_in_moving(const Group& group, const LaneRay& ray, float t_min, float t_max, float time, Count& count);

}  // namespace luch::cpu
