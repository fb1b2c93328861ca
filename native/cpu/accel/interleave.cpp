#include "cpu/accel/interleave.h"

#include <new>

#include "cpu/accel/leaf.h"
#include "cpu/accel/traverse.h"

namespace luch::cpu {
namespace {

constexpr u32 IN_FLIGHT = 10;
constexpr u32 SAMPLED_PAIRS = 32;
constexpr float FAR_APART = 1.0f / 32.0f;  // of the scene's size

struct Flight {
    NodeRay node;
    BlockRay block;
    u64* top;
    u32 current;
    u32 index;
    u64 stack[STACK_SIZE + 24];  // 24: flights 4 KiB apart would compete for the same sets of the first cache

    Flight(const Group& group, const Ray& ray, u32 index_)
        : node(lane_ray(ray), group.root, max_f(ray.t_min, 0.0f)),
          block(lane_ray(ray), max_f(ray.t_min, 0.0f)),
          top(stack),
          current(0),
          index(index_) {}
};

struct alignas(64) FlightSpace {
    unsigned char bytes[sizeof(Flight)];
};

LUCH_FN void prefetch_child(const Group& group, u32 child) {
    const char* place;
    if (child & LEAF) {
        place = reinterpret_cast<const char*>(group.blocks.data() + leaf_first(child));
    } else {
        place = reinterpret_cast<const char*>(group.nodes.data() + child);
        __builtin_prefetch(place + 192);
    }
    __builtin_prefetch(place);
    __builtin_prefetch(place + 64);
    __builtin_prefetch(place + 128);
}

#if defined(__AVX512F__)
LUCH_FN void order(u64& nearer, u64& farther) {
    u64 a = nearer, b = farther;
    nearer = a < b ? a : b;
    farther = a < b ? b : a;
}

// push_children for a ray that has company: arithmetic where that has branches. The result comes later, but
// nobody waits for it, and a misprediction would throw away the work of all.
LUCH_FN u32 push_in_company(const Node8& node, u32 mask, f8 entry, u64** top_of_stack) {
    using u32x8 = u32 __attribute__((vector_size(32)));
    using u64x8 = u64 __attribute__((vector_size(64)));
    u64x8 distance = __builtin_convertvector(reinterpret_cast<u32x8>(entry), u64x8);
    u64x8 child = __builtin_convertvector(load<u32x8>(node.child), u64x8);
    u64x8 entered = distance << 32 | child;
    alignas(64) u64 keys[8];
    store(keys, _mm512_maskz_compress_epi64(__mmask8(mask), reinterpret_cast<__m512i>(entered)));
    u32 count = u32(__builtin_popcount(mask));
    u64 nearest = keys[0];
    if (count == 1) return u32(nearest);
    u64* own = *top_of_stack;
    u64* top = own;
    u64 second = keys[1];
    order(nearest, second);
    if (count > 2) {
        u64 third = keys[2];
        order(second, third);
        order(nearest, second);
        *top++ = third;
    }
    *top++ = second;
    for (u32 i = 3; i < count; ++i) {
        u64 farther = keys[i];
        order(nearest, farther);
        u64* place = top++;
        for (; place > own && place[-1] < farther; --place) *place = place[-1];
        *place = farther;
    }
    *top_of_stack = top;
    return u32(nearest);
}
#else
LUCH_FN u32 push_in_company(const Node8& node, u32 mask, f8 entry, u64** top_of_stack) {
    return push_children(node, mask, entry, top_of_stack);
}
#endif

// Takes the next entry that is not beyond t_max off the stack; false when there is none.
LUCH_FN bool pop(Flight& flight, float t_max) {
    do {
        if (flight.top == flight.stack) return false;
        --flight.top;
    } while (!(distance_of(*flight.top) <= t_max));
    flight.current = u32(*flight.top);
    return true;
}

// One node or one leaf of one ray; false when the ray is done.
LUCH_FN bool step(const Group& group, Flight& flight, RefHit* best) {
    if (flight.current & LEAF) {
        NoCounters none;
        closest_in_leaf(group, flight.block, flight.current, best, none);
        return pop(flight, best->t);
    }
    const Node8& node = group.nodes[flight.current];
    f8 entry;
    u32 mask = intersect_node(node, flight.node, best->t, &entry);
    if (!mask) return pop(flight, best->t);
    flight.current = push_in_company(node, mask, entry, &flight.top);
    return true;
}

}  // namespace

void closest_interleaved(const Group& group, const Ray* rays, const u32* indices, size_t count, RefHit* hits) {
    FlightSpace space[IN_FLIGHT];
    Flight* flights[IN_FLIGHT];
    u32 active = 0;
    size_t next = 0;
    for (; active < IN_FLIGHT && next < count; ++active, ++next)
        flights[active] = new (space[active].bytes) Flight(group, rays[indices[next]], indices[next]);
    while (active) {
        for (u32 k = 0; k < active; ++k) {
            Flight& flight = *flights[k];
            if (step(group, flight, &hits[flight.index])) {
                prefetch_child(group, flight.current);
            } else if (next < count) {
                new (&flight) Flight(group, rays[indices[next]], indices[next]);
                ++next;
            } else {
                flights[k] = flights[--active];
            }
        }
    }
}

bool rays_are_scattered(const Ray* rays, size_t count, const Box& scene) {
    if (count < SAMPLED_PAIRS) return false;
    float apart = FAR_APART * max_component(scene.hi - scene.lo);
    u32 far_pairs = 0;
    for (u32 k = 0; k < SAMPLED_PAIRS; ++k) {
        size_t i = (count - 1) * k / SAMPLED_PAIRS;
        far_pairs += max_component(abs_v(rays[i + 1].origin - rays[i].origin)) > apart;
    }
    return 2 * far_pairs > SAMPLED_PAIRS;
}

}  // namespace luch::cpu
