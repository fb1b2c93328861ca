// Two levels: groups of triangles, spheres or curves, and entries that put a group into the world.
#pragma once
#include <optional>

#include "cpu/accel/accel.h"
#include "cpu/accel/apart.h"
#include "cpu/accel/scene_plan.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {

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
    void closest_in_world(const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const;
    bool alone() const { return apart_ && entries_.size() == 1; }  // its box was asked before
    bool passes_entries_by(const Ray& ray, float t_max) const {
        return apart_ && passes_by(*apart_, ray.origin, ray.direction, max_f(ray.t_min, 0.0f), t_max);
    }
    template <class End, class Ask>
    void ask_after_world(const Ray* rays, u32 count, End&& end, Ask&& ask) const;
    void closest_after_world(const Ray* rays, const u32* ray_kinds, const float* times, Hit* hits, u32 count) const;
    void any_in_world(const Ray* rays, const u32* ray_kinds, u8* blocked, u32 count) const;
    void any_after_world(const Ray* rays, const u32* ray_kinds, const float* times, u8* blocked, u32 count) const;
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
    std::optional<PassBox> apart_;  // of all entries, where they stand apart from the world
    AccelStats stats_;
};

}  // namespace luch::cpu
