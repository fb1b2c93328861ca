// Two levels: groups of triangles or spheres, and entries that put a group into the world.
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

u32 kinds_at(const u32* ray_kinds, size_t i) { return ray_kinds ? ray_kinds[i] : u32(RAY_ALL); }

class TwoLevel final : public Accel {
 public:
    TwoLevel(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
             const AccelChoice& choice, u64 flatten_triangles);
    void closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, Counters* counters) const override;
    void any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, Counters* counters) const override;
    AccelStats stats() const override { return stats_; }

 private:
    void build_top(EntryBoxes boxes, ThreadPool& pool);
    void count();
    NodeRay top_ray(Vec3 origin, Vec3 direction, float t_min) const;
    bool enter(const GroupEntry& entry, const Ray& ray, LaneRay* out) const;
    template <class Count>
    void closest_in_entry(const GroupEntry& entry, const Ray& ray, Hit* hit, Count& count) const;
    template <class Count>
    u8 any_in_entry(const GroupEntry& entry, const Ray& ray, Count& count) const;
    template <class Count>
    void closest_one(const Ray& ray, u32 kinds, Hit* best, Count& count) const;
    Hit world_hit(const Group& group, const RefHit& hit) const;
    const Group* only_group() const;
    bool meets_only_group(const Ray& ray, u32 kinds) const;
    void closest_scattered(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const;
    void closest_together(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const;
    template <class Count>
    u8 any_one(const Ray& ray, u32 kinds, Count& count) const;

    std::vector<Group> groups_;
    std::vector<GroupEntry> entries_;
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
    bool search_entries = choice.wide || choice.kind != StructureKind::BRUTE_FORCE;  // the oracle asks them all
    EntryBoxes boxes;
    if (search_entries && plan.entries.size() > 1) boxes = bound_entries(plan, scene);
    groups_ = std::move(plan.groups);
    entries_ = std::move(plan.entries);
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
    stats_.bytes += top_.bytes() + entries_.size() * sizeof(GroupEntry);
    stats_.nodes += top_.size();
    for (const Group& group : groups_) {
        count_primitives(group, &stats_);
        stats_.nodes += group.nodes.size();
        stats_.leaf_blocks += group.blocks.size() + group.sphere_blocks.size();
        stats_.bytes += group.nodes.bytes() + group.blocks.bytes() + group.sphere_blocks.bytes();
        stats_.bytes += group.members.size() * sizeof(Member) + group.flags.size();
        stats_.bytes += (group.corners.size() + group.spheres.size()) * sizeof(float);
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
bool TwoLevel::enter(const GroupEntry& entry, const Ray& ray, LaneRay* out) const {
    if (entry.instance == NONE) {
        *out = lane_ray(ray);
        return true;
    }
    Ray inside;
    bool valid = enter_instance(entry.to_object, ray, &inside);
    *out = lane_ray(inside);
    return valid;
}

template <class Count>
void TwoLevel::closest_in_entry(const GroupEntry& entry, const Ray& ray, Hit* best, Count& count) const {
    LaneRay inside;
    if (!enter(entry, ray, &inside)) return;
    const Group& group = groups_[entry.group];
    RefHit hit = {best->t, NONE, 0.0f, 0.0f};
    closest_in_group(group, inside, max_f(ray.t_min, 0.0f), &hit, count);
    if (hit.ref == NONE) return;
    const Member& member = group.member_of(hit.ref);
    u32 instance = entry.instance == NONE ? member.instance : entry.instance;
    Hit found = {hit.t, member.prim_of(hit.ref), instance, hit.u, hit.v};
    if (comes_first(found, *best)) *best = found;
}

template <class Count>
u8 TwoLevel::any_in_entry(const GroupEntry& entry, const Ray& ray, Count& count) const {
    LaneRay inside;
    if (!enter(entry, ray, &inside)) return BLOCKED_NOT;
    return any_in_group(groups_[entry.group], inside, max_f(ray.t_min, 0.0f), min_f(ray.t_max, LARGEST_DISTANCE),
                        count);
}

template <class Count>
void TwoLevel::closest_one(const Ray& ray, u32 kinds, Hit* best, Count& count) const {
    *best = MISS;
    if (!ray_is_valid(ray)) return;
    best->t = min_f(ray.t_max, LARGEST_DISTANCE);
    auto visit = [&](u32 first, u32 size) {
        for (u32 e = first; e < first + size; ++e)
            if (entries_[e].visibility & kinds) closest_in_entry(entries_[e], ray, best, count);
    };
    auto visit_leaf = [&](u32 leaf) { visit(leaf_first(leaf), leaf_items(leaf)); };
    if (top_.size())
        visit_closest(top_.data(), top_ray(ray.origin, ray.direction, max_f(ray.t_min, 0.0f)), &best->t, visit_leaf,
                      count);
    else
        visit(0, u32(entries_.size()));
    if (best->prim == NONE) best->t = INFINITE_DISTANCE;
}

template <class Count>
u8 TwoLevel::any_one(const Ray& ray, u32 kinds, Count& count) const {
    if (!ray_is_valid(ray)) return BLOCKED_NOT;
    u8 result = BLOCKED_NOT;
    auto visit = [&](u32 first, u32 size) {
        for (u32 e = first; e < first + size && result != BLOCKED_OPAQUE; ++e)
            if (entries_[e].visibility & kinds)
                if (u8 blocked = any_in_entry(entries_[e], ray, count)) result = blocked;
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

// All that there is, where it is one group in the world: its rays need no entries, which cost 4 ns each, and may be
// interleaved.
const Group* TwoLevel::only_group() const {
    return entries_.size() == 1 && entries_[0].instance == NONE ? &groups_[entries_[0].group] : nullptr;
}
bool TwoLevel::meets_only_group(const Ray& ray, u32 kinds) const {
    return (kinds & entries_[0].visibility) && ray_is_valid(ray);
}

void TwoLevel::closest_scattered(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits,
                                 u32 count) const {
    RefHit found[BATCH];
    u32 valid[BATCH] = {}, valid_count = 0;
    for (u32 i = 0; i < count; ++i) {
        found[i] = {min_f(rays[i].t_max, LARGEST_DISTANCE), NONE, 0.0f, 0.0f};
        if (meets_only_group(rays[i], kinds_at(ray_kinds, i))) valid[valid_count++] = i;
    }
    closest_interleaved(group, rays, valid, valid_count, found);
    for (u32 i = 0; i < count; ++i) hits[i] = world_hit(group, found[i]);
}

void TwoLevel::closest_together(const Group& group, const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const {
    NoCounters none;
    for (u32 i = 0; i < count; ++i) {
        RefHit found = {min_f(rays[i].t_max, LARGEST_DISTANCE), NONE, 0.0f, 0.0f};
        if (meets_only_group(rays[i], kinds_at(ray_kinds, i)))
            closest_in_group(group, lane_ray(rays[i]), max_f(rays[i].t_min, 0.0f), &found, none);
        hits[i] = world_hit(group, found);
    }
}

void TwoLevel::closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, Counters* counters) const {
    auto by_entries = [&](auto& kept) {
        for (size_t i = 0; i < count; ++i) closest_one(rays[i], kinds_at(ray_kinds, i), hits + i, kept);
    };
    NoCounters none;
    const Group* only = only_group();
    if (counters) return by_entries(*counters);
    if (!only) return by_entries(none);
    for (size_t first = 0; first < count; first += BATCH) {
        u32 size = u32(std::min<size_t>(BATCH, count - first));
        const u32* kinds = ray_kinds ? ray_kinds + first : nullptr;
        bool interleave = only->nodes.size() && only->precision == Precision::WATERTIGHT &&
                          rays_are_scattered(rays + first, size, only->root);
        if (interleave)
            closest_scattered(*only, rays + first, kinds, hits + first, size);
        else
            closest_together(*only, rays + first, kinds, hits + first, size);
    }
}

void TwoLevel::any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, Counters* counters) const {
    auto by_entries = [&](auto& kept) {
        for (size_t i = 0; i < count; ++i) blocked[i] = any_one(rays[i], kinds_at(ray_kinds, i), kept);
    };
    NoCounters none;
    const Group* only = only_group();
    if (counters) return by_entries(*counters);
    if (!only) return by_entries(none);
    for (size_t i = 0; i < count; ++i) {
        blocked[i] = BLOCKED_NOT;
        if (meets_only_group(rays[i], kinds_at(ray_kinds, i)))
            blocked[i] = any_in_group(*only, lane_ray(rays[i]), max_f(rays[i].t_min, 0.0f),
                                      min_f(rays[i].t_max, LARGEST_DISTANCE), none);
    }
}

}  // namespace

std::unique_ptr<Accel> Accel::build(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                                    const AccelChoice& choice, u64 flatten_triangles) {
    return std::make_unique<TwoLevel>(scene, flags, pool, choice, flatten_triangles);
}

}  // namespace luch::cpu
