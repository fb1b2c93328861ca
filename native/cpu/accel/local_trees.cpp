#include "cpu/accel/local_trees.h"

#include <stdexcept>

#include "cpu/accel/traverse.h"

namespace luch::cpu {

LocalTrees::LocalTrees(const SceneView& scene, const std::vector<u8>& wanted, Precision precision, bool for_device,
                       ThreadPool& pool) {
    AccelChoice choice;
    choice.precision = precision;
    choice.wide = !for_device;
    choice.kind = StructureKind::CWBVH;
    std::vector<u32> group_of(scene.mesh_count, NONE);
    entries_.assign(scene.instance_count, {{}, NONE, 0u});
    for (u32 i = 0; i < scene.instance_count; ++i) {
        u32 mesh = scene.instances[i].mesh;
        if (!wanted[i] || scene.meshes[mesh].triangle_count == 0) continue;
        if (group_of[mesh] == NONE) {
            group_of[mesh] = u32(groups_.size());
            groups_.emplace_back().members = {{mesh, NONE, 0, 0, scene.meshes[mesh].triangle_count}};
            groups_.back().deforms = (scene.instances[i].flags & INSTANCE_DEFORMS) != 0u;
        }
        u32 tree = group_of[mesh];
        entries_[i] = {scene.instances[i].to_object, tree, motion_.add(scene, i, groups_[tree].deforms ? tree : NONE)};
    }
    for (Group& group : groups_) {
        build_group(group, scene, {}, choice, pool);
        bytes_ += group.nodes.bytes() + group.blocks.bytes() + (group.moving ? group.moving->bytes() : 0);
    }
    for (LocalTreeEntry& entry : entries_)
        if (entry.tree != NONE && groups_[entry.tree].kept == 0) entry.tree = NONE;
    motion_.finish(groups_);
    bytes_ += entries_.size() * sizeof(LocalTreeEntry) + motion_.bytes();
    if (for_device) keep_views();
}

void LocalTrees::keep_views() {
    for (Group& group : groups_) {
        trees_.emplace_back();
        if (group.kept == 0 || group.moving) continue;
        size_t bytes = 0;
        trees_.back() = *static_cast<const Cwbvh*>(group.structure->view(&bytes));
        StructureStats stats = group.structure->stats();
        bytes_ += stats.bytes;
        if (stats.depth >= CWBVH_MAX_DEPTH) throw std::length_error("A mesh's wide tree is too deep.");
        group.corners = {};  // the tree's leaves hold them
    }
    view_ = {entries_.data(), trees_.data(), motion_.moves() ? &motion_.view : nullptr};
}

void LocalTrees::describe(DeviceImage& image, u32 block, const LocalTreesView* const& pointer) const {
    u32 view = image.add_array("local trees", block, pointer, 1);
    image.add_array("local entries", view, pointer->entries, entries_.size());
    u32 trees = image.add_array("local roots", view, pointer->trees, trees_.size());
    for (size_t g = 0; g < groups_.size(); ++g) {
        if (groups_[g].kept == 0 || groups_[g].moving) continue;
        for (const StructureArray& array : groups_[g].structure->arrays()) {
            u32 target = image.add(array.name, array.data, array.bytes);
            image.links.push_back({trees, g * sizeof(Cwbvh) + array.view_offset, target, 0});
        }
    }
    if (pointer->motion) motion_.describe(image, view, pointer->motion, groups_);
}

Hit LocalTrees::closest(u32 instance, const Ray& ray, float time) const {
    Hit miss = no_scene_hit();
    const LocalTreeEntry& entry = entries_[instance];
    Ray inside;
    if (!enter_local(entry, &motion_.view, ray, time, &inside)) return miss;
    const Group& group = groups_[entry.tree];
    RefHit hit = {min_f(ray.t_max, LARGEST_DISTANCE), NONE, 0.0f, 0.0f};
    NoCounters none;
    if (group.moving)
        closest_in_moving(group, lane_ray(inside), max_f(ray.t_min, 0.0f), time, &hit, none);
    else
        closest_in_group(group, lane_ray(inside), max_f(ray.t_min, 0.0f), &hit, none);
    if (hit.ref == NONE) return miss;
    return {hit.t, group.member_of(hit.ref).prim_of(hit.ref), instance, hit.u, hit.v};
}

}  // namespace luch::cpu
