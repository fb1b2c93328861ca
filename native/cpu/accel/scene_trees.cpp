#include "cpu/accel/scene_trees.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "cpu/accel/build_cwbvh.h"
#include "cpu/accel/scene_plan.h"
#include "luch/accel/brute_force.h"
#include "luch/accel/bvh2.h"
#include "luch/accel/bvh2_stackless.h"
#include "luch/accel/grid.h"
#include "luch/accel/hierarchical_grid.h"
#include "luch/accel/kd_tree.h"
#include "luch/accel/two_level.h"

namespace luch::cpu {
namespace {

// Visiting an entry is a transform and a walk of its own: an entry a leaf.
constexpr Collapse::Costs TOP_COSTS = {1.0f, 4.0f, 1};
constexpr size_t SMALL_ARRAY = 1 << 16;  // bytes; smaller ones are uploaded together
constexpr u32 GROUPS_BLOCK = 1;          // of an image, counted from the view's
constexpr size_t ALIGNMENT = 256;        // of each in the common block

// Arrays that are uploaded in one piece: a scene may have thousands of small groups.
class CommonBlock {
 public:
    size_t add(const void* data, size_t bytes) {
        size_t at = (bytes_.size() + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
        bytes_.resize(at + bytes);
        if (bytes) std::copy_n(static_cast<const u8*>(data), bytes, bytes_.data() + at);
        return at;
    }
    const std::vector<u8>& bytes() const { return bytes_; }

 private:
    std::vector<u8> bytes_;
};

template <class View>
constexpr bool OWNS_PRIMITIVES = std::is_same_v<View, Cwbvh>;

// One array of a group, and where its pointer lies in TracedGroup.
struct GroupArray {
    const char* name;
    u32 group;
    size_t field;
    const void* data;
    size_t bytes;
    size_t common_at;  // in the common block, if small
};

template <class View>
class SceneTreesOf final : public SceneTrees {
    using Traced = TracedGroup<View>;

 public:
    SceneTreesOf(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                 const AccelChoice& choice, u64 flatten_triangles)
        : kind_(choice.kind), precision_(choice.precision) {
        auto start = std::chrono::steady_clock::now();
        ScenePlan plan = plan_scene(scene, flatten_triangles);
        build_groups(plan, scene, flags, choice, pool);
        GroupEntry world = take_world_apart(plan);
        if (!plan.entries.empty()) build_top(plan, scene, pool);
        groups_ = std::move(plan.groups);
        motion_ = std::move(plan.motion);
        if (motion_.moves()) view_.motion = &motion_.view;
        for (u32 g = 0; g < groups_.size(); ++g) trace_group(g);
        view_.groups = traced_.data();
        view_.group_count = u32(traced_.size());
        if (world.visibility != 0) {
            world_group_ = world.group;
            view_.world = traced_[world_group_];
            view_.world_visibility = world.visibility;
        }
        count(plan);
        if (OWNS_PRIMITIVES<View> && stats_.depth >= CWBVH_MAX_DEPTH)
            throw std::length_error("The scene's wide trees are too deep.");
        for (GroupArray& array : arrays_)
            if (array.bytes <= SMALL_ARRAY) array.common_at = common_.add(array.data, array.bytes);
        stats_.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }

    u32 append(DeviceImage& image) const override {
        u32 root = image.add("scene trees", &view_, sizeof(view_));
        u32 groups = image.add_array("groups", root, view_.groups, traced_.size());
        image.add_array("top nodes", root, view_.top.nodes, top_nodes_.size());
        image.add_array("entries", root, view_.top.leaves, entries_.size());
        u32 common = image.add("small arrays", common_.bytes().data(), common_.bytes().size());
        for (const GroupArray& array : arrays_) {
            bool small = array.bytes <= SMALL_ARRAY;
            u32 target = small ? common : image.add(array.name, array.data, array.bytes);
            size_t at = small ? array.common_at : 0;
            if (array.bytes == 0) continue;  // its pointer stays what it is: null, or never read
            image.links.push_back({groups, array.group * sizeof(Traced) + array.field, target, at});
            if (has_world_apart() && array.group == world_group_)
                image.links.push_back({root, offsetof(TwoLevelView<View>, world) + array.field, target, at});
        }
        if (view_.motion) motion_.describe(image, root, view_.motion, groups_);
        return root;
    }

    std::vector<LeftGroup> left_groups() const override {
        std::vector<LeftGroup> out;
        for (u32 g = 0; g < groups_.size(); ++g) {
            const Group& group = groups_[g];
            if (!group.left) continue;
            const u8* flags = group.flags.empty() ? nullptr : group.flags.data();
            out.push_back({group.corners.data(), group.corners.size() / 9, flags, {}});
            out.back().places.push_back({GROUPS_BLOCK, g * sizeof(Traced) + offsetof(Traced, structure)});
            if (has_world_apart() && g == world_group_)
                out.back().places.push_back({0, offsetof(TwoLevelView<View>, world) + offsetof(Traced, structure)});
        }
        return out;
    }

    bool has_world_apart() const override { return view_.world_visibility != 0; }
    bool is_one_group() const override { return has_world_apart() && entries_.empty(); }
    bool moves() const override { return motion_.moves(); }
    StructureKind kind() const override { return kind_; }
    SceneTreesStats stats() const override { return stats_; }

    void closest(const Ray* rays, const u32* kinds, Hit* hits, size_t count, const float* times) const override {
        with_precision(precision_, [&]<Precision P>() {
            for (size_t i = 0; i < count; ++i)
                hits[i] =
                    closest_hit<P>(view_, rays[i], kinds ? kinds[i] : u32(RAY_ALL), times ? times[i] : SHUTTER_MIDDLE);
        });
    }
    void any(const Ray* rays, const u32* kinds, u8* blocked, size_t count, const float* times) const override {
        with_precision(precision_, [&]<Precision P>() {
            for (size_t i = 0; i < count; ++i)
                blocked[i] =
                    any_hit<P>(view_, rays[i], kinds ? kinds[i] : u32(RAY_ALL), times ? times[i] : SHUTTER_MIDDLE);
        });
    }

 private:
    template <class Run>
    static void with_precision(Precision precision, Run&& run) {
        if (precision == Precision::FAST) return run.template operator()<Precision::FAST>();
        if (precision == Precision::DOUBLE) return run.template operator()<Precision::DOUBLE>();
        run.template operator()<Precision::WATERTIGHT>();
    }

    void build_top(const ScenePlan& plan, const SceneView& scene, ThreadPool& pool) {
        EntryBoxes entries = bound_entries(plan, scene);
        Tree2 tree = build_tree2_binned(std::move(entries.boxes), plan.entries.size(), 1, HALVING_LEVEL, pool);
        CwbvhNodes wide = build_cwbvh_nodes(tree, TOP_COSTS, pool);
        top_nodes_ = std::move(wide.nodes);
        for (u32 entry : wide.refs) entries_.push_back(plan.entries[entry]);
        view_.top = {top_nodes_.data(), entries_.data(), tree.root, u32(top_nodes_.size()), wide.depth};
        view_.error = entries.error;
    }

    void trace_group(u32 g) {
        Group& group = groups_[g];
        Traced traced = {};
        traced.members = group.members.data();
        traced.member_count = u32(group.members.size());
        note(g, "members", offsetof(Traced, members), group.members);
        if (group.structure) {
            size_t bytes = 0;
            traced.structure = *static_cast<const View*>(group.structure->view(&bytes));
            for (const StructureArray& a : group.structure->arrays())
                arrays_.push_back({a.name, g, offsetof(Traced, structure) + a.view_offset, a.data, a.bytes, 0});
        }
        if (OWNS_PRIMITIVES<View> && !group.left) {
            group.corners = group.spheres = {};
            group.flags = {};
        } else if (!OWNS_PRIMITIVES<View>) {
            traced.primitives = {group.corners.data(),
                                 group.spheres.data(),
                                 group.flags.empty() ? nullptr : group.flags.data(),
                                 u32(group.corners.size() / 9),
                                 u32(group.spheres.size() / 4),
                                 {}};
            note(g, "corners", offsetof(Traced, primitives) + offsetof(Primitives, corners), group.corners);
            note(g, "spheres", offsetof(Traced, primitives) + offsetof(Primitives, spheres), group.spheres);
            note(g, "flags", offsetof(Traced, primitives) + offsetof(Primitives, flags), group.flags);
        }
        if (group.kind == GroupKind::CURVES) trace_curves(g, &traced);
        traced_.push_back(traced);
    }
    void trace_curves(u32 g, Traced* traced) {
        const Group& group = groups_[g];
        constexpr size_t field = offsetof(Traced, primitives) + offsetof(Primitives, curves);
        traced->primitives.curves = group.curves;
        note(g, "curve points", field + offsetof(CurveSet, points), group.curve_points);
        note(g, "curve segments", field + offsetof(CurveSet, segments), group.curve_segments);
    }
    template <class T>
    void note(u32 group, const char* name, size_t field, const std::vector<T>& array) {
        arrays_.push_back({name, group, field, array.data(), array.size() * sizeof(T), 0});
    }

    void count(const ScenePlan& plan) {
        stats_.dropped_triangles = plan.dropped_triangles;
        stats_.dropped_spheres = plan.dropped_spheres;
        stats_.dropped_pieces = plan.dropped_pieces;
        stats_.groups = groups_.size();
        stats_.entries = plan.entries.size();
        stats_.nodes = top_nodes_.size();
        stats_.bytes = traced_.size() * sizeof(Traced) + top_nodes_.size() * sizeof(CwbvhNode) +
                       entries_.size() * sizeof(GroupEntry);
        for (const GroupArray& array : arrays_) stats_.bytes += array.bytes;
        u32 deepest = 0;
        for (const Group& group : groups_) {
            count_primitives(group, &stats_);
            if (group.moving) {
                stats_.nodes += group.moving->nodes();
                stats_.bytes += group.moving->bytes();
            }
            if (!group.structure) continue;
            StructureStats own = group.structure->stats();
            stats_.nodes += own.nodes;
            deepest = std::max(deepest, own.depth);
        }
        stats_.depth = view_.top.depth + deepest;
    }

    StructureKind kind_;
    Precision precision_;
    std::vector<Group> groups_;
    std::vector<Traced> traced_;
    std::vector<CwbvhNode> top_nodes_;
    std::vector<GroupEntry> entries_;  // leaf by leaf
    std::vector<GroupArray> arrays_;
    CommonBlock common_;
    SceneMotion motion_;
    u32 world_group_ = 0;
    TwoLevelView<View> view_ = {};
    SceneTreesStats stats_;
};

}  // namespace

std::unique_ptr<SceneTrees> SceneTrees::build(const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                                              ThreadPool& pool, const AccelChoice& asked, u64 flatten_triangles) {
    AccelChoice choice = asked;
    if (choice.wide) choice.kind = StructureKind::CWBVH;
    choice.wide = false;
    if (choice.kind != StructureKind::CWBVH) choice.leave_from = ~u64(0);  // devices build no other
    auto make = [&]<class View>() -> std::unique_ptr<SceneTrees> {
        return std::make_unique<SceneTreesOf<View>>(scene, flags, pool, choice, flatten_triangles);
    };
    switch (choice.kind) {
        case StructureKind::BRUTE_FORCE:
            return make.operator()<BruteForce>();
        case StructureKind::GRID:
            return make.operator()<Grid>();
        case StructureKind::HIERARCHICAL_GRID:
            return make.operator()<HierarchicalGrid>();
        case StructureKind::BVH2:
            return make.operator()<Bvh2>();
        case StructureKind::BVH2_STACKLESS:
            return make.operator()<Bvh2Stackless>();
        case StructureKind::KD_TREE:
            return make.operator()<KdTree>();
        case StructureKind::CWBVH:
            return make.operator()<Cwbvh>();
    }
    throw std::invalid_argument("This structure is not in this build.");
}

}  // namespace luch::cpu
