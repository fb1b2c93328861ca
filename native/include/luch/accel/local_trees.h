// Trees of single meshes, for rays that see one instance alone: what walks under surfaces trace on a device. The hits
// are those of cpu/accel/local_trees.h, bit for bit.
#pragma once
#include "luch/accel/cwbvh.h"
#include "luch/accel/instances.h"
#include "luch/accel/moving.h"
#include "luch/plan.h"

namespace luch {

struct alignas(16) LocalTreeEntry {
    Affine to_object;
    u32 tree;    // NONE: nothing to hit
    u32 motion;  // as GroupEntry's
};

struct LocalTreesView {
    const LocalTreeEntry* entries;  // per instance
    const Cwbvh* trees;             // of meshes; a ref is the triangle's number
    const TraceMotion* motion;      // null: nothing moves
};

// A ray of the scene in an instance, its interval not yet set, or false.
LUCH_FN bool enter_local(const LocalTreeEntry& entry, const TraceMotion* motion, const Ray& ray, float time,
                         Ray* inside) {
    if (entry.tree == NONE || !ray_is_valid(ray)) return false;
    if (plan::MOTION && entry.motion != 0u) return enter_moving(*motion, entry, ray, time, inside);
    return enter_instance(entry.to_object, ray, inside);
}

// The nearest hit in the instance as it is at that time; t of a miss is infinite.
template <Precision P>
LUCH_FN Hit closest_hit(const LocalTreesView& view, u32 instance, const Ray& given, float time = SHUTTER_MIDDLE) {
    const LocalTreeEntry entry = view.entries[instance];
    Ray ray = given, inside;
    if (!enter_local(entry, view.motion, ray, time, &inside)) return no_scene_hit();
    inside.t_min = max_f(ray.t_min, 0.0f);
    inside.t_max = min_f(ray.t_max, LARGEST_DISTANCE);
    RefHit found = {inside.t_max, NONE, 0.0f, 0.0f};
    NoCounters none;
    const MovingGroup* moving = plan::MOTION && entry.motion != 0u ? moving_group(*view.motion, entry) : nullptr;
    if (moving) {
        closest_hit<P>(*moving, inside, time, &found, none);
    } else {
        const Primitives none_beside{};  // trees of single meshes hold triangles alone
        closest_hit<P>(view.trees[entry.tree], none_beside, inside, &found, none);
    }
    if (found.ref == NONE) return no_scene_hit();
    return {found.t, found.ref, instance, found.u, found.v};
}

}  // namespace luch
