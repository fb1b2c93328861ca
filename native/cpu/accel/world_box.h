// The box of a transformed box.
#pragma once
#include "luch/geometry/box.h"
#include "luch/math/vec.h"

namespace luch::cpu {

inline Box world_box(const Affine& to_world, const Box& box) {
    Box out = empty_box();
    for (int corner = 0; corner < 8; ++corner)
        extend(out, transform_point(to_world, {corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                                               corner & 4 ? box.hi.z : box.lo.z}));
    return out;
}

}  // namespace luch::cpu
