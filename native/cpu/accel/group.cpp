// Rays through one group: the wide tree, or brute force over its list.
#include "cpu/accel/group.h"

#include "cpu/accel/accel.h"
#include "cpu/accel/leaf.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {
namespace {

struct Rays {
    NodeRay node;
    BlockRay block;
    Rays(const Group& group, const LaneRay& ray, float t_min) : node(ray, group.root, t_min), block(ray, t_min) {}
};

bool lane_hit(const Block4& block, u32 lane, const TriangleRay& ray, float t_min, float t_max, TriangleHit* hit) {
    Vec3 p[3];
    for (int k = 0; k < 3; ++k) p[k] = {block.vertex[k][0][lane], block.vertex[k][1][lane], block.vertex[k][2][lane]};
    return intersect_triangle(ray, p[0], p[1], p[2], t_min, t_max, hit);
}

// Every triangle, by the scalar test alone: the oracle.
template <class OnHit>
void for_each_hit(const Group& group, const TriangleRay& ray, float t_min, float t_max, OnHit&& on_hit) {
    for (size_t b = 0; b < group.blocks.size(); ++b)
        for (u32 lane = 0; lane < 4; ++lane) {
            TriangleHit hit;
            if (lane_hit(group.blocks[b], lane, ray, t_min, t_max, &hit)) on_hit(hit, group.blocks[b].ref[lane]);
        }
}

}  // namespace

void closest_in_group(const Group& group, const LaneRay& ray, float t_min, RefHit* best) {
    if (group.nodes.size() == 0) {
        for_each_hit(group, make_triangle_ray(ray.origin3(), ray.direction3()), t_min, best->t,
                     [&](const TriangleHit& hit, u32 ref) { offer(hit.t, ref, hit.u, hit.v, best); });
        return;
    }
    Rays rays(group, ray, t_min);
    visit_closest(group.nodes.data(), rays.node, &best->t,
                  [&](u32 leaf) { closest_in_leaf(group, rays.block, leaf, best); });
}

u8 any_in_group(const Group& group, const LaneRay& ray, float t_min, float t_max) {
    u8 result = BLOCKED_NOT;
    if (group.nodes.size() == 0) {
        for_each_hit(group, make_triangle_ray(ray.origin3(), ray.direction3()), t_min, t_max,
                     [&](const TriangleHit&, u32 ref) { note_blocked(ref, &result); });
        return result;
    }
    Rays rays(group, ray, t_min);
    visit_any(group.nodes.data(), rays.node, t_max, [&](u32 leaf) {
        any_in_leaf(group, rays.block, leaf, t_max, &result);
        return result == BLOCKED_OPAQUE;
    });
    return result;
}

}  // namespace luch::cpu
