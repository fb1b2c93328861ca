// Blender's lamps in their final units.
#include <cmath>

#include "cpu/light/build.h"
#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

Vec3 column(const Affine& a, int i) { return {a.m[i], a.m[4 + i], a.m[8 + i]}; }

// Inverse of the linear part by cofactors in double; identity-like axes where it has none.
void set_to_local(const Affine& a, LampView* lamp) {
    double m[9] = {a.m[0], a.m[1], a.m[2], a.m[4], a.m[5], a.m[6], a.m[8], a.m[9], a.m[10]};
    double c[9] = {m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
                   m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
                   m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
    double determinant = m[0] * c[0] + m[1] * c[3] + m[2] * c[6];
    bool usable = std::isfinite(determinant) && std::fabs(determinant) > 1e-60;
    Vec3 z = -lamp->direction, x, y;
    make_frame(z, &x, &y);
    const float fallback[9] = {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
    for (int i = 0; i < 9; ++i) lamp->to_local[i] = usable ? static_cast<float>(c[i] / determinant) : fallback[i];
}

void set_spot(const LampInput& in, LampView* lamp) {
    float half = 0.5f * clamp_f(in.spot_size, 0.0f, PI);
    lamp->spot = true;
    lamp->cos_half_spot = std::cos(half);
    float smooth = (1.0f - lamp->cos_half_spot) * in.spot_blend;
    lamp->spot_scale = 1.0f / max_f(smooth, SMALLEST_SPOT);
    lamp->half_cot_half_spot = 0.5f / max_f(std::tan(half), SMALLEST_SPOT);
    // The widest half angle of a cone that the lamp's scale has made elliptic.
    float wide = max_f(length(column(in.matrix, 0)), length(column(in.matrix, 1)));
    double stretch = safe_divide(wide, length(column(in.matrix, 2)));
    double widest = std::atan(stretch * std::tan(std::min(static_cast<double>(half), FLATTEST_CONE)));
    double sine = std::sin(0.5 * widest);
    lamp->spot_one_minus_cos = static_cast<float>(std::max(2.0 * sine * sine, double(SMALLEST_SPOT)));
}

Color scaled_color(const LampInput& in, float factor) {
    Color c = in.color * (in.power * factor);
    bool usable = finite_v(c) && max_component(abs_v(c)) <= LARGEST_RADIANCE * 1e8f;
    return usable ? c : Color{0.0f, 0.0f, 0.0f};
}

void make_point(const LampInput& in, LampView* lamp) {
    lamp->radius = finite_f(in.radius) ? max_f(in.radius, 0.0f) : 0.0f;
    lamp->kind = in.soft_falloff ? LampKind::DISK : LampKind::SPHERE;
    lamp->delta = lamp->radius < SMALLEST_RADIUS;
    if (lamp->delta) lamp->radius = 0.0f;
    // Normalised: the sphere's whole flux is `power` (pi times radiance times area). Otherwise power / pi is the
    // radiance, and of a lamp of no size, as in Cycles, the intensity.
    float per_area = lamp->delta ? 0.25f : 0.25f / (PI * lamp->radius * lamp->radius);
    lamp->radiance = scaled_color(in, INV_PI * (in.normalize ? per_area : 1.0f));
    if (in.shape == LampShape::SPOT) set_spot(in, lamp);
}

void make_sun(const LampInput& in, LampView* lamp) {
    float half = 0.5f * clamp_f(in.angle, 0.0f, PI);
    lamp->kind = LampKind::SUN;
    lamp->delta = half < SMALLEST_HALF_SUN;
    float sine = std::sin(half), half_sine = std::sin(0.5f * half);
    lamp->cos_half_angle = std::cos(half);
    lamp->one_minus_cos_half_angle = 2.0f * half_sine * half_sine;
    // Strength is the irradiance of a surface that faces the whole disk.
    bool keep = lamp->delta || !in.normalize;
    lamp->radiance = scaled_color(in, keep ? 1.0f : INV_PI / (sine * sine));
}

void make_area(const LampInput& in, LampView* lamp) {
    bool round = in.shape == LampShape::DISK || in.shape == LampShape::ELLIPSE;
    bool one_size = in.shape == LampShape::SQUARE || in.shape == LampShape::DISK;
    lamp->kind = round ? LampKind::ELLIPSE : LampKind::RECTANGLE;
    Vec3 x = column(in.matrix, 0), y = column(in.matrix, 1);
    lamp->axis_u = normalize_or(x, {1.0f, 0.0f, 0.0f});
    lamp->axis_v = normalize_or(y, {0.0f, 1.0f, 0.0f});
    lamp->half_u = 0.5f * max_f(in.size * length(x), SMALLEST_EXTENT);
    lamp->half_v = 0.5f * max_f((one_size ? in.size : in.size_y) * length(y), SMALLEST_EXTENT);
    lamp->area = 4.0f * lamp->half_u * lamp->half_v * (round ? QUARTER_PI : 1.0f);
    double half = 0.5 * clamp_f(in.spread, 0.0f, PI);
    lamp->delta = half < SMALLEST_SPREAD;
    lamp->tan_half_spread = half > FLATTEST_CONE ? INFINITE_DISTANCE : static_cast<float>(std::tan(half));
    // tan a - a, by its series where it would cancel.
    double slats = half < SPREAD_SERIES ? half * half * half / 3.0 * (1.0 + 0.4 * half * half) : std::tan(half) - half;
    lamp->spread_scale = slats > 0.0 ? static_cast<float>(1.0 / slats) : 0.0f;
    float per_area = in.normalize ? 1.0f / lamp->area : 1.0f;
    lamp->radiance = scaled_color(in, per_area * (lamp->delta ? 1.0f : INV_PI));
}

}  // namespace

LampView make_lamp(const LampInput& in) {
    LampView lamp{};
    lamp.position = {in.matrix.m[3], in.matrix.m[7], in.matrix.m[11]};
    Vec3 z = column(in.matrix, 2);
    bool placed = finite_v(lamp.position) && length(z) > 1e-30f && finite_v(z);
    lamp.direction = normalize_or(-z, {0.0f, 0.0f, -1.0f});
    lamp.tan_half_spread = INFINITE_DISTANCE;
    if (in.shape == LampShape::POINT || in.shape == LampShape::SPOT)
        make_point(in, &lamp);
    else if (in.shape == LampShape::SUN)
        make_sun(in, &lamp);
    else
        make_area(in, &lamp);
    if (in.shape >= LampShape::SQUARE) {
        placed = placed && !is_zero(column(in.matrix, 0)) && !is_zero(column(in.matrix, 1)) && finite_f(lamp.area);
        // A sheared matrix keeps its edges; the normal is that of the plane they span, on the side of -z.
        Vec3 normal = normalize_or(cross(lamp.axis_u, lamp.axis_v), -lamp.direction);
        if (placed) lamp.direction = dot(normal, lamp.direction) > 0.0f ? normal : -normal;
        lamp.axis_v = placed ? normalize_or(cross(lamp.direction, lamp.axis_u), lamp.axis_v) : lamp.axis_v;
        if (placed && dot(lamp.axis_v, column(in.matrix, 1)) < 0.0f) lamp.axis_v = -lamp.axis_v;
    }
    set_to_local(in.matrix, &lamp);
    if (!placed) lamp.radiance = {0.0f, 0.0f, 0.0f};
    lamp.mis = in.use_mis && !lamp.delta;
    lamp.cast_shadow = in.cast_shadow;
    lamp.has_program = in.has_program;
    lamp.program = in.program;
    lamp.random = in.random;
    lamp.visibility = in.visibility;
    lamp.lightgroup = in.lightgroup;
    lamp.max_bounces = in.max_bounces;
    lamp.emitter = NONE;
    return lamp;
}

bool lamp_emits(const LampView& lamp) { return finite_v(lamp.radiance) && max_component(abs_v(lamp.radiance)) > 0.0f; }

EmitterBounds lamp_bounds(const LampView& lamp) {
    EmitterBounds b{};
    float strength = luminance(abs_v(lamp.radiance));
    Vec3 extent = make_vec3(lamp.radius);
    b.axis = lamp.direction;
    if (lamp.kind == LampKind::SPHERE || lamp.kind == LampKind::DISK) {
        b.intensity = lamp.delta ? strength : strength * PI * lamp.radius * lamp.radius;
        b.omni = true;  // a spot within its cone
        b.normals_rad = lamp.spot ? 0.0f : PI;
        // A spot's cone starts anywhere on its ball; the box's own angle accounts for that.
        b.emission_rad = lamp.spot ? 2.0f * std::asin(std::sqrt(min_f(0.5f * lamp.spot_one_minus_cos, 1.0f))) : HALF_PI;
    } else {
        extent = abs_v(lamp.axis_u) * lamp.half_u + abs_v(lamp.axis_v) * lamp.half_v;
        float peak = 1.0f;
        b.emission_rad = HALF_PI;
        if (lamp.delta) {
            b.emission_rad = NARROWEST_BEAM;
        } else if (lamp.tan_half_spread != INFINITE_DISTANCE) {
            b.emission_rad = std::atan(lamp.tan_half_spread);
            peak = lamp.tan_half_spread * lamp.spread_scale;
        }
        b.intensity = strength * lamp.area * peak;
    }
    b.low = lamp.position - extent;
    b.high = lamp.position + extent;
    b.intensity = clamp_f(b.intensity, 1e-30f, 1e30f);
    return b;
}

}  // namespace luch::cpu
