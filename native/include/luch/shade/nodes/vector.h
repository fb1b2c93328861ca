// Vector Math, Mapping and Vector Rotate, where components mix. What works on each component alone
// is a Math operation per component.
#pragma once
#include "luch/shade/op.h"

namespace luch {

LUCH_FN Vec3 load_vec3(const float* in) { return {in[0], in[1], in[2]}; }
LUCH_FN void store_vec3(float* out, Vec3 v) {
    out[0] = v.x;
    out[1] = v.y;
    out[2] = v.z;
}
// Unit vector; the zero vector stays what it is.
LUCH_FN Vec3 safe_normalize(Vec3 v) {
    float l = length(v);
    return v * (l != 0.0f ? 1.0f / l : 1.0f);
}

struct OpVectorAverage {
    static constexpr int inputs = 3, outputs = 1;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        out[0] = average(load_vec3(in));
    }
};
struct OpVectorCross {
    static constexpr int inputs = 6, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        store_vec3(out, cross(load_vec3(in), load_vec3(in + 3)));
    }
};
struct OpVectorProject {
    static constexpr int inputs = 6, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        Vec3 onto = load_vec3(in + 3);
        store_vec3(out, onto * safe_divide(dot(load_vec3(in), onto), dot(onto, onto)));
    }
};
struct OpVectorReflect {  // in: vector, normal (any length)
    static constexpr int inputs = 6, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        Vec3 v = load_vec3(in), n = safe_normalize(load_vec3(in + 3));
        store_vec3(out, v - n * (2.0f * dot(v, n)));
    }
};
struct OpVectorRefract {  // in: vector, normal (any length), ratio of indices
    static constexpr int inputs = 7, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        Vec3 v = load_vec3(in), n = safe_normalize(load_vec3(in + 3));
        float eta = in[6], c = dot(n, v);
        float k = 1.0f - eta * eta * (1.0f - c * c);  // below 0: total reflection, no refracted vector
        Vec3 refracted = v * eta - n * (eta * c + safe_sqrt(k));
        store_vec3(out, k < 0.0f ? make_vec3(0.0f) : refracted);
    }
};
struct OpVectorFaceforward {  // in: vector, incident, reference
    static constexpr int inputs = 9, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        float sign = dot(load_vec3(in + 6), load_vec3(in + 3)) < 0.0f ? 1.0f : -1.0f;
        store_vec3(out, load_vec3(in) * sign);
    }
};
struct OpVectorDot {
    static constexpr int inputs = 6, outputs = 1;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        out[0] = dot(load_vec3(in), load_vec3(in + 3));
    }
};
struct OpVectorDistance {
    static constexpr int inputs = 6, outputs = 1;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        out[0] = length(load_vec3(in) - load_vec3(in + 3));
    }
};
struct OpVectorLength {
    static constexpr int inputs = 3, outputs = 1;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        out[0] = length(load_vec3(in));
    }
};
struct OpVectorNormalize {
    static constexpr int inputs = 3, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        store_vec3(out, safe_normalize(load_vec3(in)));
    }
};

// Columns of the rotation by XYZ Euler angles (x first): out[0..2] is where the x axis goes.
struct OpEulerMatrix {
    static constexpr int inputs = 3, outputs = 9;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        float cx = cos_f(in[0]), cy = cos_f(in[1]), cz = cos_f(in[2]);
        float sx = sin_f(in[0]), sy = sin_f(in[1]), sz = sin_f(in[2]);
        store_vec3(out, {cy * cz, cy * sz, -sy});
        store_vec3(out + 3, {sy * sx * cz - cx * sz, sy * sx * sz + cx * cz, cy * sx});
        store_vec3(out + 6, {sy * cx * cz + sx * sz, sy * cx * sz - sx * cz, cy * cx});
    }
};
struct OpMatrixMultiply {  // in: vector, three columns
    static constexpr int inputs = 12, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        store_vec3(out, load_vec3(in + 3) * in[0] + load_vec3(in + 6) * in[1] + load_vec3(in + 9) * in[2]);
    }
};
struct OpMatrixMultiplyTransposed {  // the inverse of a rotation
    static constexpr int inputs = 12, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        Vec3 v = load_vec3(in);
        store_vec3(out, {dot(load_vec3(in + 3), v), dot(load_vec3(in + 6), v), dot(load_vec3(in + 9), v)});
    }
};

struct OpRotateAxis {  // in: vector, axis (zero: no rotation), angle in radians
    static constexpr int inputs = 7, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        Vec3 v = load_vec3(in), axis = load_vec3(in + 3);
        float l = length(axis);
        Vec3 k = axis * (l != 0.0f ? 1.0f / l : 0.0f);
        float c = cos_f(in[6]), s = sin_f(in[6]);
        Vec3 turned = v * c + cross(k, v) * s + k * (dot(k, v) * (1.0f - c));  // Rodrigues
        store_vec3(out, l != 0.0f ? turned : v);
    }
};

}  // namespace luch
