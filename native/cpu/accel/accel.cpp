// Two levels: groups of triangles, spheres or curves, and entries that put a group into the world.
#include "cpu/accel/accel.h"

#include <algorithm>
#include <chrono>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/interleave.h"
#include "cpu/accel/scene_plan.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {
namespace {

constexpr Hit MISS = {INFINITE_DISTANCE, NONE, NONE, 0.0f, 0.0f};
constexpr u32 BATCH = 1024;  // rays looked at together

float time_at(const float* times, size_t i) { return times ? times[i] : SHUTTER_MIDDLE; }
u32 kinds_at(const u32* ray_kinds, size_t i) { return ray_kinds ? ray_kinds[i] : u32(RAY_ALL); }

class TwoLevel final : public Accel {
 public:
    TwoLevel(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
             const AccelChoice& choice, u64 flatten_triangles);
    void closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, const float* times,
                 Counters* counters) const override;
    void any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, const float* times,
             Counters* counters) const override;
    AccelStats stats() const override { return stats_; }

 private:
    void build_top(EntryBoxes boxes, ThreadPool& pool);
    void count();
    NodeRay top_ray(Vec3 origin, Vec3 direction, float t_min) const;
    bool enter(const GroupEntry& entry, const Ray& ray, float time, LaneRay* out) const;
    template <class Count>
    void closest_in_entry(const GroupEntry& entry, const Ray& ray, float time, Hit* hit, Count& count) const;
    template <class Count>
    u8 any_in_entry(const GroupEntry& entry, const Ray& ray, float time, Count& count) const;
    template <class Count>
    void closest_in_entries(const Ray& ray, u32 kinds, float time, Hit* best, Count& count) const;
    template <class Count>
    void closest_one(const Ray& ray, u32 kinds, float time, Hit* best, Count& count) const;
    Hit world_hit(const Group& group, const RefHit& hit) const;
    const Group* world_group() const { return world_.visibility ? &groups_[world_.group] : nullptr; }
    bool meets_world(const Ray& ray, u32 kinds) const { return (kinds & world_.visibility) && ray_is_valid(ray); }
    void closest_in_world(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count) const;
    void closest_scattered(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const;
    void closest_together(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const;
    template <class Count>
    u8 any_in_entries(const Ray& ray, u32 kinds, float time, Count& count) const;
    template <class Count>
    u8 any_one(const Ray& ray, u32 kinds, float time, Count& count) const;

    std::vector<Group> groups_;
    // All that stands still, where it is one group in the world: its rays need no entries, which cost 4 ns each, and may
    // be interleaved. Visibility 0: there is none.
    GroupEntry world_ = {};
    std::vector<GroupEntry> entries_;  // the rest
    SceneMotion motion_;
    HugeArray<Node8> top_;  // none: the entries are few, or this is brute force
    Box root_;
    EntryError error_ = {};
    AccelStats stats_;
};

TwoLevel::TwoLevel(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                   const AccelChoice& choice, u64 flatten_triangles) {
    auto start = std::chrono::steady_clock::now();
    ScenePlan plan = plan_scene(scene, flatten_triangles);
    build_groups(plan, scene, flags, choice, pool);
    stats_.dropped_triangles = plan.dropped_triangles;
    stats_.dropped_spheres = plan.dropped_spheres;
    stats_.dropped_pieces = plan.dropped_pieces;
    bool search_entries = choice.wide || choice.kind != StructureKind::BRUTE_FORCE;  // the oracle asks them all
    world_ = take_world_apart(plan);
    EntryBoxes boxes;
    // One that moves has a box all the same: many rays pass it by, and its transform is dear.
    if (search_entries && plan.entries.size() > (plan.motion.moves() ? 0u : 1u)) boxes = bound_entries(plan, scene);
    groups_ = std::move(plan.groups);
    entries_ = std::move(plan.entries);
    motion_ = std::move(plan.motion);
    if (boxes.boxes.size()) build_top(std::move(boxes), pool);
    count();
    stats_.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void TwoLevel::build_top(EntryBoxes boxes, ThreadPool& pool) {
    error_ = boxes.error;
    Tree8 tree = build_bvh8(std::move(boxes.boxes), entries_.size(), 1, pool);
    top_ = std::move(tree.nodes);
    root_ = tree.root;
    for (size_t n = 0; n < top_.size(); ++n)
        for (int slot = 0; slot < 8; ++slot) {
            u32 items = top_[n].count[slot];
            if (items) top_[n].child[slot] |= LEAF | ((items - 1) << LEAF_COUNT_SHIFT);
        }
    std::vector<GroupEntry> sorted(entries_.size());
    for (size_t i = 0; i < entries_.size(); ++i) sorted[i] = entries_[tree.order[i]];
    entries_ = std::move(sorted);
}

void TwoLevel::count() {
    stats_.bytes += top_.bytes() + (entries_.size() + (world_.visibility ? 1 : 0)) * sizeof(GroupEntry);
    stats_.bytes += motion_.bytes();
    stats_.nodes += top_.size();
    for (const Group& group : groups_) {
        count_primitives(group, &stats_);
        stats_.nodes += group.nodes.size();
        stats_.leaf_blocks += group.blocks.size() + group.sphere_blocks.size() + group.curve_blocks.size();
        stats_.bytes +=
            group.nodes.bytes() + group.blocks.bytes() + group.sphere_blocks.bytes() + group.curve_blocks.bytes();
        stats_.bytes += group.members.size() * sizeof(Member) + group.flags.size();
        stats_.bytes +=
            (group.corners.size() + group.spheres.size() + group.curve_points.size() + group.curve_segments.size()) *
            sizeof(float);
        if (group.moving) {
            stats_.nodes += group.moving->nodes();
            stats_.bytes += group.moving->bytes();
        }
        if (!group.structure) continue;
        StructureStats own = group.structure->stats();
        stats_.nodes += own.nodes;
        stats_.bytes += own.bytes;
    }
}

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
    if (top_.size())
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
    closest_in_entries(ray, kinds, time, best, count);
    if (best->prim == NONE) best->t = INFINITE_DISTANCE;
}

template <class Count>
u8 TwoLevel::any_one(const Ray& ray, u32 kinds, float time, Count& count) const {
    if (!ray_is_valid(ray)) return BLOCKED_NOT;
    u8 result = BLOCKED_NOT;
    if (world_.visibility & kinds) result = any_in_entry(world_, ray, time, count);
    if (result == BLOCKED_OPAQUE) return result;
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
    if (top_.size())
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

void TwoLevel::closest_in_world(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count) const {
    const Group& group = *world_group();
    for (size_t first = 0; first < count; first += BATCH) {
        u32 size = u32(std::min<size_t>(BATCH, count - first));
        const u32* kinds = ray_kinds ? ray_kinds + first : nullptr;
        bool interleave = group.nodes.size() && group.precision == Precision::WATERTIGHT &&
                          rays_are_scattered(rays + first, size, group.root);
        if (interleave)
            closest_scattered(group, rays + first, kinds, hits + first, size);
        else
            closest_together(group, rays + first, kinds, hits + first, size);
    }
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
    closest_in_world(rays, ray_kinds, hits, count);
    if (entries_.empty()) return;
    // What moves comes after what stands still, which is found as if nothing moved.
    for (size_t i = 0; i < count; ++i) {
        if (!ray_is_valid(rays[i])) continue;
        Hit& best = hits[i];
        if (best.prim == NONE) best.t = min_f(rays[i].t_max, LARGEST_DISTANCE);
        closest_in_entries(rays[i], kinds_at(ray_kinds, i), time_at(times, i), &best, none);
        if (best.prim == NONE) best.t = INFINITE_DISTANCE;
    }
}

void TwoLevel::any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, const float* times,
                   Counters* counters) const {
    auto one_by_one = [&](auto& kept) {
        for (size_t i = 0; i < count; ++i)
            blocked[i] = any_one(rays[i], kinds_at(ray_kinds, i), time_at(times, i), kept);
    };
    NoCounters none;
    const Group* world = world_group();
    if (counters) return one_by_one(*counters);
    if (!world || !entries_.empty()) return one_by_one(none);
    for (size_t i = 0; i < count; ++i) {
        blocked[i] = BLOCKED_NOT;
        if (meets_world(rays[i], kinds_at(ray_kinds, i)))
            blocked[i] = any_in_group(*world, lane_ray(rays[i]), max_f(rays[i].t_min, 0.0f),
                                      min_f(rays[i].t_max, LARGEST_DISTANCE), none);
    }
}

}  // namespace

std::unique_ptr<Accel> Accel::build(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                                    const AccelChoice& choice, u64 flatten_triangles) {
    return std::make_unique<TwoLevel>(scene, flags, pool, choice, flatten_triangles);
}

}  // namespace luch::cpu
