// What the structures that cut space, where a primitive stands in many cells, do in each of them.
#pragma once
#include "luch/accel/primitives.h"

namespace luch {

// The part of [t0, t1] in which the ray may be in the box (math/bounds.h, 1); false: none.
LUCH_FN bool clip_to_box(const BoxRay& ray, const Box& box, float* t0, float* t1) {
    for (int axis = 0; axis < 3; ++axis) {
        bool negative = ray.negative[axis] != 0;
        float near_plane = negative ? box.hi[axis] : box.lo[axis], far_plane = negative ? box.lo[axis] : box.hi[axis];
        // NaN, a ray in a face's plane: this axis does not count.
        *t0 = max_f((near_plane - ray.near_origin[axis]) * ray.near_rdir[axis], *t0);
        *t1 = min_f((far_plane - ray.far_origin[axis]) * ray.far_rdir[axis], *t1);
    }
    return *t0 <= *t1;
}

// The last few primitives that were tested: their test's answer would be the same in the next cell.
template <u32 COUNT>
struct Mailbox {
    static_assert((COUNT & (COUNT - 1)) == 0, "slots are chosen by the low bits");
    u32 tested[COUNT];
    LUCH_FN Mailbox() {
        for (u32 i = 0; i < COUNT; ++i) tested[i] = NONE;
    }
    LUCH_FN bool was_tested(u32 ref) {
        u32& slot = tested[ref & (COUNT - 1)];
        bool same = slot == ref;
        slot = ref;
        return same;
    }
};

// offer(refs, size): tests a cell's primitives; true to end. limit(): the t beyond which nothing counts.
template <Precision P, class Count>
struct ClosestInCell {
    const Primitives& all;
    PrimitiveRay<P> ray;
    float t_min;
    RefHit* best;
    Count& count;
    Mailbox<8> mailbox;

    LUCH_FN float limit() const { return best->t; }
    LUCH_FN bool offer(const u32* refs, u32 size) {
        count.list(u32(sizeof(u32)) * size);
        for (u32 i = 0; i < size; ++i)
            if (!mailbox.was_tested(refs[i])) offer_primitive(all, ray, refs[i], t_min, best, count);
        return false;
    }
};
template <Precision P, class Count>
struct AnyInCell {
    const Primitives& all;
    PrimitiveRay<P> ray;
    float t_min, t_max;
    u8 blocked;
    Count& count;
    Mailbox<8> mailbox;

    LUCH_FN float limit() const { return t_max; }
    LUCH_FN bool offer(const u32* refs, u32 size) {
        count.list(u32(sizeof(u32)) * size);
        for (u32 i = 0; i < size; ++i)
            if (!mailbox.was_tested(refs[i]) && block_primitive(all, ray, refs[i], t_min, t_max, &blocked, count))
                return true;
        return false;
    }
};

}  // namespace luch
