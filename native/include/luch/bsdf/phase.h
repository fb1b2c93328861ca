// Phase functions: where a medium scatters light. A lobe is one function with its coefficient; all are functions of the
// angle between the old and the new direction of travel, normalised over the sphere, and sampled exactly.
//
// Henyey-Greenstein has formulas. The others (Draine with Rayleigh, Fournier-Forand) are tables of their density over
// t = sin^2(angle / 2), made in double by cpu/volume/phase_tables.cpp: straight from knot to knot, so that a sample and
// its density fit each other however sharp the function is.
#pragma once
#include "luch/math/fn.h"
#include "luch/sampling/warp.h"

namespace luch {

enum class PhaseKind : u32 { HENYEY_GREENSTEIN, TABLE };

struct PhaseLobe {
    PhaseKind kind;
    float g;  // HENYEY_GREENSTEIN: mean cosine, inside (-1, 1). TABLE: below 0, the table holds the mirrored one
    u32 table;  // TABLE: offset into the scene's phase tables
    Color sigma_s;  // scattering coefficient, per metre
};

// Knots of a table: t, then the density per steradian at them, then the probability below them.
inline constexpr u32 PHASE_KNOTS = 2049;

// Of two unit vectors, exact for small angles: sin^2 of half the angle between them.
LUCH_FN float half_angle_square(Vec3 a, Vec3 b) { return min_f(0.25f * length_squared(a - b), 1.0f); }

// The knot at or before t, so that the next one exists. knots: ascending, PHASE_KNOTS of them.
LUCH_FN u32 phase_interval(const float* knots, float t) {
    u32 low = 0, high = PHASE_KNOTS - 1u;
    while (high - low > 1u) {
        u32 middle = (low + high) / 2u;
        if (knots[middle] <= t)
            low = middle;
        else
            high = middle;
    }
    return low;
}

LUCH_FN float table_phase(const float* table, float t) {
    u32 i = phase_interval(table, t);
    const float* density = table + PHASE_KNOTS;
    return mix_f(density[i], density[i + 1u], saturate_f((t - table[i]) / (table[i + 1u] - table[i])));
}

// t of a sample. Within its interval the density is a line from a to b, whose integral is inverted.
LUCH_FN float sample_table_phase(const float* table, float u) {
    const float *density = table + PHASE_KNOTS, *below = table + 2u * PHASE_KNOTS;
    u32 i = phase_interval(below, u);
    float width = below[i + 1u] - below[i], share = width > 0.0f ? saturate_f((u - below[i]) / width) : 0.5f;
    float a = density[i], b = density[i + 1u], sum = a + b;
    float root = safe_sqrt(mix_f(a * a, b * b, share));
    float x = sum > 0.0f ? share * sum / (a + root) : share;
    return mix_f(table[i], table[i + 1u], saturate_f(x));
}

// forward, backward: half_angle_square of the new direction with the old one, and with its opposite.
LUCH_FN float henyey_greenstein_phase(float g, float forward, float backward) {
    float sharp = abs_f(g), t = g < 0.0f ? backward : forward;
    float root = sqr(1.0f - sharp) + 4.0f * sharp * t;
    return 0.25f * INV_PI * (1.0f - sharp) * (1.0f + sharp) / (root * sqrt_f(root));
}

LUCH_FN float sample_half_angle_square(float sharp, float u) {
    float p = 1.0f - sharp, q = (1.0f - u) / (p + 2.0f * sharp * u);
    return saturate_f(p * q * (p + sharp * p * q));
}

// Density per steradian of going on from direction `before` (unit) in direction `after` (unit).
LUCH_FN float eval_phase(const PhaseLobe& lobe, const float* tables, Vec3 before, Vec3 after) {
    float forward = half_angle_square(before, after), backward = half_angle_square(before, -after);
    if (lobe.kind == PhaseKind::HENYEY_GREENSTEIN) return henyey_greenstein_phase(lobe.g, forward, backward);
    return table_phase(tables + lobe.table, lobe.g < 0.0f ? backward : forward);
}

// A direction (unit) with that density.
LUCH_FN Vec3 sample_phase(const PhaseLobe& lobe, const float* tables, Vec3 before, Vec2 u) {
    float t = lobe.kind == PhaseKind::HENYEY_GREENSTEIN ? sample_half_angle_square(abs_f(lobe.g), u.x)
                                                        : sample_table_phase(tables + lobe.table, u.x);
    float cosine = 1.0f - 2.0f * t, sine = 2.0f * safe_sqrt(t * (1.0f - t)), s, c;
    sincos_turns(u.y, &s, &c);
    Vec3 axis = lobe.g < 0.0f ? -before : before, a, b;
    make_frame(axis, &a, &b);
    return normalize(to_world({sine * c, sine * s, cosine}, a, b, axis));
}

}  // namespace luch
