// Rays through one group: the wide tree, or brute force over its list.
#include "cpu/accel/group.h"

#include "cpu/accel/accel.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {
namespace {

bool is_closer(float t, u32 ref, const GroupHit& best) { return t < best.t || (t == best.t && ref < best.ref); }

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

void closest_in_group(const Group& group, const LaneRay& ray, float t_min, GroupHit* best) {
    auto offer = [best](float t, u32 ref, float u, float v) {
        if (is_closer(t, ref & REF_MASK, *best)) *best = {t, ref & REF_MASK, u, v};
    };
    if (group.nodes.size() == 0) {
        for_each_hit(group, make_triangle_ray(ray.origin3(), ray.direction3()), t_min, best->t,
                     [&](const TriangleHit& hit, u32 ref) { offer(hit.t, ref, hit.u, hit.v); });
        return;
    }
    Rays rays(group, ray, t_min);
    visit_closest(group.nodes.data(), rays.node, &best->t, [&](u32 first, u32 count) {
        for (u32 b = first; b < first + count; ++b) {
            const Block4& block = group.blocks[b];
            BlockHits hits;
            for (u32 mask = intersect_block(block, rays.block, best->t, &hits); mask; mask &= mask - 1) {
                u32 lane = u32(__builtin_ctz(mask));
                offer(hits.t[lane], block.ref[lane], hits.u[lane], hits.v[lane]);
            }
        }
    });
}

u8 any_in_group(const Group& group, const LaneRay& ray, float t_min, float t_max) {
    u8 result = BLOCKED_NOT;
    auto note = [&result](u32 ref) {
        if (!(ref & REF_TRANSPARENT))
            result = BLOCKED_OPAQUE;
        else if (result == BLOCKED_NOT)
            result = BLOCKED_MAYBE;
    };
    if (group.nodes.size() == 0) {
        for_each_hit(group, make_triangle_ray(ray.origin3(), ray.direction3()), t_min, t_max,
                     [&](const TriangleHit&, u32 ref) { note(ref); });
        return result;
    }
    Rays rays(group, ray, t_min);
    visit_any(group.nodes.data(), rays.node, t_max, [&](u32 first, u32 count) {
        for (u32 b = first; b < first + count; ++b) {
            const Block4& block = group.blocks[b];
            BlockHits hits;
            for (u32 mask = intersect_block(block, rays.block, t_max, &hits); mask; mask &= mask - 1)
                note(block.ref[__builtin_ctz(mask)]);
        }
        return result == BLOCKED_OPAQUE;
    });
    return result;
}

}  // namespace luch::cpu
