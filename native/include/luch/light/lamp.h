// One lamp: a sample of it, its pdf, its intersection with a ray. No choice among lamps here: every
// pdf is conditional on this lamp. Semantics of looks and units are Blender's (Cycles 5.2).
#pragma once
#include "luch/light/light.h"
#include "luch/light/polygon.h"
#include "luch/plan.h"

namespace luch {

struct LampSample {
    bool valid;
    Vec3 direction;
    float distance, pdf_sa;   // delta lamps: 1
    Color radiance;
    float u, v;
    Vec3 point, normal;
};

// What a scene has no lamp of is known when its kernels are compiled.
LUCH_FN bool is_sun(const LampView& lamp) { return plan::SUNS && lamp.kind == LampKind::SUN; }
LUCH_FN bool is_area(const LampView& lamp) {
    if constexpr (plan::AREA_LAMPS && !plan::ROUND_LAMPS && !plan::SUNS) return true;
    return plan::AREA_LAMPS && (lamp.kind == LampKind::RECTANGLE || lamp.kind == LampKind::ELLIPSE);
}
// What sample_area samples.
LUCH_FN bool is_wide_area(const LampView& lamp) { return is_area(lamp) && !lamp.delta; }
LUCH_FN bool is_round(const LampView& lamp) {
    if constexpr (plan::ROUND_LAMPS && !plan::AREA_LAMPS && !plan::SUNS) return true;
    return plan::ROUND_LAMPS && (lamp.kind == LampKind::SPHERE || lamp.kind == LampKind::DISK);
}

LUCH_FN Vec3 lamp_local_direction(const LampView& lamp, Vec3 d) {
    const float* m = lamp.to_local;
    return {m[0] * d.x + m[1] * d.y + m[2] * d.z, m[3] * d.x + m[4] * d.y + m[5] * d.z,
            m[6] * d.x + m[7] * d.y + m[8] * d.z};
}

// ---- looks ---------------------------------------------------------------------------------------

// How much of a spot's light leaves along `outward` (unit, from the lamp). Cosine measured in the lamp's own
// space, where a scaled lamp's cone is round.
LUCH_FN float spot_attenuation(const LampView& lamp, Vec3 outward) {
    Vec3 local = normalize_or(lamp_local_direction(lamp, outward), {0.0f, 0.0f, 1.0f});
    float x = saturate_f((-local.z - lamp.cos_half_spot) * lamp.spot_scale);
    return x * x * (3.0f - 2.0f * x);
}

// A soft box: the share of light that the slats of a grid let through, with the total flux kept.
LUCH_FN float spread_attenuation(const LampView& lamp, Vec3 outward) {
    if (lamp.tan_half_spread == INFINITE_DISTANCE) return 1.0f;
    float c = dot(outward, lamp.direction);
    if (!(c > 0.0f)) return 0.0f;
    float tangent = length(cross(outward, lamp.direction)) / c;
    return max_f(lamp.tan_half_spread - tangent, 0.0f) * lamp.spread_scale;
}

// What Geometry > Parametric gives on the lamp. outward: unit, from the lamp towards the shaded point.
LUCH_FN_SLOW Vec2 lamp_parametric(const LampView& lamp, Vec3 point, Vec3 normal, Vec3 outward) {
    if (is_area(lamp)) {
        Vec3 q = point - lamp.position;
        return {saturate_f(0.5f + 0.5f * safe_divide(dot(q, lamp.axis_u), lamp.half_u)),
                saturate_f(0.5f + 0.5f * safe_divide(dot(q, lamp.axis_v), lamp.half_v))};
    }
    if (is_sun(lamp)) {
        // The disk of directions: the radius is the chord from the axis, 1/2 at the sun's edge.
        Vec3 to_sun = -outward;
        float edge_chord = sqrt_f(2.0f * lamp.one_minus_cos_half_angle);
        float s = safe_divide(1.0f, edge_chord * length(to_sun - lamp.direction));
        Vec3 local = lamp_local_direction(lamp, to_sun);
        return {local.x * s + 0.5f, local.y * s + 0.5f};
    }
    if (lamp.spot) {
        Vec3 local = normalize_or(lamp_local_direction(lamp, outward), {0.0f, 0.0f, -1.0f});
        float scale = safe_divide(lamp.half_cot_half_spot, -local.z);
        return {local.x * scale + 0.5f, local.y * scale + 0.5f};
    }
    Vec3 local = normalize_or(lamp_local_direction(lamp, normal), {0.0f, 0.0f, 1.0f});
    float around = (local.x == 0.0f && local.y == 0.0f) ? 0.0f : (1.0f - atan2_f(local.x, local.y) * INV_PI) * 0.5f;
    return {around, 1.0f - acos_f(local.z) * INV_PI};
}

LUCH_FN Color lamp_radiance_towards(const LampView& lamp, Vec3 outward) {
    if (lamp.spot) return lamp.radiance * spot_attenuation(lamp, outward);
    if (is_area(lamp)) return lamp.radiance * spread_attenuation(lamp, outward);
    return lamp.radiance;
}

// ---- spheres and disks ---------------------------------------------------------------------------

// 1 - cos of the cone that a sphere fills, from (radius / distance)^2 < 1.
LUCH_FN float sphere_one_minus_cos(float sin2) { return sin2 / (1.0f + safe_sqrt(1.0f - sin2)); }

// Distance to the first crossing of a sphere in front of the origin; the far side if the origin is inside.
// from: origin minus centre. Negative: none.
LUCH_FN float sphere_crossing(Vec3 from, Vec3 direction, float radius) {
    float b = -dot(from, direction);
    // Squared distance of the centre from the line, from the closest point itself (Haines et al. 2019).
    Vec3 nearest = from + direction * b;
    float root2 = radius * radius - length_squared(nearest);
    if (!(root2 >= 0.0f)) return -1.0f;
    float root = sqrt_f(root2);
    return length_squared(from) > radius * radius ? b - root : b + root;
}

LUCH_FN float inside_sphere_pdf(Vec3 n, bool transmits, Vec3 direction) {
    return (transmits || is_zero(n)) ? 0.25f * INV_PI : max_f(dot(n, direction), 0.0f) * INV_PI;
}

LUCH_FN_SLOW void sample_inside_sphere(const LampView& lamp, Vec3 from, Vec3 n, bool transmits, Vec2 u, LampSample* s) {
    if (transmits || is_zero(n)) {
        s->direction = sample_uniform_sphere(u);
    } else {
        Vec3 t, b;
        make_frame(n, &t, &b);
        s->direction = to_world(sample_cosine_hemisphere(u), t, b, n);
    }
    s->pdf_sa = inside_sphere_pdf(n, transmits, s->direction);
    s->distance = sphere_crossing(from, s->direction, lamp.radius);
    Vec3 outward_normal = normalize_or(from + s->direction * s->distance, -s->direction);
    s->normal = outward_normal;
    s->point = lamp.position + outward_normal * lamp.radius;
    s->radiance = lamp.radiance;  // a spot's cone does not shade its inside
    s->valid = s->pdf_sa > 0.0f && s->distance > 0.0f;
}

LUCH_FN_SLOW LampSample sample_sphere(const LampView& lamp, Vec3 p, Vec3 n, bool transmits, Vec2 u) {
    LampSample s{};
    Vec3 to = lamp.position - p;
    float d2 = length_squared(to), r2 = lamp.radius * lamp.radius;
    if (!(d2 > r2)) {
        sample_inside_sphere(lamp, -to, n, transmits, u, &s);
        return s;
    }
    float d = sqrt_f(d2);
    float visible = sphere_one_minus_cos(r2 / d2);
    Vec3 axis = to / d, t, b;
    if (lamp.spot && lamp.spot_one_minus_cos < visible) {
        // Close to a large spot only directions within its cone matter.
        axis = -lamp.direction;
        make_frame(axis, &t, &b);
        s.direction = to_world(sample_cone(lamp.spot_one_minus_cos, u), t, b, axis);
        s.pdf_sa = 1.0f / (TWO_PI * lamp.spot_one_minus_cos);
        s.distance = sphere_crossing(-to, s.direction, lamp.radius);
        s.normal = normalize_or(s.direction * s.distance - to, -s.direction);
    } else {
        make_frame(axis, &t, &b);
        Vec3 local = sample_cone(visible, u);
        s.direction = to_world(local, t, b, axis);
        s.pdf_sa = 1.0f / (TWO_PI * visible);
        // Within the plane of centre, origin and direction; the lateral part alone carries the digits.
        float sin2 = local.x * local.x + local.y * local.y;
        s.distance = d * local.z - safe_sqrt(r2 - d2 * sin2);
        float scale = s.distance / lamp.radius;
        float axial = safe_sqrt(1.0f - scale * scale * sin2);
        s.normal = (t * local.x + b * local.y) * scale - axis * axial;
    }
    s.point = lamp.position + s.normal * lamp.radius;
    s.radiance = lamp_radiance_towards(lamp, -s.direction);
    s.valid = s.distance > 0.0f;
    return s;
}

LUCH_FN float sphere_pdf(const LampView& lamp, Vec3 p, Vec3 n, bool transmits, Vec3 direction) {
    float d2 = length_squared(lamp.position - p), r2 = lamp.radius * lamp.radius;
    if (!(d2 > r2)) return inside_sphere_pdf(n, transmits, direction);
    float visible = sphere_one_minus_cos(r2 / d2);
    return 1.0f / (TWO_PI * (lamp.spot ? min_f(visible, lamp.spot_one_minus_cos) : visible));
}

// Soft falloff: a disk of the lamp's radius that always faces the shaded point.
LUCH_FN_SLOW LampSample sample_facing_disk(const LampView& lamp, Vec3 p, Vec2 u) {
    LampSample s{};
    Vec3 to = lamp.position - p;
    float d = length(to);
    if (!(d > 0.0f && finite_f(d))) return s;
    Vec3 axis = to / d, t, b;
    make_frame(axis, &t, &b);
    Vec2 q = sample_disk(u);
    Vec3 offset = (t * q.x + b * q.y) * lamp.radius;
    Vec3 along = to + offset;
    s.distance = length(along);
    s.direction = along / s.distance;
    s.point = lamp.position + offset;
    s.normal = -s.direction;
    s.pdf_sa = area_pdf_sa(s.distance, d, PI * lamp.radius * lamp.radius);
    s.radiance = lamp_radiance_towards(lamp, -s.direction);
    s.valid = true;
    return s;
}

// ---- area lamps ----------------------------------------------------------------------------------

// Looking from one point: an area lamp in its own axes, the point above the origin.
struct AreaOutlook {
    float shift_x, shift_y, height;  // of the lamp's centre from the point's foot; of the point over its plane
    float half_u, half_v, tan_half_spread;
    bool ellipse;
};

LUCH_FN AreaOutlook make_area_outlook(const LampView& lamp, Vec3 p) {
    Vec3 from = p - lamp.position;
    return {-dot(from, lamp.axis_u), -dot(from, lamp.axis_v),       dot(from, lamp.direction), lamp.half_u, lamp.half_v,
            lamp.tan_half_spread,    lamp.kind == LampKind::ELLIPSE};
}

// Where on an area lamp samples fall: a rectangle, or a disk or ellipse inside which they are uniform by area.
struct AreaRegion {
    bool round;
    RectangleCone box;  // round: its bounding box
    float solid_angle;  // that samples are uniform in; 0: in the area
    float area;         // 0: no light arrives
};

// Straight-line, as what follows from it: see make_rectangle_cone.
LUCH_FN AreaRegion make_area_region(const AreaOutlook& o) {
    float left = o.shift_x - o.half_u, right = o.shift_x + o.half_u;
    float bottom = o.shift_y - o.half_v, top = o.shift_y + o.half_v;
    // Only what lies within the spread's circle around the foot sends light here.
    float reach = o.height * o.tan_half_spread;
    float x0 = max_f(left, -reach), x1 = min_f(right, reach);
    float y0 = max_f(bottom, -reach), y1 = min_f(top, reach);
    // An ellipse is taken whole where that loses fewer samples than the clipped box.
    float clipped = (x1 - x0) * (y1 - y0), whole = (right - left) * (top - bottom) * QUARTER_PI;
    whole = o.ellipse ? whole : INFINITE_DISTANCE;
    bool round = whole <= clipped;
    AreaRegion r;
    r.box = make_rectangle_cone(round ? left : x0, round ? right : x1, round ? bottom : y0, round ? top : y1, o.height);
    // A wide ellipse: uniform in the solid angle of its box, a fifth of the samples lost, beats uniform by area.
    whole = r.box.solid_angle > 0.3f ? INFINITE_DISTANCE : whole;
    r.round = whole <= clipped;
    float area = (r.box.x1 - r.box.x0) * (r.box.y1 - r.box.y0);
    area = r.round ? area * QUARTER_PI : area;
    float angle = r.round ? 0.0f : r.box.solid_angle;
    float room = x0 < x1 ? y1 - y0 : 0.0f;
    room = o.height > 0.0f ? room : 0.0f;
    r.solid_angle = room > 0.0f ? angle : 0.0f;
    r.area = room > 0.0f ? area : 0.0f;
    return r;
}

// Of a place in an ellipse: 1 at its edge.
LUCH_FN float ellipse_radius_squared(float half_u, float half_v, float x, float y) {
    return sqr(x / half_u) + sqr(y / half_v);
}

LUCH_FN bool on_area_lamp(const LampView& lamp, float x, float y) {
    if (lamp.kind == LampKind::RECTANGLE) return abs_f(x) <= lamp.half_u && abs_f(y) <= lamp.half_v;
    return ellipse_radius_squared(lamp.half_u, lamp.half_v, x, y) <= 1.0f;
}

// A place on the lamp, in its axes below the point that looks, and what its density needs.
struct AreaPlace {
    float x, y, height;
    float solid_angle, area;  // as AreaRegion's; both 0: no sample
};

LUCH_FN float area_place_pdf(float solid_angle, float area, float height, float distance) {
    return solid_angle > 0.0f ? 1.0f / solid_angle : area_pdf_sa(distance, height, area);
}

LUCH_FN AreaPlace sample_area_place(const AreaOutlook& o, Vec2 u) {
    AreaRegion r = make_area_region(o);
    Vec2 disk = sample_disk(u), box = sample_rectangle_cone(r.box, u);
    float x = r.round ? o.shift_x + disk.x * o.half_u : box.x;
    float y = r.round ? o.shift_y + disk.y * o.half_v : box.y;
    float across = r.round ? 0.0f : ellipse_radius_squared(o.half_u, o.half_v, x - o.shift_x, y - o.shift_y);
    across = o.ellipse ? across : 0.0f;
    return {x, y, o.height, across <= 1.0f ? r.solid_angle : 0.0f, across <= 1.0f ? r.area : 0.0f};
}

LUCH_FN LampSample area_sample_at(const LampView& lamp, Vec3 p, const AreaPlace& place) {
    LampSample s{};
    Vec3 along = lamp.axis_u * place.x + lamp.axis_v * place.y - lamp.direction * place.height;
    s.distance = length(along);
    s.pdf_sa = area_place_pdf(place.solid_angle, place.area, place.height, s.distance);
    s.valid = s.pdf_sa > 0.0f && s.distance > 0.0f;
    if (!s.valid) return s;
    s.direction = along / s.distance;
    s.point = p + along;
    s.normal = lamp.direction;
    s.radiance = lamp_radiance_towards(lamp, -s.direction);
    return s;
}

LUCH_FN_SLOW LampSample sample_area(const LampView& lamp, Vec3 p, Vec2 u) {
    return area_sample_at(lamp, p, sample_area_place(make_area_outlook(lamp, p), u));
}

LUCH_FN_SLOW float area_lamp_pdf(const LampView& lamp, Vec3 p, float distance) {
    AreaRegion r = make_area_region(make_area_outlook(lamp, p));
    return area_place_pdf(r.solid_angle, r.area, r.box.height, distance);
}

// No spread at all: parallel light from the lamp's outline.
LUCH_FN LampSample sample_parallel_area(const LampView& lamp, Vec3 p) {
    LampSample s{};
    Vec3 from = p - lamp.position;
    s.distance = dot(from, lamp.direction);
    s.valid = s.distance > 0.0f && on_area_lamp(lamp, dot(from, lamp.axis_u), dot(from, lamp.axis_v));
    s.direction = -lamp.direction;
    s.point = p + s.direction * s.distance;
    s.normal = lamp.direction;
    s.radiance = lamp.radiance;
    s.pdf_sa = 1.0f;
    return s;
}

// ---- suns and the whole --------------------------------------------------------------------------

LUCH_FN LampSample sample_sun(const LampView& lamp, Vec2 u) {
    LampSample s{};
    Vec3 axis = -lamp.direction, t, b;
    make_frame(axis, &t, &b);
    s.direction = lamp.delta ? axis : to_world(sample_cone(lamp.one_minus_cos_half_angle, u), t, b, axis);
    s.pdf_sa = lamp.delta ? 1.0f : 1.0f / (TWO_PI * lamp.one_minus_cos_half_angle);
    s.distance = INFINITE_DISTANCE;
    s.point = s.direction;
    s.normal = -s.direction;
    s.radiance = lamp.radiance;
    s.valid = true;
    return s;
}

LUCH_FN LampSample sample_point(const LampView& lamp, Vec3 p) {
    LampSample s{};
    Vec3 to = lamp.position - p;
    s.distance = length(to);
    if (!(s.distance > 0.0f)) return s;
    s.direction = to / s.distance;
    s.point = lamp.position;
    s.normal = -s.direction;
    s.pdf_sa = 1.0f;
    s.radiance = lamp_radiance_towards(lamp, -s.direction) * (1.0f / (s.distance * s.distance));
    s.valid = finite_v(s.radiance);
    return s;
}

// What every kind of sample ends with.
LUCH_FN void finish_lamp_sample(const LampView& lamp, LampSample* s) {
    s->valid = s->valid && !is_zero(s->radiance);
    if (plan::LAMP_PROGRAMS && s->valid && lamp.has_program) {
        Vec2 uv = lamp_parametric(lamp, s->point, s->normal, -s->direction);
        s->u = uv.x;
        s->v = uv.y;
    }
}

LUCH_FN_SLOW LampSample sample_lamp(const LampView& lamp, Vec3 p, Vec3 n, bool transmits, Vec2 u) {
    LampSample s;
    if (is_sun(lamp)) {
        s = sample_sun(lamp, u);
    } else if (is_area(lamp)) {
        s = lamp.delta ? sample_parallel_area(lamp, p) : sample_area(lamp, p, u);
    } else if (!is_round(lamp)) {
        s = LampSample{};
    } else if (lamp.delta) {
        s = sample_point(lamp, p);
    } else {
        s = lamp.kind == LampKind::DISK ? sample_facing_disk(lamp, p, u) : sample_sphere(lamp, p, n, transmits, u);
    }
    finish_lamp_sample(lamp, &s);
    return s;
}

// Density with which sample_lamp would have chosen this direction. distance: to the hit on the lamp.
LUCH_FN_SLOW float lamp_pdf(const LampView& lamp, Vec3 p, Vec3 n, bool transmits, Vec3 direction, float distance) {
    if (lamp.delta) return 0.0f;
    if (is_sun(lamp)) return 1.0f / (TWO_PI * lamp.one_minus_cos_half_angle);
    if (is_area(lamp)) return area_lamp_pdf(lamp, p, distance);
    if (!is_round(lamp)) return 0.0f;
    if (lamp.kind == LampKind::SPHERE) return sphere_pdf(lamp, p, n, transmits, direction);
    return area_pdf_sa(distance, length(lamp.position - p), PI * lamp.radius * lamp.radius);
}

// Distance to the lamp along a unit direction; negative: not hit. A sphere's far side counts only from inside.
LUCH_FN_SLOW float intersect_lamp(const LampView& lamp, Vec3 origin, Vec3 direction) {
    Vec3 from = origin - lamp.position;
    if (is_round(lamp)) {
        if (lamp.spot && dot(direction, from) >= 0.0f) return -1.0f;  // a spot's own back shows nothing
        if (lamp.kind == LampKind::SPHERE) return sphere_crossing(from, direction, lamp.radius);
        float d2 = length_squared(from);
        float along = -dot(from, direction);
        if (!(along > 0.0f)) return -1.0f;
        float t = d2 / along;
        return length_squared(from + direction * t) <= lamp.radius * lamp.radius ? t : -1.0f;
    }
    float falling = -dot(direction, lamp.direction);
    if (!(falling > 0.0f)) return -1.0f;  // seen from behind or edge-on
    float t = dot(from, lamp.direction) / falling;
    Vec3 q = from + direction * t;
    return on_area_lamp(lamp, dot(q, lamp.axis_u), dot(q, lamp.axis_v)) ? t : -1.0f;
}

}  // namespace luch
