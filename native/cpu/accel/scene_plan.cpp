#include "cpu/accel/scene_plan.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "cpu/accel/world_box.h"

namespace luch::cpu {
namespace {

// Groups below this size are built side by side, one thread each.
constexpr u32 SMALL_GROUP_REFS = 65536;

float row_sum(const Affine& a, int row) {
    return abs_f(a.m[4 * row]) + abs_f(a.m[4 * row + 1]) + abs_f(a.m[4 * row + 2]);
}
// instances.h: C.
float condition(const InstanceView& instance) {
    float world = 0.0f, object = 0.0f;
    for (int row = 0; row < 3; ++row) {
        world = max_f(row_sum(instance.to_world, row), world);
        object = max_f(row_sum(instance.to_object, row), object);
    }
    return world * object;
}
bool is_finite(const Affine& a) {
    return std::all_of(std::begin(a.m), std::end(a.m), [](float x) { return finite_f(x); });
}

float size_of(const Box& box) { return max_f(max_component(abs_v(box.lo)), max_component(abs_v(box.hi))); }

// A box that overflowed, or nearly so, becomes everything that builders can take.
Box usable_box(const Box& box) {
    if (point_can_be_traced(box.lo) && point_can_be_traced(box.hi)) return box;
    return {make_vec3(-LARGEST_COORDINATE), make_vec3(LARGEST_COORDINATE)};
}

// Which meshes' instances are all taken to the world: those with one user, then those of fewest copies while
// the budget lasts.
std::vector<u8> meshes_to_flatten(const SceneView& scene, u64 budget) {
    std::vector<u64> users(scene.mesh_count);
    for (u32 i = 0; i < scene.instance_count; ++i) ++users[scene.instances[i].mesh];
    std::vector<u32> order(scene.mesh_count);
    for (u32 m = 0; m < scene.mesh_count; ++m) order[m] = m;
    auto copies = [&](u32 m) { return users[m] * scene.meshes[m].triangle_count; };
    std::stable_sort(order.begin(), order.end(), [&](u32 a, u32 b) { return copies(a) < copies(b); });
    std::vector<u8> flatten(scene.mesh_count);
    u64 taken = 0;
    for (u32 m : order) {
        flatten[m] = users[m] == 1 || taken + copies(m) <= budget;
        if (flatten[m] && users[m] > 1) taken += copies(m);
    }
    return flatten;
}

class Planner {
 public:
    explicit Planner(const SceneView& scene)
        : scene_(scene),
          group_of_triangles_(scene.mesh_count, NONE),
          group_of_spheres_(scene.mesh_count, NONE),
          group_of_curves_(scene.mesh_count, NONE) {}

    // Those taken to the world share a group where they are seen alike and refs suffice.
    void add_to_world(u32 i) {
        const InstanceView& instance = scene_.instances[i];
        u32 triangles = scene_.meshes[instance.mesh].triangle_count;
        auto found = std::find_if(flat_.begin(), flat_.end(), [&](const FlatGroup& flat) {
            return flat.visibility == instance.visibility && flat.refs + triangles <= REF_MASK / 2;
        });
        if (found == flat_.end()) {
            u32 group = u32(plan.groups.size());
            found = flat_.insert(found, {instance.visibility, group, 0});
            plan.groups.emplace_back();
            plan.entries.push_back({{}, group, NONE, instance.visibility, 0u});
        }
        plan.groups[found->group].members.push_back({instance.mesh, i, u32(found->refs), 0, triangles});
        found->refs += triangles;
    }
    void share_triangles(u32 i) {
        u32 mesh = scene_.instances[i].mesh;
        share(i, {mesh, NONE, 0, 0, scene_.meshes[mesh].triangle_count}, GroupKind::TRIANGLES,
              &group_of_triangles_[mesh]);
    }
    void share_spheres(u32 i) {
        u32 mesh = scene_.instances[i].mesh;
        const MeshView& view = scene_.meshes[mesh];
        share(i, {mesh, NONE, 0, view.triangle_count, view.sphere_count}, GroupKind::SPHERES, &group_of_spheres_[mesh]);
    }
    void share_curves(u32 i) {
        u32 mesh = scene_.instances[i].mesh;
        const MeshView& view = scene_.meshes[mesh];
        u32 pieces = piece_count(curves_of(scene_, view));
        share(i, {mesh, NONE, 0, first_piece(view), pieces}, GroupKind::CURVES, &group_of_curves_[mesh]);
    }

    ScenePlan plan;

 private:
    // A group of instances taken to the world.
    struct FlatGroup {
        u32 visibility, group;
        u64 refs;
    };
    static u32 keys_of(const MeshMotion& motion, GroupKind kind) {
        return kind == GroupKind::TRIANGLES ? motion.key_count : kind == GroupKind::CURVES ? motion.curve_key_count : 0;
    }
    // The group of these primitives of a mesh, in the mesh's own space, is made for the first instance that asks.
    void share(u32 i, const Member& primitives, GroupKind kind, u32* group) {
        if (*group == NONE) {
            *group = u32(plan.groups.size());
            Group& made = plan.groups.emplace_back();
            made.members = {primitives};
            made.kind = kind;
            made.deforms = scene_.motion && keys_of(scene_.motion->meshes[primitives.mesh], kind) != 0;
        }
        const InstanceView& instance = scene_.instances[i];
        if (is_finite(instance.to_world) && is_finite(instance.to_object))
            plan.entries.push_back({instance.to_object, *group, i, instance.visibility,
                                    plan.motion.add(scene_, i, plan.groups[*group].deforms ? *group : NONE)});
        else
            (kind == GroupKind::CURVES    ? plan.dropped_pieces
             : kind == GroupKind::SPHERES ? plan.dropped_spheres
                                          : plan.dropped_triangles) += primitives.prim_count;
    }

    const SceneView& scene_;
    std::vector<u32> group_of_triangles_, group_of_spheres_, group_of_curves_;
    std::vector<FlatGroup> flat_;
};

}  // namespace

std::vector<u8> instances_in_world(const SceneView& scene, u64 flatten_triangles) {
    std::vector<u8> flatten = meshes_to_flatten(scene, flatten_triangles), out(scene.instance_count);
    for (u32 i = 0; i < scene.instance_count; ++i) {
        const InstanceView& instance = scene.instances[i];
        out[i] = flatten[instance.mesh] && !(instance.flags & (INSTANCE_MOVES | INSTANCE_DEFORMS));
    }
    return out;
}

ScenePlan plan_scene(const SceneView& scene, u64 flatten_triangles) {
    std::vector<u8> in_world = instances_in_world(scene, flatten_triangles);
    Planner planner(scene);
    for (u32 i = 0; i < scene.instance_count; ++i) {
        const InstanceView& instance = scene.instances[i];
        const MeshView& mesh = scene.meshes[instance.mesh];
        if (instance.visibility == 0) continue;
        if (mesh.triangle_count > 0 && in_world[i])
            planner.add_to_world(i);
        else if (mesh.triangle_count > 0)
            planner.share_triangles(i);
        if (mesh.sphere_count > 0) planner.share_spheres(i);
        if (mesh.segment_count > 0) planner.share_curves(i);
    }
    return std::move(planner.plan);
}

void build_groups(ScenePlan& plan, const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                  const AccelChoice& choice, ThreadPool& pool) {
    if (!flags.empty() && flags.size() != scene.mesh_count)
        throw std::invalid_argument("flags lists " + std::to_string(flags.size()) + " meshes, the scene has " +
                                    std::to_string(scene.mesh_count) + ".");
    std::vector<u32> small;
    for (u32 g = 0; g < plan.groups.size(); ++g) {
        const Member& last = plan.groups[g].members.back();
        if (last.first_ref + last.prim_count < SMALL_GROUP_REFS)
            small.push_back(g);
        else
            build_group(plan.groups[g], scene, flags, choice, pool);
    }
    pool.parallel_for(small.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) build_group(plan.groups[small[i]], scene, flags, choice, pool);
    });
    std::erase_if(plan.entries, [&](const GroupEntry& entry) { return plan.groups[entry.group].kept == 0; });
    plan.motion.finish(plan.groups);
}

void count_primitives(const Group& group, AccelStats* stats) {
    u64 *kept[] = {&stats->triangles, &stats->spheres, &stats->pieces},
        *dropped[] = {&stats->dropped_triangles, &stats->dropped_spheres, &stats->dropped_pieces};
    *kept[size_t(group.kind)] += group.kept;
    *dropped[size_t(group.kind)] += group.dropped;
    stats->duplicates += group.duplicates;
    for (const LeftOut& of_group : group.left_out) add_left_out(of_group, &stats->left_out);
}

GroupEntry take_world_apart(ScenePlan& plan) {
    std::vector<GroupEntry>& entries = plan.entries;
    auto still = [](const GroupEntry& entry) { return entry.motion == 0; };
    auto first = std::find_if(entries.begin(), entries.end(), still);
    if (first == entries.end() || first->instance != NONE) return {};
    if (std::count_if(entries.begin(), entries.end(), still) != 1) return {};
    GroupEntry world = *first;
    entries.erase(first);
    return world;
}

EntryBoxes bound_entries(const ScenePlan& plan, const SceneView& scene) {
    size_t count = plan.entries.size();
    std::vector<Box> boxes(count);
    EntryBoxes out = {HugeArray<PrimBox>(count), {0.0f, 0.0f}};
    for (size_t i = 0; i < count; ++i) {
        const GroupEntry& entry = plan.entries[i];
        const Box& box = plan.groups[entry.group].root;
        boxes[i] = entry.instance == NONE ? box : world_box(scene.instances[entry.instance].to_world, box);
        if (entry.motion) {
            const InstanceMotion& way = plan.motion.entries[entry.motion - 1].transform;
            const TransformKey* keys = plan.motion.keys.data() + way.first_key;
            if (way.key_count) boxes[i] = swept_box(keys, way.key_count, box);
            for (u32 k = 0; k < way.key_count; ++k)
                for (float place : keys[k].place) out.error.size = max_f(abs_f(place), out.error.size);
        }
        out.error.size = max_f(size_of(boxes[i]), out.error.size);
        if (entry.instance == NONE) continue;
        const Affine& m = scene.instances[entry.instance].to_world;
        for (int row = 0; row < 3; ++row) out.error.size = max_f(abs_f(m.m[4 * row + 3]), out.error.size);
    }
    for (size_t i = 0; i < count; ++i) {
        float wider = 0.0f;
        u32 instance = plan.entries[i].instance;
        float c = instance == NONE ? 1.0f : condition(scene.instances[instance]);
        if (u32 motion = plan.entries[i].motion) {
            const InstanceMotion& way = plan.motion.entries[motion - 1].transform;
            c = max_f(c, swept_condition(plan.motion.keys.data() + way.first_key, way.key_count));
        }
        if (c > INSTANCE_CONDITION_WIDENED)
            wider = INSTANCE_ERROR * c * 4.0f * out.error.size;  // for origins within thrice the scene's size
        else
            out.error.scale = max_f(INSTANCE_ERROR * c, out.error.scale);
        Box box = usable_box({boxes[i].lo - make_vec3(wider), boxes[i].hi + make_vec3(wider)});
        out.boxes[i] = {{-box.lo.x, -box.lo.y, -box.lo.z}, u32(i), {box.hi.x, box.hi.y, box.hi.z}, 0};
    }
    return out;
}

}  // namespace luch::cpu
