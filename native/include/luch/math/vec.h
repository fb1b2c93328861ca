// Small vectors. Plain data, free functions; every operation is IEEE single precision in the order
// written (the build forbids contraction), so the CPU and CUDA agree bit for bit.
#pragma once
#include "luch/platform.h"

namespace luch {

LUCH_FN float min_f(float a, float b) { return a < b ? a : b; }  // a NaN in a gives b
LUCH_FN float max_f(float a, float b) { return a > b ? a : b; }  // a NaN in a gives b
LUCH_FN float clamp_f(float x, float lo, float hi) { return min_f(max_f(x, lo), hi); }
LUCH_FN float saturate_f(float x) { return clamp_f(x, 0.0f, 1.0f); }
LUCH_FN float sqr(float x) { return x * x; }
LUCH_FN float abs_f(float x) { return __builtin_fabsf(x); }
LUCH_FN float sqrt_f(float x) { return __builtin_sqrtf(x); }
LUCH_FN float safe_sqrt(float x) { return __builtin_sqrtf(max_f(x, 0.0f)); }
LUCH_FN float floor_f(float x) { return __builtin_floorf(x); }
LUCH_FN float copysign_f(float magnitude, float sign) { return __builtin_copysignf(magnitude, sign); }
LUCH_FN float mix_f(float a, float b, float t) { return a + t * (b - a); }
LUCH_FN float safe_divide(float a, float b) { return b != 0.0f ? a / b : 0.0f; }
LUCH_FN bool finite_f(float x) { return (float_bits(x) & 0x7f800000u) != 0x7f800000u; }

struct Vec2 {
    float x, y;
};

struct Vec3 {
    float x, y, z;
    LUCH_FN float operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
};

using Color = Vec3;  // scene-linear Rec.709 unless a name says otherwise

LUCH_FN Vec2 make_vec2(float x, float y) { return {x, y}; }
LUCH_FN Vec3 make_vec3(float x, float y, float z) { return {x, y, z}; }
LUCH_FN Vec3 make_vec3(float x) { return {x, x, x}; }

LUCH_FN Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
LUCH_FN Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
LUCH_FN Vec2 operator*(Vec2 a, float s) { return {a.x * s, a.y * s}; }

LUCH_FN Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
LUCH_FN Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
LUCH_FN Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
LUCH_FN Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
LUCH_FN Vec3 operator*(Vec3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
LUCH_FN Vec3 operator*(float s, Vec3 a) { return a * s; }
LUCH_FN Vec3 operator/(Vec3 a, Vec3 b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
LUCH_FN Vec3 operator/(Vec3 a, float s) { return a * (1.0f / s); }
LUCH_FN Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
LUCH_FN Vec3& operator*=(Vec3& a, Vec3 b) { return a = a * b; }
LUCH_FN Vec3& operator*=(Vec3& a, float s) { return a = a * s; }

LUCH_FN float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
LUCH_FN Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
LUCH_FN float length_squared(Vec3 a) { return dot(a, a); }
LUCH_FN float length(Vec3 a) { return sqrt_f(dot(a, a)); }
LUCH_FN Vec3 normalize(Vec3 a) { return a / length(a); }
// Unit vector, or fallback when the length is zero, denormal or not finite.
LUCH_FN Vec3 normalize_or(Vec3 a, Vec3 fallback) {
    float l = length(a);
    return (l > 1e-30f && l < 1e30f) ? a / l : fallback;
}
LUCH_FN float max_component(Vec3 a) { return max_f(a.x, max_f(a.y, a.z)); }
LUCH_FN float min_component(Vec3 a) { return min_f(a.x, min_f(a.y, a.z)); }
LUCH_FN float average(Vec3 a) { return (a.x + a.y + a.z) * (1.0f / 3.0f); }
LUCH_FN float luminance(Vec3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }
LUCH_FN Vec3 mix(Vec3 a, Vec3 b, float t) { return a + t * (b - a); }
LUCH_FN Vec3 min_v(Vec3 a, Vec3 b) { return {min_f(a.x, b.x), min_f(a.y, b.y), min_f(a.z, b.z)}; }
LUCH_FN Vec3 max_v(Vec3 a, Vec3 b) { return {max_f(a.x, b.x), max_f(a.y, b.y), max_f(a.z, b.z)}; }
LUCH_FN Vec3 abs_v(Vec3 a) { return {abs_f(a.x), abs_f(a.y), abs_f(a.z)}; }
LUCH_FN bool is_zero(Vec3 a) { return a.x == 0.0f && a.y == 0.0f && a.z == 0.0f; }
LUCH_FN bool finite_v(Vec3 a) { return finite_f(a.x) && finite_f(a.y) && finite_f(a.z); }
LUCH_FN Vec3 reflect(Vec3 w, Vec3 n) { return n * (2.0f * dot(n, w)) - w; }  // both point away

// Orthonormal basis around unit n (Duff et al. 2017, branchless, valid for n.z = -1).
LUCH_FN void make_frame(Vec3 n, Vec3* t, Vec3* b) {
    float sign = copysign_f(1.0f, n.z);
    float a = -1.0f / (sign + n.z);
    float c = n.x * n.y * a;
    *t = {1.0f + sign * n.x * n.x * a, sign * c, -sign * n.x};
    *b = {c, sign + n.y * n.y * a, -n.y};
}
LUCH_FN Vec3 to_world(Vec3 local, Vec3 t, Vec3 b, Vec3 n) { return t * local.x + b * local.y + n * local.z; }

// Row-major 3x4 affine matrix: rows are x, y, z of the result.
struct Affine {
    float m[12];
};
LUCH_FN Vec3 transform_point(const Affine& a, Vec3 p) {
    return {a.m[0] * p.x + a.m[1] * p.y + a.m[2] * p.z + a.m[3], a.m[4] * p.x + a.m[5] * p.y + a.m[6] * p.z + a.m[7],
            a.m[8] * p.x + a.m[9] * p.y + a.m[10] * p.z + a.m[11]};
}
LUCH_FN Vec3 transform_direction(const Affine& a, Vec3 v) {
    return {a.m[0] * v.x + a.m[1] * v.y + a.m[2] * v.z, a.m[4] * v.x + a.m[5] * v.y + a.m[6] * v.z,
            a.m[8] * v.x + a.m[9] * v.y + a.m[10] * v.z};
}
// Multiplies by the transpose of the linear part: normals, given the inverse of the point transform.
LUCH_FN Vec3 transform_direction_transposed(const Affine& a, Vec3 v) {
    return {a.m[0] * v.x + a.m[4] * v.y + a.m[8] * v.z, a.m[1] * v.x + a.m[5] * v.y + a.m[9] * v.z,
            a.m[2] * v.x + a.m[6] * v.y + a.m[10] * v.z};
}

}  // namespace luch
