// The part of a primitive that lies in a cell of a kd-tree or a grid, as a box.
//
// A cell must list a primitive if a point Q of the cell is within the margin m of a point P of the triangle along every
// axis (math/bounds.h, 1: m = SHEAR_ERROR times the triangle's extent, of which 1/8 is slack). Then P lies in the cell
// widened by m, and Q in the box of the triangle's part there, widened by m again. Clipping is done in double: its
// rounding, 2^-50 of the coordinates, is far below the slack, which is at least 2^-47 of a coordinate that varies.
#pragma once
#include "luch/accel/primitives.h"

namespace luch::cpu {

// The two sides of a plane; an empty box: nothing of the primitive is there.
struct Halves {
    Box below, above;
};
inline bool is_empty(const Box& b) { return !(b.lo.x <= b.hi.x && b.lo.y <= b.hi.y && b.lo.z <= b.hi.z); }

// Cuts what lies in box (the primitive's own box, or what earlier cuts left of it).
Halves cut_box(const Box& box, int axis, float plane);
Halves cut_primitive(const Primitives& all, u32 ref, const Box& box, int axis, float plane);

}  // namespace luch::cpu
