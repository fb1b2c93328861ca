// Trees of single meshes, for rays that see one instance alone: what walks under surfaces trace on a device. The hits
// are those of cpu/accel/local_trees.h, bit for bit.
#pragma once
#include "luch/accel/cwbvh.h"
#include "luch/accel/instances.h"

namespace luch {

struct alignas(16) LocalTreeEntry {
    Affine to_object;
    u32 tree;  // NONE: nothing to hit
};

struct LocalTreesView {
    const LocalTreeEntry* entries;  // per instance
    const Cwbvh* trees;             // of meshes; a ref is the triangle's number
};

// The nearest hit in the instance; t of a miss is infinite.
template <Precision P>
LUCH_FN Hit closest_hit(const LocalTreesView& view, u32 instance, const Ray& given) {
    const LocalTreeEntry entry = view.entries[instance];
    Ray ray = given, inside;
    if (entry.tree == NONE || !ray_is_valid(ray) || !enter_instance(entry.to_object, ray, &inside))
        return no_scene_hit();
    inside.t_min = max_f(ray.t_min, 0.0f);
    inside.t_max = min_f(ray.t_max, LARGEST_DISTANCE);
    RefHit found = {inside.t_max, NONE, 0.0f, 0.0f};
    NoCounters none;
    LocalStack<> stack;
    closest_hit<P>(view.trees[entry.tree], inside, stack, &found, none);
    if (found.ref == NONE) return no_scene_hit();
    return {found.t, found.ref, instance, found.u, found.v};
}

}  // namespace luch
