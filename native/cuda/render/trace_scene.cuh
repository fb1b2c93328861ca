// Scenes of many groups: as the persistent walk of one tree (rays/persistent.cuh), but what the top's leaves hold is
// entered, and left when the stack is down to what waits at the top. Where a group stands apart in the world,
// trace_one.cuh came before: its results are what there is to improve on.
#pragma once
#include "rays/persistent.cuh"
#include "render/trace.cuh"

namespace luch {

struct SceneRays {
    const TwoLevelView<Cwbvh>& scene;
    const TraceTask& task;
};

// After the kernel of what stands still: those rays that it has left for this one, by the next of the task's counters.
__device__ __forceinline__ bool comes_after(const SceneRays& rays) {
    return plan::MOTION && rays.scene.world_visibility != 0u;
}
__device__ __forceinline__ u32 ray_count(const SceneRays& rays) {
    return comes_after(rays) ? near_count(rays.task) : ray_count(rays.task);
}
__device__ __forceinline__ u32* next_ray(const SceneRays& rays) { return rays.task.next + comes_after(rays); }

template <Precision P>
struct SceneAside : RayClock {
    PrimitiveRay<P> tested;  // in the group's space
    RefHit best;
    float t_min;
    u32 index, kinds;
    u32 entry, best_entry;   // of the top's leaves: the one that the ray is in, and that of best
    u32 unused;
    const LeafPrimitive* leaves;  // of the group
};

__device__ __forceinline__ Hit hit_of_entry(const TwoLevelView<Cwbvh>& scene, u32 index, const RefHit& hit) {
    const GroupEntry& entry = scene.top.leaves[index];
    return hit_in_scene(scene.groups[entry.group], entry.instance, hit);
}

// Apart, so that their stacks and registers burden no other ray.
template <Precision P>
__device__ __noinline__ RefHit closest_moving(const MovingGroup& moving, const Ray& inside, float time, float t_max) {
    NoCounters none;
    RefHit found = {t_max, NONE, 0.0f, 0.0f};
    closest_hit<P>(moving, inside, time, &found, none);
    return found;
}
template <Precision P>
__device__ __noinline__ u8 any_moving(const MovingGroup& moving, const Ray& inside, float time) {
    NoCounters none;
    return any_hit<P>(moving, inside, time, none);
}

template <Precision P, bool ANY>
struct SceneWalker {
    using Kept = SceneAside<P>;
    Kept* aside;
    WideRay wide;
    float last;
    WaitingGroup group;
    const CwbvhNode* nodes;  // of the tree that the ray is in
    u32 below;               // entries of the stack that wait at the top; NONE: the ray is there
    u8 blocked;
    bool busy;

    __device__ __forceinline__ void begin(const SceneRays& rays, u32 fetched, SplitStack* stack) {
        u32 i = comes_after(rays) ? near_ray(rays.task, fetched) : fetched;
        Ray ray = ray_of(rays.task, i);
        aside->start();
        busy = clamp_interval(&ray) && rays.scene.top.node_count != 0;
        aside->index = i;
        aside->best = {ray.t_max, NONE, 0.0f, 0.0f};
        blocked = BLOCKED_NOT;
        if (!busy) return finish(rays);
        if (comes_after(rays)) begin_after_world(rays, i);
        if (!busy) return;
        if (passes_movers_by(rays.scene, ray, aside->best.t)) return finish(rays);
        aside->t_min = ray.t_min;
        aside->kinds = kinds_of(rays.task, i);
        aside->tested.direction = ray.direction;  // for go_together
        stack->size = 0;
        go_to_top(rays.scene, ray);
        group = {0, 0x80000000u};
    }
    // Nothing of the top can matter behind what the ray met in the world; most rays pass the top by.
    __device__ __forceinline__ void begin_after_world(const SceneRays& rays, u32 i) {
        if constexpr (ANY) {
            blocked = rays.task.blocked[i];
            busy = blocked != BLOCKED_OPAQUE;
        } else if (rays.task.hits[i].prim != NONE) {
            aside->best.t = rays.task.hits[i].t;
        }
    }
    __device__ __forceinline__ void finish(const SceneRays& rays) {
        busy = false;
        bool after_world = comes_after(rays);
        aside->stop(rays, aside->index, after_world);
        if constexpr (ANY) {
            rays.task.blocked[aside->index] = blocked;
            return;
        }
        RefHit best = aside->best;
        if (best.ref == NONE) {
            if (!after_world) rays.task.hits[aside->index] = no_scene_hit();
            return;
        }
        Hit hit = hit_of_entry(rays.scene, aside->best_entry, best);
        if (!after_world || comes_first(hit, rays.task.hits[aside->index])) rays.task.hits[aside->index] = hit;
    }
    __device__ __forceinline__ void go_to_top(const TwoLevelView<Cwbvh>& scene, const Ray& ray) {
        nodes = scene.top.nodes;
        below = NONE;
        wide = top_ray(scene, ray);
        last = wide.upper(aside->best.t);
    }
    // Goes into the first of the entries that the ray sees; what is left waits.
    __device__ __forceinline__ void enter(const SceneRays& rays, WaitingGroup entries, SplitStack* stack) {
        while (entries.hits != 0) {
            u32 bit = u32(highest_bit(entries.hits));
            entries.hits &= ~(1u << bit);
            const GroupEntry entry = load_quads(rays.scene.top.leaves + entries.first + bit);
            Ray ray = ray_of(rays.task, aside->index), inside;
            ray.t_min = aside->t_min;
            float time = time_of(rays.task, aside->index);
            if (!enter_entry(entry, ray, aside->kinds, aside->best.t, rays.scene.motion, time, &inside)) continue;
            if (const MovingGroup* moving = moving_group_of(rays.scene, entry)) {
                if (meet_moving(rays.scene, *moving, inside, time, entries.first + bit)) {
                    entries.hits = 0;
                    stack->size = 0;
                    group.hits = 0;
                }
                continue;
            }
            if (has_nodes(group)) stack->push(group);
            if (entries.hits != 0) stack->push(entries);
            const Cwbvh& tree = rays.scene.groups[entry.group].structure;
            aside->tested = PrimitiveRay<P>(inside);
            aside->leaves = tree.leaves;
            aside->entry = entries.first + bit;
            nodes = tree.nodes;
            below = stack->size;
            wide = make_wide_ray(inside, tree.root);
            last = wide.upper(aside->best.t);
            group = {0, 0x80000000u};
            return;
        }
    }
    // One that changes its shape is walked at once, by this thread alone; true when nothing else can matter.
    __device__ __forceinline__ bool meet_moving(const TwoLevelView<Cwbvh>& scene, const MovingGroup& moving,
                                                const Ray& inside, float time, u32 entry) {
        if constexpr (ANY) {
            u8 found = any_moving<P>(moving, inside, time);
            if (found) blocked = found;
            return found == BLOCKED_OPAQUE;
        }
        RefHit best = aside->best, found = closest_moving<P>(moving, inside, time, best.t);
        aside->entry = entry;
        if (found.ref == NONE || !is_better(scene, found, best)) return false;
        aside->best = found;
        aside->best_entry = entry;
        last = wide.upper(found.t);
        return false;
    }
    // Visits the next child of the group, or takes its leaves; returns the primitives that the ray may hit.
    __device__ __forceinline__ WaitingGroup visit(const SceneRays& rays, SplitStack* stack) {
        WaitingGroup leaves = group;
        if (has_nodes(group)) {
            u32 bit = u32(highest_bit(group.hits)), place = (bit - 24u) ^ (7u - wide.octant);
            u32 child = group.first + u32(popcount(group.hits & 0xffu & ~(~0u << place)));
            group.hits &= ~(1u << bit);
            if (has_nodes(group)) stack->push(group);
            const CwbvhNode node = load_quads(nodes + child);
            u32 hits = intersect_children(node, wide, last);
            group = {node.first_child, (hits & 0xff000000u) | node.exponents >> 24};
            leaves = {node.first_leaf, hits & 0x00ffffffu};
        } else {
            group.hits = 0;
        }
        if (below != NONE || leaves.hits == 0) return leaves;
        enter(rays, leaves, stack);
        return {0, 0};
    }
    // Tests one of the primitives; true when nothing else can matter.
    __device__ __forceinline__ bool test(const SceneRays& rays, WaitingGroup* leaves) {
        u32 bit = u32(highest_bit(leaves->hits));
        leaves->hits &= ~(1u << bit);
        const LeafPrimitive p = load_quads(aside->leaves + leaves->first + bit);
        NoCounters none;
        TriangleHit hit;
        RefHit best = aside->best;
        // Without curves in the code nothing of this is looked up.
        const CurveSet& curves = rays.scene.groups[rays.scene.top.leaves[aside->entry].group].primitives.curves;
        if (!test_leaf(p, curves, aside->tested, aside->t_min, best.t, &hit, none)) return false;
        if constexpr (ANY) {
            bool maybe = p.flags & PRIMITIVE_MAY_BE_TRANSPARENT;
            blocked = maybe ? u8(BLOCKED_MAYBE) : u8(BLOCKED_OPAQUE);
            return !maybe;
        }
        RefHit found = {hit.t, p.ref, hit.u, hit.v};
        if (!is_better(rays.scene, found, best)) return false;
        aside->best = found;
        aside->best_entry = aside->entry;
        last = wide.upper(hit.t);
        return false;
    }
    // found.t <= best.t.
    __device__ __forceinline__ bool is_better(const TwoLevelView<Cwbvh>& scene, const RefHit& found,
                                              const RefHit& best) const {
        if (found.t < best.t || best.ref == NONE) return true;
        if (aside->entry == aside->best_entry) return found.ref < best.ref;
        return comes_first(hit_of_entry(scene, aside->entry, found), hit_of_entry(scene, aside->best_entry, best));
    }
    // When the group has no more nodes.
    __device__ __forceinline__ void take_waiting(const SceneRays& rays, SplitStack* stack) {
        if (stack->size == 0) return finish(rays);
        if (stack->size == below) {
            Ray ray = ray_of(rays.task, aside->index);
            clamp_interval(&ray);
            go_to_top(rays.scene, ray);
        }
        group = stack->pop();
    }
};

}  // namespace luch
