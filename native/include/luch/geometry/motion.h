// What moves while the shutter is open: transforms and points at *keys*, evenly spaced from time 0, when it opens, to time
// 1, when it closes, and what lies between them. The CPU and CUDA get the same bits from the same keys.
#pragma once
#include "luch/math/bounds.h"
#include "luch/math/fn.h"
#include "luch/math/vec.h"

namespace luch {

// What is traced without a time is seen at this one.
inline constexpr float SHUTTER_MIDDLE = 0.5f;

// A transform in parts that are blended each on its own, as Blender's renderers do: rotation after stretch (polar
// decomposition; Shoemake, Duff 1992), then a place. 64 bytes.
struct alignas(16) TransformKey {
    float rotation[4];  // unit quaternion x, y, z, w; neighbours lie on one side, so that the way is short
    float stretch[9];  // rows
    float place[3];
};

// What stays of a transform that keeps its rotation and stretch from key to key, as most that move do: all but the place.
struct Slide {
    double inverse[9];  // rows of the linear part's inverse
    float linear[9];  // rows
    u32 unused;
};

// Of an instance, into the keys; key_count 0: it stands still. slide: its number + 1; 0: it turns, or is stretched.
struct InstanceMotion {
    u32 first_key, key_count, slide;
};

// Between which keys a time lies, and how far from the first.
struct MotionPiece {
    u32 key;
    float share;
};
LUCH_FN MotionPiece motion_piece(u32 key_count, float time) {
    float at = saturate_f(time) * static_cast<float>(key_count - 1u);
    u32 key = static_cast<u32>(at);
    key = key < key_count - 2u ? key : key_count - 2u;
    return {key, at - static_cast<float>(key)};
}

// Never outside [a, b], so that a box around both ends holds what lies between.
LUCH_FN float between(float a, float b, float share) { return clamp_f(a + (b - a) * share, min_f(a, b), max_f(a, b)); }
LUCH_FN Vec3 between(Vec3 a, Vec3 b, float share) {
    return {between(a.x, b.x, share), between(a.y, b.y, share), between(a.z, b.z, share)};
}

// Along the great circle, at even speed. Between two that are the same: just that one, whatever the share.
LUCH_FN_SLOW void rotation_between(const float* a, const float* b, float share, float* out) {
    if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2] && a[3] == b[3]) {
        for (int i = 0; i < 4; ++i) out[i] = a[i];
        return;
    }
    float cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    float of_a = 1.0f - share, of_b = share;
    if (cosine <= SHORT_ARC_COSINE) {
        float angle = acos_f(max_f(cosine, -1.0f)), sine = sin_f(angle);
        of_a = sine > SMALLEST_ARC_SINE ? sin_f(of_a * angle) / sine : of_a;
        of_b = sine > SMALLEST_ARC_SINE ? sin_f(of_b * angle) / sine : of_b;
    }
    float sum = 0.0f;
    for (int i = 0; i < 4; ++i) {
        out[i] = of_a * a[i] + of_b * b[i];
        sum += out[i] * out[i];
    }
    float scale = sum > 0.0f ? 1.0f / sqrt_f(sum) : 0.0f;
    for (int i = 0; i < 4; ++i) out[i] *= scale;
}

LUCH_FN_SLOW Affine transform_between(const TransformKey& a, const TransformKey& b, float share) {
    float q[4];
    rotation_between(a.rotation, b.rotation, share, q);
    float x = q[0], y = q[1], z = q[2], w = q[3];
    float r[9] = {1.0f - 2.0f * (y * y + z * z), 2.0f * (x * y - z * w),        2.0f * (x * z + y * w),
                  2.0f * (x * y + z * w),        1.0f - 2.0f * (x * x + z * z), 2.0f * (y * z - x * w),
                  2.0f * (x * z - y * w),        2.0f * (y * z + x * w),        1.0f - 2.0f * (x * x + y * y)};
    float s[9];
    for (int i = 0; i < 9; ++i) s[i] = between(a.stretch[i], b.stretch[i], share);
    Affine out;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            out.m[4 * row + column] =
                r[3 * row] * s[column] + r[3 * row + 1] * s[3 + column] + r[3 * row + 2] * s[6 + column];
        out.m[4 * row + 3] = between(a.place[row], b.place[row], share);
    }
    return out;
}

LUCH_FN Affine transform_at(const TransformKey* keys, const InstanceMotion& motion, float time) {
    MotionPiece piece = motion_piece(motion.key_count, time);
    const TransformKey* key = keys + motion.first_key + piece.key;
    return transform_between(key[0], key[1], piece.share);
}

// Rows of the linear part's inverse. In double, to be rounded once: as near to the inverse as that of a still instance.
// Flat ones give what is not finite.
LUCH_FN_SLOW void invert_linear(const Affine& a, double* inverse) {
    double m[12];
    for (int i = 0; i < 12; ++i) m[i] = double(a.m[i]);
    double c0 = m[5] * m[10] - m[6] * m[9], c1 = m[6] * m[8] - m[4] * m[10], c2 = m[4] * m[9] - m[5] * m[8];
    double scale = 1 / (m[0] * c0 + m[1] * c1 + m[2] * c2);
    double rows[9] = {c0 * scale, (m[2] * m[9] - m[1] * m[10]) * scale, (m[1] * m[6] - m[2] * m[5]) * scale,
                      c1 * scale, (m[0] * m[10] - m[2] * m[8]) * scale, (m[2] * m[4] - m[0] * m[6]) * scale,
                      c2 * scale, (m[1] * m[8] - m[0] * m[9]) * scale,  (m[0] * m[5] - m[1] * m[4]) * scale};
    for (int i = 0; i < 9; ++i) inverse[i] = rows[i];
}
LUCH_FN Affine inverse_from(const double* inverse, Vec3 place) {
    double x = double(place.x), y = double(place.y), z = double(place.z);
    Affine out;
    for (int row = 0; row < 3; ++row) {
        const double* r = inverse + 3 * row;
        for (int column = 0; column < 3; ++column) out.m[4 * row + column] = float(r[column]);
        out.m[4 * row + 3] = float(-(r[0] * x + r[1] * y + r[2] * z));
    }
    return out;
}
LUCH_FN_SLOW Affine inverse_of(const Affine& a) {
    double inverse[9];
    invert_linear(a, inverse);
    return inverse_from(inverse, {a.m[3], a.m[7], a.m[11]});
}

LUCH_FN Vec3 place_at(const TransformKey* keys, const InstanceMotion& motion, float time) {
    MotionPiece piece = motion_piece(motion.key_count, time);
    const float *a = keys[motion.first_key + piece.key].place, *b = keys[motion.first_key + piece.key + 1u].place;
    return between({a[0], a[1], a[2]}, {b[0], b[1], b[2]}, piece.share);
}

// An instance's transforms at a time. What slides has the bits that it would have from its keys, for a tenth of the work.
LUCH_FN Affine to_object_at(const TransformKey* keys, const Slide* slides, const InstanceMotion& motion, float time) {
    if (motion.slide == 0u) return inverse_of(transform_at(keys, motion, time));
    return inverse_from(slides[motion.slide - 1u].inverse, place_at(keys, motion, time));
}
LUCH_FN Affine to_world_at(const TransformKey* keys, const Slide* slides, const InstanceMotion& motion, float time) {
    if (motion.slide == 0u) return transform_at(keys, motion, time);
    const float* l = slides[motion.slide - 1u].linear;
    Vec3 place = place_at(keys, motion, time);
    return {{l[0], l[1], l[2], place.x, l[3], l[4], l[5], place.y, l[6], l[7], l[8], place.z}};
}

// Of a mesh: rows of positions and normals at its keys, key by key; key_count 0: it keeps its shape. The same of its hair.
struct MeshMotion {
    u32 first_position, first_normal, key_count;
    u32 first_curve_point, curve_point_count, curve_key_count;
};

// Everything that moves; plain pointers, as in SceneView.
struct MotionView {
    const InstanceMotion* instances;  // by instance
    const TransformKey* keys;
    const Slide* slides;
    const MeshMotion* meshes;  // by mesh
    const float* positions;  // 3 a row
    const float* normals;  // 3 a row; as many a key as the mesh has
    const float* curve_points;  // 4 a row
};

}  // namespace luch
