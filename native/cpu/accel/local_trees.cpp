#include "cpu/accel/local_trees.h"

#include "cpu/accel/traverse.h"

namespace luch::cpu {

LocalTrees::LocalTrees(const SceneView& scene, const std::vector<u8>& wanted, Precision precision, ThreadPool& pool) {
    AccelChoice choice;
    choice.precision = precision;
    std::vector<u32> group_of(scene.mesh_count, NONE);
    entries_.assign(scene.instance_count, {{}, NONE});
    for (u32 i = 0; i < scene.instance_count; ++i) {
        u32 mesh = scene.instances[i].mesh;
        if (!wanted[i] || scene.meshes[mesh].triangle_count == 0) continue;
        if (group_of[mesh] == NONE) {
            group_of[mesh] = u32(groups_.size());
            groups_.emplace_back().members = {{mesh, NONE, 0, 0, scene.meshes[mesh].triangle_count}};
        }
        entries_[i] = {scene.instances[i].to_object, group_of[mesh]};
    }
    for (Group& group : groups_) {
        build_group(group, scene, {}, choice, pool);
        bytes_ += group.nodes.bytes() + group.blocks.bytes();
    }
    for (Entry& entry : entries_)
        if (entry.group != NONE && groups_[entry.group].kept == 0) entry.group = NONE;
    bytes_ += entries_.size() * sizeof(Entry);
}

Hit LocalTrees::closest(u32 instance, const Ray& ray) const {
    Hit miss = no_scene_hit();
    const Entry& entry = entries_[instance];
    Ray inside;
    if (entry.group == NONE || !ray_is_valid(ray) || !enter_instance(entry.to_object, ray, &inside)) return miss;
    const Group& group = groups_[entry.group];
    RefHit hit = {min_f(ray.t_max, LARGEST_DISTANCE), NONE, 0.0f, 0.0f};
    NoCounters none;
    closest_in_group(group, lane_ray(inside), max_f(ray.t_min, 0.0f), &hit, none);
    if (hit.ref == NONE) return miss;
    return {hit.t, group.member_of(hit.ref).prim_of(hit.ref), instance, hit.u, hit.v};
}

}  // namespace luch::cpu
