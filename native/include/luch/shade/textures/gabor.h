// Gabor Texture: sums of windowed waves at random places.
// Sources: Lagae et al. 2009 (the noise), Tavernier et al. 2019 (weights and normalisation),
// Tricard et al. 2019 (phase and intensity); a Hann window ends each kernel at unit distance.
//
// operation  inputs                                              outputs                          params
// GABOR_2D   0..2 vector, 3 scale, 4 frequency, 5 anisotropy,    0 value, 1 phase, 2 intensity    none
//            6 orientation (radians), 7..9 orientation (vector)
// GABOR_3D   the same                                            the same                         none
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/textures/hash.h"
#include "luch/shade/textures/lane_op.h"

namespace luch {

// A wave with a direction and a frequency: real and imaginary part of its complex amplitude.
template <class F>
struct Phasor {
    F re, im;
};

inline constexpr int GABOR_IMPULSES = 8;  // per cell

template <int D>
struct OpGabor : LaneOp<OpGabor<D>> {
    static constexpr int inputs = 10, outputs = 3, params = 0;

    template <class F>
    LUCH_FN static void run(const u32*, const F* in, F* out) {
        // Six standard deviations span the values; a kernel's integral squared is 1/4 (2D), 1/(4 sqrt 2) (3D).
        const float range = 6.0f * sqrt_f(float(GABOR_IMPULSES) * 0.5f * (D == 2 ? 0.25f : 0.17677669529663687f));
        Setup<F> s;
        s.frequency = lane_max(in[4], spread<F>(GABOR_LEAST_FREQUENCY));
        s.isotropy = 1.0f - lane_clamp(in[5], 0.0f, 1.0f);
        s.angle = in[6];
        if constexpr (D == 3) s.set_axis(in + 7);
        const Phasor<F> sum = noise(texture_coord<F, D>(in, F{}, in[3]), s);
        out[0] = lane_tame(sum.im * (0.5f / range) + 0.5f);
        out[1] = lane_tame((lane_atan2(sum.im, sum.re) + PI) * (0.5f * INV_PI));
        out[2] = lane_tame(lane_sqrt(sum.re * sum.re + sum.im * sum.im) * (1.0f / range));
    }

 private:
    template <class F>
    struct Setup {
        F frequency, isotropy;
        F angle;                 // 2D: orientation, radians
        F axis[3];               // 3D: orientation, unit
        F inclination, azimuth;  // of axis

        LUCH_FN void set_axis(const F* v) {
            const F length = lane_sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            for (int d = 0; d < 3; d++) axis[d] = v[d] / length;
            inclination = lane_acos(axis[2]);
            const F flat = lane_sqrt(axis[0] * axis[0] + axis[1] * axis[1]);
            const F around = lane_acos(axis[0] / flat);
            azimuth = select(axis[1] < 0.0f, -around, around);
        }
    };

    template <class F>
    LUCH_FN static F random_of(const F (&cell)[D], float seed, int which) {
        const F s = spread<F>(seed);
        if constexpr (D == 2) {
            return which == 0 ? hash_unit(cell[0], cell[1], s) : hash_unit(s, cell[0], cell[1]);
        } else {
            if (which == 0) return hash_unit(cell[0], cell[1], cell[2], s);
            if (which == 1) return hash_unit(cell[2], cell[0], s, cell[1]);
            return hash_unit(s, cell[2], cell[1], cell[0]);
        }
    }

    // The kernel's phase at an offset from its centre.
    template <class F>
    LUCH_FN static F phase(const F (&cell)[D], int impulse, const F (&v)[D], const Setup<F>& s) {
        const float seed = float(3 * impulse);
        if constexpr (D == 2) {
            const F angle = s.angle + (random_of(cell, seed, 0) - 0.5f) * PI * s.isotropy;
            return TWO_PI * s.frequency * (v[0] * lane_cos(angle) + v[1] * lane_sin(angle));
        } else {
            const F theta = s.inclination + random_of(cell, seed, 0) * PI * s.isotropy;
            const F phi = s.azimuth + random_of(cell, seed, 1) * PI * s.isotropy;
            const auto fixed = s.isotropy == 0.0f;
            const F sine = lane_sin(theta);
            const F x = select(fixed, s.axis[0], sine * lane_cos(phi));
            const F y = select(fixed, s.axis[1], sine * lane_sin(phi));
            const F z = select(fixed, s.axis[2], lane_cos(theta));
            return TWO_PI * s.frequency * (v[0] * x + v[1] * y + v[2] * z);
        }
    }

    template <class F>
    LUCH_FN_SLOW static void add_cell(const F (&cell)[D], const F (&place)[D], const Setup<F>& s, Phasor<F>& sum) {
        for (int impulse = 0; impulse < GABOR_IMPULSES; impulse++) {
            F v[D];
            F distance_2 = F{};
            LUCH_UNROLL for (int d = 0; d < D; d++) {
                v[d] = place[d] - random_of(cell, float(3 * impulse + 1), d);
                distance_2 = distance_2 + v[d] * v[d];
            }
            const auto inside = distance_2 < 1.0f;
            if (!any_lane(inside)) continue;
            const F sign = select(random_of(cell, float(3 * impulse + 2), 0) < 0.5f, spread<F>(-1.0f), spread<F>(1.0f));
            const F envelope = lane_exp(-PI * distance_2) * (0.5f + 0.5f * lane_cos(PI * distance_2));
            const F weight = select(inside, sign * envelope, F{});
            const F angle = phase(cell, impulse, v, s);
            sum.re = sum.re + weight * lane_cos(angle);
            sum.im = sum.im + weight * lane_sin(angle);
        }
    }

    template <class F>
    LUCH_FN static Phasor<F> noise(const Coord<F, D>& p, const Setup<F>& s) {
        F base[D];
        for (int d = 0; d < D; d++) base[d] = lane_floor(lane_tame(p.x[d]));
        Phasor<F> sum{};
        for (int n = 0; n < (D == 2 ? 9 : 27); n++) {
            const float step[3] = {float(n % 3 - 1), float(n / 3 % 3 - 1), float(n / 9 - 1)};
            F cell[D], place[D];
            for (int d = 0; d < D; d++) {
                cell[d] = base[d] + step[d];
                place[d] = lane_tame(p.x[d]) - base[d] - step[d];
            }
            add_cell(cell, place, s, sum);
        }
        return sum;
    }
};
using OpGabor2D = OpGabor<2>;
using OpGabor3D = OpGabor<3>;

}  // namespace luch
