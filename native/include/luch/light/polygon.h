// Directions towards triangles and rectangles, uniform in solid angle where the polygon is wide, by
// area where it is narrow. All points are relative to the shaded point. Which of the two is chosen
// depends on the polygon alone, so that a pdf query answers what the sampler did.
#pragma once
#include "luch/math/bounds.h"
#include "luch/math/fn.h"
#include "luch/sampling/warp.h"

namespace luch {

// Density per steradian of a point uniform over `area` that lies at `distance`, the plane being at
// `height` (of the shaded point over the polygon's plane, >= 0).
LUCH_FN float area_pdf_sa(float distance, float height, float area) {
    float weight = height * area;
    return weight > 0.0f ? distance * distance * distance / weight : 0.0f;
}

// What of a triangle its samples and its pdf need. a, b, c relative to the shaded point.
struct TriangleCone {
    Vec3 a, e1, e2;      // first corner and edges
    Vec3 unit_normal;    // of the order a, b, c
    float area;
    float height;        // signed: dot(unit_normal, a); negative: the shaded point is in front
    Vec3 na, nb, nc;     // unit corners; only for solid angle
    float g0, g1, g2;    // Van Oosterom and Strackee 1983: tan(angle / 2) = g0 / (g1 + g2)
    float solid_angle;   // 0: sample by area
};

LUCH_FN_SLOW TriangleCone make_triangle_cone(Vec3 a, Vec3 b, Vec3 c) {
    TriangleCone t{};
    t.a = a;
    t.e1 = b - a;
    t.e2 = c - a;
    Vec3 normal = cross(t.e1, t.e2);
    float double_area = length(normal);
    t.area = 0.5f * double_area;
    if (!(double_area > 0.0f && finite_f(double_area))) {
        t.area = 0.0f;
        return t;
    }
    t.unit_normal = normal / double_area;
    t.height = dot(t.unit_normal, a);
    float extent2 = max_f(length_squared(t.e1), max_f(length_squared(t.e2), length_squared(c - b)));
    float a2 = length_squared(a);
    if (extent2 <= NARROW_RATIO_SQUARED * a2) return t;
    float la = sqrt_f(a2), lb = length(b), lc = length(c);
    if (!(la > 0.0f && lb > 0.0f && lc > 0.0f)) return t;
    t.na = a / la;
    t.nb = b / lb;
    t.nc = c / lc;
    // The volume a.(b x c) by height and area: no cancellation among three nearly equal directions.
    t.g0 = abs_f(t.height) * double_area / (la * lb * lc);
    t.g1 = dot(t.na, t.nc) + dot(t.nb, t.nc);
    t.g2 = 1.0f + dot(t.na, t.nb);
    float angle = 2.0f * atan2_f(t.g0, t.g1 + t.g2);
    t.solid_angle = angle >= FLAT_SOLID_ANGLE ? angle : 0.0f;
    return t;
}

LUCH_FN float triangle_cone_pdf(const TriangleCone& t, float distance) {
    if (t.solid_angle >= HEMISPHERE_SOLID_ANGLE) return 1.0f / TWO_PI;
    return t.solid_angle > 0.0f ? 1.0f / t.solid_angle : area_pdf_sa(distance, abs_f(t.height), t.area);
}

// Unit direction, uniform in the cone's solid angle. Peters 2021, "BRDF importance sampling for
// polygonal lights", section 3: cut off a sub-triangle of u.x times the angle, then walk its arc.
LUCH_FN_SLOW Vec3 sample_triangle_direction(const TriangleCone& t, Vec2 u) {
    float half = 0.5f * u.x * t.solid_angle;
    float s = sin_f(half), c = cos_f(half);
    Vec3 r = t.na * (t.g0 * c - t.g1 * s) + t.nc * (t.g2 * s);
    float r2 = length_squared(r);
    Vec3 corner = r2 > 0.0f ? r * (2.0f * dot(t.na, r) / r2) - t.na : t.nc;
    // Along the arc from nb to corner the cosine of the angle is uniform.
    float gap = 0.5f * length_squared(corner - t.nb);  // 1 - cos(arc), without cancellation
    float cos_arc = 1.0f - gap;
    float cos_here = 1.0f - u.y * gap;
    float ratio = sqrt_f(u.y * max_f(1.0f + cos_here, 0.0f) / max_f(1.0f + cos_arc, 1e-20f));
    return t.nb * (cos_here - ratio * cos_arc) + corner * ratio;
}

// Barycentrics (b, c) of a sample of the triangle; b < 0: the sample missed it.
LUCH_FN_SLOW Vec2 sample_triangle_cone(const TriangleCone& t, Vec2 u) {
    if (!(t.solid_angle > 0.0f)) return sample_triangle(u);
    Vec3 n = t.unit_normal;
    bool hemisphere = t.solid_angle >= HEMISPHERE_SOLID_ANGLE;
    Vec3 d;
    if (hemisphere) {
        Vec3 x, y;
        make_frame(t.height > 0.0f ? n : -n, &x, &y);
        d = to_world(sample_uniform_hemisphere(u), x, y, t.height > 0.0f ? n : -n);
    } else {
        d = sample_triangle_direction(t, u);
    }
    float along = dot(n, d);
    float distance = along != 0.0f ? t.height / along : 0.0f;
    Vec3 q = d * distance - t.a;
    float scale = 0.5f / t.area;
    float v1 = dot(cross(q, t.e2), n) * scale, v2 = dot(cross(t.e1, q), n) * scale;
    if (hemisphere && !(v1 >= 0.0f && v2 >= 0.0f && v1 + v2 <= 1.0f)) return {-1.0f, -1.0f};
    v1 = clamp_f(v1, 0.0f, 1.0f);
    v2 = clamp_f(v2, 0.0f, 1.0f);
    float sum = v1 + v2;
    float shrink = sum > 1.0f ? 1.0f / sum : 1.0f;
    return {v1 * shrink, v2 * shrink};
}

// A rectangle in its own frame: x and y along its edges, the shaded point at the origin, the plane
// at z = -height.
struct RectangleCone {
    float x0, x1, y0, y1, height;
    float b0, b1;        // z of the inward normals of the two planes through the y edges
    float g2, g3;        // two of the inner angles, less pi / 2
    float solid_angle;   // 0: sample by area
};

// Urena, Fajardo, King 2013, "An area-preserving parametrization for spherical rectangles", with
// inner angles as arc sines: the sum of four right angles would cancel for small rectangles.
// Straight-line, as its sample is: the CPU takes many points in one loop, which vectorises.
LUCH_FN RectangleCone make_rectangle_cone(float x0, float x1, float y0, float y1, float height) {
    float cx = 0.5f * (x0 + x1), cy = 0.5f * (y0 + y1);
    float extent2 = sqr(x1 - x0) + sqr(y1 - y0), h2 = height * height;
    float narrow2 = NARROW_RATIO_SQUARED * (cx * cx + cy * cy + h2);
    float nz0 = -y0 / sqrt_f(y0 * y0 + h2), nz1 = x1 / sqrt_f(x1 * x1 + h2);
    float nz2 = y1 / sqrt_f(y1 * y1 + h2), nz3 = -x0 / sqrt_f(x0 * x0 + h2);
    float g0 = asin_f(-nz0 * nz1), g1 = asin_f(-nz1 * nz2), g2 = asin_f(-nz2 * nz3), g3 = asin_f(-nz3 * nz0);
    float angle = -(g0 + g1 + g2 + g3);
    angle = angle >= FLAT_SOLID_ANGLE ? angle : 0.0f;
    angle = extent2 <= narrow2 ? 0.0f : angle;
    return {x0, x1, y0, y1, height, nz0, nz2, g2, g3, height > 0.0f ? angle : 0.0f};
}

// In the rectangle's frame.
LUCH_FN Vec2 sample_rectangle_cone(const RectangleCone& r, Vec2 u) {
    float au = u.x * r.solid_angle + r.g2 + r.g3;
    float sin_au = sin_f(au);
    float fu = sin_au != 0.0f ? (cos_f(au) * r.b0 + r.b1) / sin_au : 1e30f;
    float cu = copysign_f(1.0f / sqrt_f(fu * fu + r.b0 * r.b0), fu);
    cu = clamp_f(cu, -1.0f, 1.0f);
    float x = clamp_f(cu * r.height / max_f(safe_sqrt(1.0f - cu * cu), RECTANGLE_LEAST_SINE), r.x0, r.x1);
    float d2 = x * x + r.height * r.height;
    float h0 = r.y0 / sqrt_f(d2 + r.y0 * r.y0), h1 = r.y1 / sqrt_f(d2 + r.y1 * r.y1);
    float h = mix_f(h0, h1, u.y);
    float rest = 1.0f - h * h;
    float y = rest > RECTANGLE_LEAST_REST ? h * sqrt_f(d2 / rest) : (h > 0.0f ? r.y1 : r.y0);
    bool by_angle = r.solid_angle > 0.0f;
    return {by_angle ? x : mix_f(r.x0, r.x1, u.x), by_angle ? clamp_f(y, r.y0, r.y1) : mix_f(r.y0, r.y1, u.y)};
}

}  // namespace luch
