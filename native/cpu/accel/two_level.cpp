// Rays through two levels.
#include "cpu/accel/two_level.h"

#include <algorithm>

#include "cpu/accel/interleave.h"

namespace luch::cpu {
namespace {

constexpr Hit MISS = {INFINITE_DISTANCE, NONE, NONE, 0.0f, 0.0f};
constexpr u32 BATCH = 1024;  // rays looked at together

float time_at(const float* times, size_t i) { return times ? times[i] : SHUTTER_MIDDLE; }
u32 kinds_at(const u32* ray_kinds, size_t i) { return ray_kinds ? ray_kinds[i] : u32(RAY_ALL); }

template <class T>
const T* from(const T* list, size_t first) {
    return list ? list + first : nullptr;
}
template <class Work>
void in_batches(size_t count, Work&& work) {
    for (size_t first = 0; first < count; first += BATCH) work(first, u32(std::min<size_t>(BATCH, count - first)));
}
u32 every(u32 count, u32* out) {
    for (u32 i = 0; i < count; ++i) out[i] = i;
    return count;
}

}  // namespace

NodeRay TwoLevel::top_ray(Vec3 origin, Vec3 direction, float t_min) const {
    return NodeRay(make_box_ray(origin, direction, root_, widening(error_, origin)), t_min);
}

// The ray as the entry's triangles see it; false if the transform leaves no ray.
bool TwoLevel::enter(const GroupEntry& entry, const Ray& ray, float time, LaneRay* out) const {
    if (entry.instance == NONE) {
        *out = lane_ray(ray);
        return true;
    }
    Ray inside;
    bool valid = entry.motion ? enter_moving(motion_.view, entry, ray, time, &inside)
                              : enter_instance(entry.to_object, ray, &inside);
    *out = lane_ray(inside);
    return valid;
}

template <class Count>
void TwoLevel::closest_in_entry(const GroupEntry& entry, const Ray& ray, float time, Hit* best, Count& count) const {
    LaneRay inside;
    if (!enter(entry, ray, time, &inside)) return;
    const Group& group = groups_[entry.group];
    RefHit hit = {best->t, NONE, 0.0f, 0.0f};
    if (group.moving)
        closest_in_moving(group, inside, max_f(ray.t_min, 0.0f), time, &hit, count);
    else
        closest_in_group(group, inside, max_f(ray.t_min, 0.0f), &hit, count);
    if (hit.ref == NONE) return;
    const Member& member = group.member_of(hit.ref);
    u32 instance = entry.instance == NONE ? member.instance : entry.instance;
    Hit found = {hit.t, member.prim_of(hit.ref), instance, hit.u, hit.v};
    if (comes_first(found, *best)) *best = found;
}

template <class Count>
u8 TwoLevel::any_in_entry(const GroupEntry& entry, const Ray& ray, float time, Count& count) const {
    LaneRay inside;
    if (!enter(entry, ray, time, &inside)) return BLOCKED_NOT;
    const Group& group = groups_[entry.group];
    float t_min = max_f(ray.t_min, 0.0f), t_max = min_f(ray.t_max, LARGEST_DISTANCE);
    return group.moving ? any_in_moving(group, inside, t_min, t_max, time, count)
                        : any_in_group(group, inside, t_min, t_max, count);
}

// best: the best so far, or none at the ray's end.
template <class Count>
void TwoLevel::closest_in_entries(const Ray& ray, u32 kinds, float time, Hit* best, Count& count) const {
    auto visit = [&](u32 first, u32 size) {
        for (u32 e = first; e < first + size; ++e)
            if (entries_[e].visibility & kinds) closest_in_entry(entries_[e], ray, time, best, count);
    };
    auto visit_leaf = [&](u32 leaf) { visit(leaf_first(leaf), leaf_items(leaf)); };
    if (top_.size() && !alone())
        visit_closest(top_.data(), top_ray(ray.origin, ray.direction, max_f(ray.t_min, 0.0f)), &best->t, visit_leaf,
                      count);
    else
        visit(0, u32(entries_.size()));
}

template <class Count>
void TwoLevel::closest_one(const Ray& ray, u32 kinds, float time, Hit* best, Count& count) const {
    *best = MISS;
    if (!ray_is_valid(ray)) return;
    best->t = min_f(ray.t_max, LARGEST_DISTANCE);
    if (world_.visibility & kinds) closest_in_entry(world_, ray, time, best, count);
    if (!passes_entries_by(ray, best->t)) closest_in_entries(ray, kinds, time, best, count);
    if (best->prim == NONE) best->t = INFINITE_DISTANCE;
}

template <class Count>
u8 TwoLevel::any_one(const Ray& ray, u32 kinds, float time, Count& count) const {
    if (!ray_is_valid(ray)) return BLOCKED_NOT;
    u8 result = BLOCKED_NOT;
    if (world_.visibility & kinds) result = any_in_entry(world_, ray, time, count);
    if (result == BLOCKED_OPAQUE || passes_entries_by(ray, min_f(ray.t_max, LARGEST_DISTANCE))) return result;
    u8 rest = any_in_entries(ray, kinds, time, count);
    return rest ? rest : result;
}

// A Blocked value of a valid ray.
template <class Count>
u8 TwoLevel::any_in_entries(const Ray& ray, u32 kinds, float time, Count& count) const {
    u8 result = BLOCKED_NOT;
    auto visit = [&](u32 first, u32 size) {
        for (u32 e = first; e < first + size && result != BLOCKED_OPAQUE; ++e)
            if (entries_[e].visibility & kinds)
                if (u8 blocked = any_in_entry(entries_[e], ray, time, count)) result = blocked;
        return result == BLOCKED_OPAQUE;
    };
    auto visit_leaf = [&](u32 leaf) { return visit(leaf_first(leaf), leaf_items(leaf)); };
    if (top_.size() && !alone())
        visit_any(top_.data(), top_ray(ray.origin, ray.direction, max_f(ray.t_min, 0.0f)), ray.t_max, visit_leaf,
                  count);
    else
        visit(0, u32(entries_.size()));
    return result;
}

Hit TwoLevel::world_hit(const Group& group, const RefHit& hit) const {
    if (hit.ref == NONE) return MISS;
    const Member& member = group.member_of(hit.ref);
    return {hit.t, member.prim_of(hit.ref), member.instance, hit.u, hit.v};
}

void TwoLevel::closest_scattered(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits,
                                 u32 count) const {
    RefHit found[BATCH];
    u32 valid[BATCH] = {}, valid_count = 0;
    for (u32 i = 0; i < count; ++i) {
        found[i] = {min_f(rays[i].t_max, LARGEST_DISTANCE), NONE, 0.0f, 0.0f};
        if (meets_world(rays[i], kinds_at(ray_kinds, i))) valid[valid_count++] = i;
    }
    closest_interleaved(group, rays, valid, valid_count, found);
    for (u32 i = 0; i < count; ++i) hits[i] = world_hit(group, found[i]);
}

void TwoLevel::closest_together(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const {
    NoCounters none;
    for (u32 i = 0; i < count; ++i) {
        RefHit found = {min_f(rays[i].t_max, LARGEST_DISTANCE), NONE, 0.0f, 0.0f};
        if (meets_world(rays[i], kinds_at(ray_kinds, i)))
            closest_in_group(group, lane_ray(rays[i]), max_f(rays[i].t_min, 0.0f), &found, none);
        hits[i] = world_hit(group, found);
    }
}

void TwoLevel::closest_in_world(const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const {
    const Group& group = *world_group();
    bool interleave =
        group.nodes.size() && group.precision == Precision::WATERTIGHT && rays_are_scattered(rays, count, group.root);
    if (interleave)
        closest_scattered(group, rays, ray_kinds, hits, count);
    else
        closest_together(group, rays, ray_kinds, hits, count);
}

// ask(i) of each valid ray that may meet an entry; end(i): how far it goes.
template <class End, class Ask>
void TwoLevel::ask_after_world(const Ray* rays, u32 count, End&& end, Ask&& ask) const {
    u32 towards[BATCH];
    const u32 found = apart_ ? rays_towards(*apart_, rays, count, towards, end) : every(count, towards);
    for (u32 k = 0; k < found; ++k)
        if (ray_is_valid(rays[towards[k]])) ask(towards[k]);
}

// Nothing behind what a ray met in the world can matter.
void TwoLevel::closest_after_world(const Ray* rays, const u32* ray_kinds, const float* times, Hit* hits,
                                   u32 count) const {
    NoCounters none;
    auto end = [&](u32 i) { return hits[i].t; };
    ask_after_world(rays, count, end, [&](u32 i) {
        Hit& best = hits[i];
        if (best.prim == NONE) best.t = min_f(rays[i].t_max, LARGEST_DISTANCE);
        closest_in_entries(rays[i], kinds_at(ray_kinds, i), time_at(times, i), &best, none);
        if (best.prim == NONE) best.t = INFINITE_DISTANCE;
    });
}

void TwoLevel::any_in_world(const Ray* rays, const u32* ray_kinds, u8* blocked, u32 count) const {
    const Group& group = *world_group();
    NoCounters none;
    for (u32 i = 0; i < count; ++i) {
        blocked[i] = BLOCKED_NOT;
        if (meets_world(rays[i], kinds_at(ray_kinds, i)))
            blocked[i] = any_in_group(group, lane_ray(rays[i]), max_f(rays[i].t_min, 0.0f),
                                      min_f(rays[i].t_max, LARGEST_DISTANCE), none);
    }
}

void TwoLevel::any_after_world(const Ray* rays, const u32* ray_kinds, const float* times, u8* blocked,
                               u32 count) const {
    NoCounters none;
    auto end = [](u32) { return INFINITE_DISTANCE; };
    ask_after_world(rays, count, end, [&](u32 i) {
        if (blocked[i] == BLOCKED_OPAQUE) return;
        if (u8 rest = any_in_entries(rays[i], kinds_at(ray_kinds, i), time_at(times, i), none)) blocked[i] = rest;
    });
}

void TwoLevel::closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, const float* times,
                       Counters* counters) const {
    auto one_by_one = [&](auto& kept) {
        for (size_t i = 0; i < count; ++i)
            closest_one(rays[i], kinds_at(ray_kinds, i), time_at(times, i), hits + i, kept);
    };
    NoCounters none;
    if (counters) return one_by_one(*counters);
    if (!world_group()) return one_by_one(none);
    // What moves comes after what stands still, which is found as if nothing moved.
    in_batches(count, [&](size_t first, u32 size) {
        const u32* kinds = from(ray_kinds, first);
        closest_in_world(rays + first, kinds, hits + first, size);
        if (entries_.size()) closest_after_world(rays + first, kinds, from(times, first), hits + first, size);
    });
}

void TwoLevel::any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, const float* times,
                   Counters* counters) const {
    auto one_by_one = [&](auto& kept) {
        for (size_t i = 0; i < count; ++i)
            blocked[i] = any_one(rays[i], kinds_at(ray_kinds, i), time_at(times, i), kept);
    };
    NoCounters none;
    if (counters) return one_by_one(*counters);
    if (!world_group()) return one_by_one(none);
    in_batches(count, [&](size_t first, u32 size) {
        const u32* kinds = from(ray_kinds, first);
        any_in_world(rays + first, kinds, blocked + first, size);
        if (entries_.size()) any_after_world(rays + first, kinds, from(times, first), blocked + first, size);
    });
}

}  // namespace luch::cpu
