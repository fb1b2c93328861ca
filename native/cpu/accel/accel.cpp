// Two levels: groups of triangles or spheres, and entries that put a group into the world.
#include "cpu/accel/accel.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>

#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/group.h"
#include "cpu/accel/interleave.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {
namespace {

constexpr float LARGEST = 3.402823466e+38f;
constexpr Hit MISS = {INFINITE_DISTANCE, NONE, NONE, 0.0f, 0.0f};
constexpr u32 BATCH = 1024;  // rays looked at together
// Groups below this size are built side by side, one thread each.
constexpr u32 SMALL_GROUP_REFS = 65536;

struct Entry {
    Affine to_object;
    u32 group;
    u32 instance;    // NONE: the group is in world space
    u32 visibility;  // RayKind bits
};

// How far a ray seen through an instance may differ from the ray in the world, at a point of size p: the
// origin and direction round in the transform, and to_object is only nearly the inverse of to_world. With
// C = |to_world| |to_object| (largest row sum of the linear parts) each is at most gamma(3) C |p|; three of
// them, doubled for second order terms.
constexpr float INSTANCE_ERROR = 18.0f * EPS;
constexpr float CONDITION_LIMIT = 1000.0f;  // worse instances get wider boxes instead of widening every ray

float row_sum(const Affine& a, int row) {
    return abs_f(a.m[4 * row]) + abs_f(a.m[4 * row + 1]) + abs_f(a.m[4 * row + 2]);
}
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

Box world_box(const Affine& to_world, const Box& box) {
    Box out = empty_box();
    for (int corner = 0; corner < 8; ++corner)
        extend(out, transform_point(to_world, {corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                                               corner & 4 ? box.hi.z : box.lo.z}));
    return out;
}
float size_of(const Box& box) { return max_f(max_component(abs_v(box.lo)), max_component(abs_v(box.hi))); }

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

class TwoLevel final : public Accel {
 public:
    TwoLevel(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
             const AccelChoice& choice, u64 flatten_triangles);
    void closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, Counters* counters) const override;
    void any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, Counters* counters) const override;
    AccelStats stats() const override { return stats_; }

 private:
    void plan(const SceneView& scene, u64 flatten_triangles);
    void add_to_world(const SceneView& scene, u32 instance);
    void add_own_group(const SceneView& scene, u32 instance, const Member& primitives, u32* group);
    void add_entry(const SceneView& scene, u32 instance, u32 group);
    void build_groups(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                      const AccelChoice& choice);
    void build_top(const SceneView& scene, ThreadPool& pool);
    void count();
    NodeRay top_ray(Vec3 origin, Vec3 direction, float t_min) const;
    bool enter(const Entry& entry, const Ray& ray, LaneRay* out) const;
    template <class Count>
    void closest_in_entry(const Entry& entry, const Ray& ray, Hit* hit, Count& count) const;
    template <class Count>
    u8 any_in_entry(const Entry& entry, const Ray& ray, Count& count) const;
    template <class Count>
    Hit closest_one(const Ray& ray, u32 kinds, Count& count) const;
    Hit world_hit(const Group& group, const RefHit& hit) const;
    void closest_scattered(const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const;
    template <class Count>
    u8 any_one(const Ray& ray, u32 kinds, Count& count) const;

    // A group of instances taken to the world.
    struct FlatGroup {
        u32 visibility, group;
        u64 refs;
    };
    std::vector<FlatGroup> flat_;
    std::vector<Group> groups_;
    std::vector<Entry> entries_;
    HugeArray<Node8> top_;  // none: the entries are few, or this is brute force
    Box root_;
    float top_error_scale_ = 0.0f, top_size_ = 0.0f;
    AccelStats stats_;
};

TwoLevel::TwoLevel(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                   const AccelChoice& choice, u64 flatten_triangles) {
    auto start = std::chrono::steady_clock::now();
    if (!flags.empty() && flags.size() != scene.mesh_count)
        throw std::invalid_argument("flags lists " + std::to_string(flags.size()) + " meshes, the scene has " +
                                    std::to_string(scene.mesh_count) + ".");
    plan(scene, flatten_triangles);
    build_groups(scene, flags, pool, choice);
    bool search_entries = choice.wide || choice.kind != StructureKind::BRUTE_FORCE;  // the oracle asks them all
    if (search_entries && entries_.size() > 1) build_top(scene, pool);
    count();
    stats_.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Lists groups and entries.
void TwoLevel::plan(const SceneView& scene, u64 flatten_triangles) {
    std::vector<u8> flatten = meshes_to_flatten(scene, flatten_triangles);
    std::vector<u32> group_of_triangles(scene.mesh_count, NONE), group_of_spheres(scene.mesh_count, NONE);
    for (u32 i = 0; i < scene.instance_count; ++i) {
        const InstanceView& instance = scene.instances[i];
        const MeshView& mesh = scene.meshes[instance.mesh];
        if (instance.visibility == 0) continue;
        if (mesh.triangle_count > 0 && flatten[instance.mesh])
            add_to_world(scene, i);
        else if (mesh.triangle_count > 0)
            add_own_group(scene, i, {instance.mesh, NONE, 0, 0, mesh.triangle_count},
                          &group_of_triangles[instance.mesh]);
        if (mesh.sphere_count > 0)
            add_own_group(scene, i, {instance.mesh, NONE, 0, mesh.triangle_count, mesh.sphere_count},
                          &group_of_spheres[instance.mesh]);
    }
}

void TwoLevel::add_to_world(const SceneView& scene, u32 i) {
    const InstanceView& instance = scene.instances[i];
    u32 triangles = scene.meshes[instance.mesh].triangle_count;
    auto found = std::find_if(flat_.begin(), flat_.end(), [&](const FlatGroup& flat) {
        return flat.visibility == instance.visibility && flat.refs + triangles <= REF_MASK / 2;
    });
    if (found == flat_.end()) {
        found = flat_.insert(found, {instance.visibility, u32(groups_.size()), 0});
        groups_.emplace_back();
        entries_.push_back({{}, found->group, NONE, instance.visibility});
    }
    groups_[found->group].members.push_back({instance.mesh, i, u32(found->refs), 0, triangles});
    found->refs += triangles;
}

// The group of these primitives of a mesh, in the mesh's own space; made for the first instance that asks.
void TwoLevel::add_own_group(const SceneView& scene, u32 i, const Member& primitives, u32* group) {
    if (*group == NONE) {
        *group = u32(groups_.size());
        groups_.emplace_back().members = {primitives};
        groups_.back().of_spheres = primitives.first_prim == scene.meshes[primitives.mesh].triangle_count;
    }
    add_entry(scene, i, *group);
}

void TwoLevel::add_entry(const SceneView& scene, u32 i, u32 group) {
    const InstanceView& instance = scene.instances[i];
    if (!is_finite(instance.to_world) || !is_finite(instance.to_object)) {
        (groups_[group].of_spheres ? stats_.dropped_spheres : stats_.dropped_triangles) +=
            groups_[group].members[0].prim_count;
        return;
    }
    entries_.push_back({instance.to_object, group, i, instance.visibility});
}

void TwoLevel::build_groups(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                            const AccelChoice& choice) {
    std::vector<u32> small;
    for (u32 g = 0; g < groups_.size(); ++g) {
        const Member& last = groups_[g].members.back();
        if (last.first_ref + last.prim_count < SMALL_GROUP_REFS)
            small.push_back(g);
        else
            build_group(groups_[g], scene, flags, choice, pool);
    }
    pool.parallel_for(small.size(), 1, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = begin; i < end; ++i) build_group(groups_[small[i]], scene, flags, choice, pool);
    });
    std::erase_if(entries_, [this](const Entry& entry) { return groups_[entry.group].kept == 0; });
}

void TwoLevel::build_top(const SceneView& scene, ThreadPool& pool) {
    std::vector<Box> boxes(entries_.size());
    for (size_t i = 0; i < entries_.size(); ++i) {
        const Entry& entry = entries_[i];
        const Box& box = groups_[entry.group].root;
        boxes[i] = entry.instance == NONE ? box : world_box(scene.instances[entry.instance].to_world, box);
        top_size_ = max_f(size_of(boxes[i]), top_size_);
        if (entry.instance == NONE) continue;
        const Affine& m = scene.instances[entry.instance].to_world;
        for (int row = 0; row < 3; ++row) top_size_ = max_f(abs_f(m.m[4 * row + 3]), top_size_);
    }
    HugeArray<PrimBox> prims(entries_.size());
    for (size_t i = 0; i < entries_.size(); ++i) {
        float wider = 0.0f, c = entries_[i].instance == NONE ? 1.0f : condition(scene.instances[entries_[i].instance]);
        if (c > CONDITION_LIMIT)
            wider = INSTANCE_ERROR * c * 4.0f * top_size_;  // for origins within thrice the scene's size
        else
            top_error_scale_ = max_f(INSTANCE_ERROR * c, top_error_scale_);
        Vec3 lo = boxes[i].lo - make_vec3(wider), hi = boxes[i].hi + make_vec3(wider);
        prims[i] = {{-lo.x, -lo.y, -lo.z}, u32(i), {hi.x, hi.y, hi.z}, 0};
    }
    Tree8 tree = build_bvh8(std::move(prims), entries_.size(), 1, pool);
    top_ = std::move(tree.nodes);
    root_ = tree.root;
    for (size_t n = 0; n < top_.size(); ++n)
        for (int slot = 0; slot < 8; ++slot) {
            u32 items = top_[n].count[slot];
            if (items) top_[n].child[slot] |= LEAF | ((items - 1) << LEAF_COUNT_SHIFT);
        }
    std::vector<Entry> sorted(entries_.size());
    for (size_t i = 0; i < entries_.size(); ++i) sorted[i] = entries_[tree.order[i]];
    entries_ = std::move(sorted);
}

void TwoLevel::count() {
    stats_.bytes += top_.bytes() + entries_.size() * sizeof(Entry);
    stats_.nodes += top_.size();
    for (const Group& group : groups_) {
        (group.of_spheres ? stats_.spheres : stats_.triangles) += group.kept;
        (group.of_spheres ? stats_.dropped_spheres : stats_.dropped_triangles) += group.dropped;
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
    float error = top_error_scale_ * (3.0f * max_component(abs_v(origin)) + top_size_);
    return NodeRay(make_box_ray(origin, direction, root_, error), t_min);
}

// The ray as the entry's triangles see it; false if the transform leaves no ray.
bool TwoLevel::enter(const Entry& entry, const Ray& ray, LaneRay* out) const {
    if (entry.instance == NONE) {
        *out = lane_ray(ray);
        return true;
    }
    Ray inside = {transform_point(entry.to_object, ray.origin), 0.0f,
                  transform_direction(entry.to_object, ray.direction), LARGEST};
    *out = lane_ray(inside);
    return ray_is_valid(inside);
}

template <class Count>
void TwoLevel::closest_in_entry(const Entry& entry, const Ray& ray, Hit* best, Count& count) const {
    LaneRay inside;
    if (!enter(entry, ray, &inside)) return;
    const Group& group = groups_[entry.group];
    RefHit hit = {best->t, NONE, 0.0f, 0.0f};
    closest_in_group(group, inside, max_f(ray.t_min, 0.0f), &hit, count);
    if (hit.ref == NONE) return;
    const Member& member = group.member_of(hit.ref);
    u32 instance = entry.instance == NONE ? member.instance : entry.instance, prim = member.prim_of(hit.ref);
    bool first_at_t = instance < best->instance || (instance == best->instance && prim < best->prim);
    if (hit.t < best->t || first_at_t) *best = {hit.t, prim, instance, hit.u, hit.v};
}

template <class Count>
u8 TwoLevel::any_in_entry(const Entry& entry, const Ray& ray, Count& count) const {
    LaneRay inside;
    if (!enter(entry, ray, &inside)) return BLOCKED_NOT;
    return any_in_group(groups_[entry.group], inside, max_f(ray.t_min, 0.0f), min_f(ray.t_max, LARGEST), count);
}

template <class Count>
Hit TwoLevel::closest_one(const Ray& ray, u32 kinds, Count& count) const {
    if (!ray_is_valid(ray)) return MISS;
    Hit best = {min_f(ray.t_max, LARGEST), NONE, NONE, 0.0f, 0.0f};
    auto visit = [&](u32 first, u32 size) {
        for (u32 e = first; e < first + size; ++e)
            if (entries_[e].visibility & kinds) closest_in_entry(entries_[e], ray, &best, count);
    };
    auto visit_leaf = [&](u32 leaf) { visit(leaf_first(leaf), leaf_items(leaf)); };
    if (top_.size())
        visit_closest(top_.data(), top_ray(ray.origin, ray.direction, max_f(ray.t_min, 0.0f)), &best.t, visit_leaf,
                      count);
    else
        visit(0, u32(entries_.size()));
    return best.prim == NONE ? MISS : best;
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

// All is one group in the world: its rays can be interleaved.
void TwoLevel::closest_scattered(const Ray* rays, const u32* ray_kinds, Hit* hits, u32 count) const {
    const Group& group = groups_[entries_[0].group];
    RefHit found[BATCH];
    u32 valid[BATCH] = {}, valid_count = 0;
    for (u32 i = 0; i < count; ++i) {
        found[i] = {min_f(rays[i].t_max, LARGEST), NONE, 0.0f, 0.0f};
        bool sees = !ray_kinds || (ray_kinds[i] & entries_[0].visibility);
        if (sees && ray_is_valid(rays[i])) valid[valid_count++] = i;
    }
    closest_interleaved(group, rays, valid, valid_count, found);
    for (u32 i = 0; i < count; ++i) hits[i] = world_hit(group, found[i]);
}

void TwoLevel::closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count, Counters* counters) const {
    auto kinds_of = [&](size_t i) { return ray_kinds ? ray_kinds[i] : u32(RAY_ALL); };
    if (counters) {
        for (size_t i = 0; i < count; ++i) hits[i] = closest_one(rays[i], kinds_of(i), *counters);
        return;
    }
    NoCounters none;
    const Group* one = entries_.size() == 1 && entries_[0].instance == NONE ? &groups_[entries_[0].group] : nullptr;
    for (size_t first = 0; first < count; first += BATCH) {
        u32 size = u32(std::min<size_t>(BATCH, count - first));
        const u32* kinds = ray_kinds ? ray_kinds + first : nullptr;
        if (one && one->nodes.size() && one->precision == Precision::WATERTIGHT &&
            rays_are_scattered(rays + first, size, one->root)) {
            closest_scattered(rays + first, kinds, hits + first, size);
            continue;
        }
        for (size_t i = first; i < first + size; ++i) hits[i] = closest_one(rays[i], kinds_of(i), none);
    }
}

void TwoLevel::any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count, Counters* counters) const {
    auto each = [&](auto& kept) {
        for (size_t i = 0; i < count; ++i) blocked[i] = any_one(rays[i], ray_kinds ? ray_kinds[i] : u32(RAY_ALL), kept);
    };
    NoCounters none;
    if (counters)
        each(*counters);
    else
        each(none);
}

}  // namespace

std::unique_ptr<Accel> Accel::build(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                                    const AccelChoice& choice, u64 flatten_triangles) {
    return std::make_unique<TwoLevel>(scene, flags, pool, choice, flatten_triangles);
}

}  // namespace luch::cpu
