// Whether a ray passes by a box: the separating axes of a segment and a box (Gottschalk, Lin, Manocha 1996), with no
// division and no branch, so that rays that have nothing to do with what moves lose little time on it. Errs only to
// the side of "no".
//
// Of the box's three axes: a ray that is at d t, as seen from its origin, when it meets something of the box is within h
// of the box's centre c. Of the cross products of those with d: |c_i d_j - c_j d_i| = |(c_i - d_i t) d_j - (c_j - d_j t)
// d_i| <= h_i |d_j| + h_j |d_i|. h holds half the box, what the entries need (widening), the cone of math/bounds.h, 1 --
// SHEAR_ERROR of the way, which is no longer than to the box's far side -- and rounding: of c EPS |c|, of d t EPS, of
// each side of the last line 4 EPS (|c_i| + h_i) |d_j| and likewise: together below 17 EPS of that way (PASS_ERROR).
#pragma once
#include "luch/accel/instances.h"
#include "luch/geometry/box.h"

namespace luch {

struct PassBox {
    Vec3 center, half;  // world
    EntryError error;  // of what lies in it
};

LUCH_FN PassBox make_pass_box(const Box& box, const EntryError& error) {
    Vec3 center = 0.5f * box.lo + 0.5f * box.hi, half = max_v(box.hi - center, center - box.lo);
    return {center, {above(half.x), above(half.y), above(half.z)}, error};
}

// Of one axis: whether the way from t_min to t_max ends before the box or begins behind it.
LUCH_FN bool misses_slab(float c, float h, float d, float t_min, float t_max) {
    float a = d * t_min, b = d * t_max;
    return (min_f(a, b) > c + h) | (max_f(a, b) < c - h);
}
// Of the axis across two. A product that overflowed, or is lost among the smallest numbers, tells nothing.
LUCH_FN bool misses_across(float ci, float cj, float hi, float hj, float di, float dj) {
    float apart = abs_f(ci * dj - cj * di);
    return (apart > hi * abs_f(dj) + hj * abs_f(di) + PASS_SLACK) & (apart <= LARGEST_DISTANCE);
}

// 0 <= t_min <= t_max <= LARGEST_DISTANCE. What is not a number passes nothing by.
LUCH_FN bool passes_by(const PassBox& box, Vec3 origin, Vec3 direction, float t_min, float t_max) {
    Vec3 c = box.center - origin, d = direction;
    float way = max_component(abs_v(c) + box.half);
    float error = widening(box.error, origin) + PASS_ERROR * way + PASS_SLACK;
    Vec3 h = box.half + make_vec3(error);
    return misses_slab(c.x, h.x, d.x, t_min, t_max) | misses_slab(c.y, h.y, d.y, t_min, t_max) |
           misses_slab(c.z, h.z, d.z, t_min, t_max) | misses_across(c.x, c.y, h.x, h.y, d.x, d.y) |
           misses_across(c.y, c.z, h.y, h.z, d.y, d.z) | misses_across(c.z, c.x, h.z, h.x, d.z, d.x);
}

}  // namespace luch
