#include "cpu/accel/accel.h"

#include <chrono>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/two_level.h"

namespace luch::cpu {

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
    if (top_.size() && world_.visibility) apart_ = make_pass_box(root_, error_);
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

std::unique_ptr<Accel> Accel::build(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                                    const AccelChoice& choice, u64 flatten_triangles) {
    return std::make_unique<TwoLevel>(scene, flags, pool, choice, flatten_triangles);
}

}  // namespace luch::cpu
