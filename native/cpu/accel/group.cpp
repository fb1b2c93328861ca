// Rays through one group: the wide tree, or a structure of the race.
#include "cpu/accel/group.h"

#include "cpu/accel/accel.h"
#include "cpu/accel/build_moving.h"
#include "cpu/accel/curve_blocks.h"
#include "cpu/accel/leaf.h"
#include "cpu/accel/sphere_blocks.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {
namespace {

template <class Block>
struct Rays {
    NodeRay node;
    Block block;
    Rays(const Group& group, const LaneRay& ray, float t_min) : node(ray, group.root, t_min), block(ray, t_min) {}
};

template <class Block, class Count>
void closest_in_tree(const Group& group, const LaneRay& ray, float t_min, RefHit* best, Count& count) {
    Rays<Block> rays(group, ray, t_min);
    visit_closest(
        group.nodes.data(), rays.node, &best->t,
        [&](u32 leaf) { closest_in_leaf(group, rays.block, leaf, best, count); }, count);
}

template <class Block, class Count>
u8 any_in_tree(const Group& group, const LaneRay& ray, float t_min, float t_max, Count& count) {
    u8 result = BLOCKED_NOT;
    Rays<Block> rays(group, ray, t_min);
    visit_any(
        group.nodes.data(), rays.node, t_max,
        [&](u32 leaf) {
            any_in_leaf(group, rays.block, leaf, t_max, &result, count);
            return result == BLOCKED_OPAQUE;
        },
        count);
    return result;
}

// Calls act with the type of the ray that the group's leaves take.
template <class Act>
auto with_block_ray(const Group& group, Act&& act) {
    if (group.kind == GroupKind::CURVES) {
        if (group.precision == Precision::FAST) return act.template operator()<CurveBlockRay<Precision::FAST>>();
        return act.template operator()<CurveBlockRay<Precision::WATERTIGHT>>();  // double already
    }
    if (group.kind == GroupKind::SPHERES) {
        if (group.precision == Precision::FAST) return act.template operator()<SphereBlockRay<Precision::FAST>>();
        return act.template operator()<SphereBlockRay<Precision::WATERTIGHT>>();  // double already
    }
    if (group.precision == Precision::FAST) return act.template operator()<FastBlockRay>();
    if (group.precision == Precision::DOUBLE) return act.template operator()<DoubleBlockRay>();
    return act.template operator()<BlockRay>();
}

// Calls act with the group's precision.
template <class Act>
auto with_precision(Precision precision, Act&& act) {
    if (precision == Precision::FAST) return act.template operator()<Precision::FAST>();
    if (precision == Precision::DOUBLE) return act.template operator()<Precision::DOUBLE>();
    return act.template operator()<Precision::WATERTIGHT>();
}

inline Counters* pointer_to(Counters& count) { return &count; }
inline Counters* pointer_to(NoCounters&) { return nullptr; }

}  // namespace

template <class Count>
void closest_in_group(const Group& group, const LaneRay& ray, float t_min, RefHit* best, Count& count) {
    if (group.structure) {
        Ray inside = {ray.origin3(), t_min, ray.direction3(), best->t};
        group.structure->closest(group.precision, &inside, best, 1, pointer_to(count));
        return;
    }
    with_block_ray(group, [&]<class Block>() { closest_in_tree<Block>(group, ray, t_min, best, count); });
}
template void closest_in_group(const Group&, const LaneRay&, float, RefHit*, NoCounters&);
template void closest_in_group(const Group&, const LaneRay&, float, RefHit*, Counters&);

template <class Count>
u8 any_in_group(const Group& group, const LaneRay& ray, float t_min, float t_max, Count& count) {
    if (group.structure) {
        Ray inside = {ray.origin3(), t_min, ray.direction3(), t_max};
        u8 result = BLOCKED_NOT;
        group.structure->any(group.precision, &inside, &result, 1, pointer_to(count));
        return result;
    }
    return with_block_ray(group, [&]<class Block>() { return any_in_tree<Block>(group, ray, t_min, t_max, count); });
}
template u8 any_in_group(const Group&, const LaneRay&, float, float, NoCounters&);
template u8 any_in_group(const Group&, const LaneRay&, float, float, Counters&);

template <class Count>
void closest_in_moving(const Group& group, const LaneRay& ray, float t_min, float time, RefHit* best, Count& count) {
    Ray inside = {ray.origin3(), t_min, ray.direction3(), best->t};
    with_precision(group.precision,
                   [&]<Precision P>() { closest_hit<P>(group.moving->view, inside, time, best, count); });
}
template void closest_in_moving(const Group&, const LaneRay&, float, float, RefHit*, NoCounters&);
template void closest_in_moving(const Group&, const LaneRay&, float, float, RefHit*, Counters&);

template <class Count>
u8 any_in_moving(const Group& group, const LaneRay& ray, float t_min, float t_max, float time, Count& count) {
    Ray inside = {ray.origin3(), t_min, ray.direction3(), t_max};
    return with_precision(group.precision,
                          [&]<Precision P>() { return any_hit<P>(group.moving->view, inside, time, count); });
}
template u8 any_in_moving(const Group&, const LaneRay&, float, float, float, NoCounters&);
template u8 any_in_moving(const Group&, const LaneRay&, float, float, float, Counters&);

}  // namespace luch::cpu
