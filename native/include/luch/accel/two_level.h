// The scene's primitives for any device: groups of them, each in a structure of its own, entries that put groups into
// the world, a compressed wide tree over the entries. The hits are those of cpu/accel/accel.h, bit for bit.
#pragma once
#include "luch/accel/cwbvh.h"
#include "luch/accel/instances.h"
#include "luch/accel/moving.h"
#include "luch/accel/pass_by.h"
#include "luch/plan.h"

namespace luch {

// A structure, and what its refs mean.
template <class Structure>
struct TracedGroup {
    Structure structure;
    Primitives primitives;       // but for curves empty where the structure's leaves hold them
    const GroupMember* members;
    u32 member_count;
    u32 unused;
};

template <class Structure>
struct TwoLevelView {
    CwbvhOf<GroupEntry> top;               // none where all is one group
    const TracedGroup<Structure>* groups;
    EntryError error;
    TracedGroup<Structure> world;  // a group in the world that is not in the top: all of the scene, or all that
    u32 world_visibility;  // stands still where the rest moves; by RayKind. 0: there is none
    u32 group_count;
    const TraceMotion* motion;  // null: nothing moves
};

template <class Structure>
LUCH_FN Hit hit_in_scene(const TracedGroup<Structure>& group, u32 instance, const RefHit& hit) {
    const GroupMember member = member_of(group.members, group.member_count, hit.ref);
    return {hit.t, member.prim_of(hit.ref), instance == NONE ? member.instance : instance, hit.u, hit.v};
}

// A ray of the scene in an entry's group, or false. motion, time: read where the entry moves.
LUCH_FN bool enter_entry(const GroupEntry& entry, const Ray& ray, u32 kinds, float t_max, const TraceMotion* motion,
                         float time, Ray* inside) {
    if (!(entry.visibility & kinds)) return false;
    if (entry.instance == NONE) {
        *inside = ray;
    } else if (plan::MOTION && entry.motion != 0u) {
        if (!enter_moving(*motion, entry, ray, time, inside)) return false;
    } else if (!enter_instance(entry.to_object, ray, inside)) {
        return false;
    }
    inside->t_min = ray.t_min;
    inside->t_max = t_max;
    return true;
}

// The ray with the interval that structures take: 0 <= t_min, t_max a number. False if it can hit nothing.
LUCH_FN bool clamp_interval(Ray* ray) {
    bool valid = ray_is_valid(*ray);
    ray->t_min = max_f(ray->t_min, 0.0f);
    ray->t_max = min_f(ray->t_max, LARGEST_DISTANCE);
    return valid;
}

template <class Structure>
LUCH_FN WideRay top_ray(const TwoLevelView<Structure>& scene, const Ray& ray) {
    return make_wide_ray(ray, scene.top.root, widening(scene.error, ray.origin));
}

// Whether a ray has nothing to do with what moves, where that lies apart from the world. ray: clamped.
template <class Structure>
LUCH_FN bool passes_movers_by(const TwoLevelView<Structure>& scene, const Ray& ray, float t_max) {
    if (!plan::MOTION || scene.world_visibility == 0u) return false;
    return passes_by(make_pass_box(scene.top.root, scene.error), ray.origin, ray.direction, ray.t_min, t_max);
}

// The group of an entry whose mesh changes its shape.
template <class Structure>
LUCH_FN const MovingGroup* moving_group_of(const TwoLevelView<Structure>& scene, const GroupEntry& entry) {
    return plan::MOTION && entry.motion != 0u ? moving_group(*scene.motion, entry) : nullptr;
}

template <Precision P, class Structure>
struct ClosestOfEntries {
    const TwoLevelView<Structure>& scene;
    const Ray& ray;
    u32 kinds;
    float time;
    Hit best;
    LUCH_FN float t_max() const { return best.t; }
    LUCH_FN bool operator()(const GroupEntry& entry) {
        Ray inside;
        if (!enter_entry(entry, ray, kinds, best.t, scene.motion, time, &inside)) return false;
        const TracedGroup<Structure>& group = scene.groups[entry.group];
        NoCounters none;
        RefHit found = {best.t, NONE, 0.0f, 0.0f};
        if (const MovingGroup* moving = moving_group_of(scene, entry))
            closest_hit<P>(*moving, inside, time, &found, none);
        else
            closest_hit<P>(group.structure, group.primitives, inside, &found, none);
        if (found.ref == NONE) return false;
        Hit hit = hit_in_scene(group, entry.instance, found);
        if (comes_first(hit, best)) best = hit;
        return false;
    }
};
template <Precision P, class Structure>
struct AnyOfEntries {
    const TwoLevelView<Structure>& scene;
    const Ray& ray;
    u32 kinds;
    float time;
    u8 blocked;
    LUCH_FN float t_max() const { return ray.t_max; }
    LUCH_FN bool operator()(const GroupEntry& entry) {
        Ray inside;
        if (!enter_entry(entry, ray, kinds, ray.t_max, scene.motion, time, &inside)) return false;
        const TracedGroup<Structure>& group = scene.groups[entry.group];
        NoCounters none;
        const MovingGroup* moving = moving_group_of(scene, entry);
        u8 found = moving ? any_hit<P>(*moving, inside, time, none)
                          : any_hit<P>(group.structure, group.primitives, inside, none);
        if (found) blocked = found;
        return blocked == BLOCKED_OPAQUE;
    }
};

// What the top holds, where it comes before `best`. ray: clamped. best: NONE, or of what stands still.
template <Precision P, class Structure>
LUCH_FN Hit closest_in_top(const TwoLevelView<Structure>& scene, const Ray& ray, u32 kinds, float time, Hit best) {
    NoCounters none;
    ClosestOfEntries<P, Structure> entries = {scene, ray, kinds, time, best};
    LocalStack<> stack;
    walk(scene.top, top_ray(scene, ray), stack, entries, none);
    return entries.best.prim == NONE ? no_scene_hit() : entries.best;
}

// The ray as it stands in the scene; it sees the instances that share a bit with kinds, as they are at `time`.
template <Precision P, class Structure>
LUCH_FN Hit closest_hit(const TwoLevelView<Structure>& scene, const Ray& given, u32 kinds,
                        float time = SHUTTER_MIDDLE) {
    Ray ray = given;
    if (!clamp_interval(&ray)) return no_scene_hit();
    Hit best = {ray.t_max, NONE, NONE, 0.0f, 0.0f};
    if (scene.world_visibility & kinds) {
        NoCounters none;
        RefHit found = {ray.t_max, NONE, 0.0f, 0.0f};
        closest_hit<P>(scene.world.structure, scene.world.primitives, ray, &found, none);
        if (found.ref != NONE) best = hit_in_scene(scene.world, NONE, found);
    }
    if (passes_movers_by(scene, ray, best.t)) return best.prim == NONE ? no_scene_hit() : best;
    return closest_in_top<P>(scene, ray, kinds, time, best);
}

// A Blocked value.
template <Precision P, class Structure>
LUCH_FN u8 any_hit(const TwoLevelView<Structure>& scene, const Ray& given, u32 kinds, float time = SHUTTER_MIDDLE) {
    Ray ray = given;
    if (!clamp_interval(&ray)) return BLOCKED_NOT;
    NoCounters none;
    u8 blocked = BLOCKED_NOT;
    if (scene.world_visibility & kinds) blocked = any_hit<P>(scene.world.structure, scene.world.primitives, ray, none);
    if (blocked == BLOCKED_OPAQUE || passes_movers_by(scene, ray, ray.t_max)) return blocked;
    AnyOfEntries<P, Structure> entries = {scene, ray, kinds, time, blocked};
    LocalStack<> stack;
    walk(scene.top, top_ray(scene, ray), stack, entries, none);
    return entries.blocked;
}

}  // namespace luch
