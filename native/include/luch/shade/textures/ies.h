// IES Texture: the measured brightness of a luminaire by direction. The table is made by luch/ies.py:
// how many horizontal angles H, how many vertical ones V, the H and the V angles in radians, then H rows
// of V values. The first horizontal angle is 0, the last 2 pi, with equal rows.
//
// operation  inputs                     outputs   params
// IES        0..2 vector, 3 strength    0 factor  0 table offset
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/scene_view.h"

namespace luch {

// Catmull-Rom spline through b (t = 0) and c (t = 1).
LUCH_FN float catmull_rom(float a, float b, float c, float d, float t) {
    const float cubic = d + 3.0f * (b - c) - a, square = 2.0f * a - 5.0f * b + 4.0f * c - d;
    return 0.5f * ((cubic * t + square) * t + (c - a)) * t + b;
}

// The interval of a sorted list that holds x: list[i] < x <= list[i + 1], i <= count - 2.
LUCH_FN int find_interval(const float* list, int count, float x) {
    int low = 0, high = count - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (list[middle] < x) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

struct OpIes {
    static constexpr int inputs = 4, outputs = 1, params = 1;

    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        const Vec3 v = normalize_or({in[0], in[1], in[2]}, {0.0f, 0.0f, 0.0f});
        const float value = is_zero(v) ? 0.0f : brightness(table_of(c, params[0]), v);
        out[0] = in[3] * value;
    }

 private:
    struct Rows {
        const float* values;
        int count;  // vertical angles
        int at;
        float t;
        bool from_pole;  // the angles begin at a pole, beyond which the row goes on mirrored
    };

    LUCH_FN static float brightness(const float* table, Vec3 v) {
        const int h_count = int(table[0]), v_count = int(table[1]);
        const float *h_angles = table + 2, *v_angles = h_angles + h_count;
        const float down = acos_f(-v.z), around = atan2_f(v.x, v.y) + PI;
        if (!(down >= v_angles[0] && down < v_angles[v_count - 1])) return 0.0f;
        if (!(around >= h_angles[0] && around < h_angles[h_count - 1])) return 0.0f;
        const int i = find_interval(v_angles, v_count, down), j = find_interval(h_angles, h_count, around);
        const Rows rows{v_angles + v_count, v_count, i, (down - v_angles[i]) / (v_angles[i + 1] - v_angles[i]),
                        v_angles[0] < IES_POLE};
        // Past the first and the last row nearer ones stand in, as in Cycles.
        const float before = along_row(rows, j > 0 ? j - 1 : j);
        const float after = along_row(rows, j + 2 < h_count ? j + 2 : j);
        const float t = (around - h_angles[j]) / (h_angles[j + 1] - h_angles[j]);
        return max_f(catmull_rom(before, along_row(rows, j), along_row(rows, j + 1), after, t), 0.0f);
    }

    LUCH_FN static float along_row(const Rows& r, int row) {
        const float* f = r.values + row * r.count;
        const float b = f[r.at], c = f[r.at + 1];
        const float a = r.at > 0 ? f[r.at - 1] : (r.from_pole ? f[1] : b);
        const float d = r.at + 2 < r.count ? f[r.at + 2] : c;
        return catmull_rom(a, b, c, d, r.t);
    }
};

}  // namespace luch
