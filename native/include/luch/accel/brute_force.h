// No structure: every primitive in turn. The oracle, and the fastest for a handful of triangles.
#pragma once
#include "luch/accel/primitives.h"

namespace luch {

struct BruteForce {
    const u32* refs;  // the primitives that can be traced, ascending
    u32 count;
};

template <Precision P, class Count>
LUCH_FN void closest_hit(const BruteForce& list, const Primitives& all, const Ray& ray, RefHit* best, Count& count) {
    PrimitiveRay<P> prepared(ray);
    for (u32 i = 0; i < list.count; ++i) offer_primitive(all, prepared, list.refs[i], ray.t_min, best, count);
}

template <Precision P, class Count>
LUCH_FN u8 any_hit(const BruteForce& list, const Primitives& all, const Ray& ray, Count& count) {
    PrimitiveRay<P> prepared(ray);
    u8 blocked = BLOCKED_NOT;
    for (u32 i = 0; i < list.count; ++i)
        if (block_primitive(all, prepared, list.refs[i], ray.t_min, ray.t_max, &blocked, count)) break;
    return blocked;
}

}  // namespace luch
