// Panoramas: which way a place in the picture looks, and where a direction is seen. Camera space: forward, left, up.
//
// The plane (CameraView) is, for each kind:
//   EQUIRECTANGULAR      longitude, rising to the left, and colatitude, radians
//   FISHEYE_EQUIDISTANT  -1..1 over the frame; the angle from the axis grows evenly to half the field of view at 1
//   FISHEYE_EQUISOLID    millimetres on the sensor; radius = 2 lens sin(angle / 2)
//   FISHEYE_POLYNOMIAL   millimetres on the sensor; -angle = k0 + k1 r + ... + k4 r^4, as lens calibrations state it
//   MIRROR_BALL          -1..1 over the frame: a distant view of a polished ball
//   CUBE_FACE            -1..1 over the frame: a quarter turn each way, evenly in angle along the axes
//   CYLINDER             angle, rising to the right, and height on a cylinder of radius 1
#pragma once
#include "luch/math/fn.h"
#include "luch/math/vec.h"

namespace luch {

enum class CameraKind : u8 {
    PERSPECTIVE,
    ORTHOGRAPHIC,
    EQUIRECTANGULAR,  // from here on: all around
    FISHEYE_EQUIDISTANT,
    FISHEYE_EQUISOLID,
    FISHEYE_POLYNOMIAL,
    MIRROR_BALL,
    CUBE_FACE,
    CYLINDER,
};

LUCH_FN bool is_panorama(CameraKind kind) { return kind >= CameraKind::EQUIRECTANGULAR; }

struct FisheyeView {
    float half_fov, lens_mm;  // radians
    float k[5];
};

// A direction at an angle from the axis, towards a place in the picture.
LUCH_FN Vec3 towards(Vec2 plane, float radius, float angle) {
    float out = safe_divide(sin_f(angle), radius);
    return {cos_f(angle), -plane.x * out, plane.y * out};
}

LUCH_FN float polynomial_angle(const FisheyeView& f, float r) {
    return -(f.k[0] + r * (f.k[1] + r * (f.k[2] + r * (f.k[3] + r * f.k[4]))));
}

// Unit; false where the lens shows nothing.
LUCH_FN bool panorama_direction(CameraKind kind, const FisheyeView& f, Vec2 p, Vec3* direction) {
    float radius = sqrt_f(p.x * p.x + p.y * p.y), angle = 0.0f;
    if (kind == CameraKind::EQUIRECTANGULAR) {
        float sin_theta = sin_f(p.y);
        *direction = {sin_theta * cos_f(p.x), sin_theta * sin_f(p.x), cos_f(p.y)};
        return true;
    }
    if (kind == CameraKind::CUBE_FACE) {
        *direction = normalize(Vec3{1.0f, -tan_f(0.25f * PI * p.x), tan_f(0.25f * PI * p.y)});
        return true;
    }
    if (kind == CameraKind::CYLINDER) {
        *direction = normalize(Vec3{cos_f(p.x), -sin_f(p.x), p.y});
        return true;
    }
    bool seen = radius <= 1.0f;
    if (kind == CameraKind::FISHEYE_EQUIDISTANT) {
        angle = radius * f.half_fov;
    } else if (kind == CameraKind::MIRROR_BALL) {
        angle = 2.0f * asin_f(min_f(radius, 1.0f));
    } else if (kind == CameraKind::FISHEYE_EQUISOLID) {
        seen = radius <= 2.0f * f.lens_mm * sin_f(0.5f * f.half_fov);
        angle = 2.0f * asin_f(min_f(safe_divide(radius, 2.0f * f.lens_mm), 1.0f));
    } else {
        angle = polynomial_angle(f, radius);
        seen = abs_f(angle) <= f.half_fov;
    }
    *direction = towards(p, radius, angle);
    return seen;
}

// The radius at which a lens shows an angle from its axis.
LUCH_FN float panorama_radius(CameraKind kind, const FisheyeView& f, float angle) {
    if (kind == CameraKind::FISHEYE_EQUIDISTANT) return safe_divide(angle, f.half_fov);
    if (kind == CameraKind::MIRROR_BALL) return sin_f(0.5f * angle);
    if (kind == CameraKind::FISHEYE_EQUISOLID) return 2.0f * f.lens_mm * sin_f(0.5f * angle);
    float r = safe_divide(-(angle + f.k[0]), f.k[1]);
    for (int step = 0; step < 12; ++step) {  // Newton's: lenses are close to linear
        float slope = -(f.k[1] + r * (2.0f * f.k[2] + r * (3.0f * f.k[3] + r * 4.0f * f.k[4])));
        r -= safe_divide(polynomial_angle(f, r) - angle, slope);
    }
    return r;
}

// The inverse of panorama_direction. q: any length.
LUCH_FN Vec2 panorama_plane(CameraKind kind, const FisheyeView& f, Vec3 q) {
    if (kind == CameraKind::EQUIRECTANGULAR) return {atan2_f(q.y, q.x), acos_f(safe_divide(q.z, length(q)))};
    if (kind == CameraKind::CYLINDER) return {-atan2_f(q.y, q.x), safe_divide(q.z, sqrt_f(q.x * q.x + q.y * q.y))};
    if (kind == CameraKind::CUBE_FACE) {
        float scale = 4.0f / PI;
        return {-atan_f(safe_divide(q.y, q.x)) * scale, atan_f(safe_divide(q.z, q.x)) * scale};
    }
    float across = sqrt_f(q.y * q.y + q.z * q.z);
    float radius = panorama_radius(kind, f, atan2_f(across, q.x));
    return {-safe_divide(q.y, across) * radius, safe_divide(q.z, across) * radius};
}

}  // namespace luch
