// Interference in a thin film over a dielectric or a conductor: Airy's sum over the paths that cross
// the film, with the wavelengths of each colour channel integrated beforehand.
// Source: Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of
// Varying Iridescence".
#pragma once
#include "luch/bsdf/closure.h"
#include "luch/bsdf/film_table.h"
#include "luch/bsdf/fresnel.h"
#include "luch/math/bounds.h"

namespace luch {

struct Complex {
    float re, im;
};
LUCH_FN Complex operator*(Complex a, Complex b) { return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }

// What a colour channel keeps of a wave whose path is longer by this much.
LUCH_FN Complex film_sensitivity(int channel, float path_nm) {
    float x = saturate_f(path_nm * (1.0f / FILM_TABLE_LONGEST_NM)) * (FILM_TABLE_SIZE - 1);
    int i = static_cast<int>(x);
    int j = i + 1 < FILM_TABLE_SIZE ? i + 1 : i;
    float t = x - static_cast<float>(i);
    const float* re = FILM_SENSITIVITY + 2 * channel * FILM_TABLE_SIZE;
    const float* im = re + FILM_TABLE_SIZE;
    return {mix_f(re[i], re[j], t), mix_f(im[i], im[j], t)};
}

// The film's upper face and the way through it: the same for all channels.
struct FilmPath {
    bool total_reflection;
    float ior;       // of the film over the outside
    float cos_film;  // of the ray in the film, positive
    Polarized upper; // amplitudes at the upper face
    float path_nm;   // one crossing and back, beside the direct reflection
};
LUCH_FN FilmPath film_path(float thickness_nm, float film_ior, float cos_i) {
    FilmPath f;
    // Films below a nanometre fade out: waves do not see them.
    float t = min_f(thickness_nm, 1.0f);
    f.ior = mix_f(1.0f, film_ior, t * t * (3.0f - 2.0f * t));
    f.total_reflection = !dielectric_amplitudes(cos_i, f.ior, &f.upper, &f.cos_film);
    f.path_nm = f.total_reflection ? 0.0f : 2.0f * f.ior * thickness_nm * f.cos_film;
    return f;
}

// Airy's sum of one polarisation and channel. `upper`, `lower`: reflectances of the two faces;
// `phase`: exp(i phi) of one more crossing.
LUCH_FN float airy_sum(int channel, float upper, float lower, float path_nm, Complex phase) {
    float through = 1.0f - upper, both = upper * lower;
    float series = sqr(through) * lower / (1.0f - both);
    float sum = series + upper, amplitude = series - through, ratio = sqrt_f(both);
    Complex turn = phase;
    for (int order = 1; order < 4; ++order) {  // higher orders have no visible part
        amplitude *= ratio;
        Complex s = film_sensitivity(channel, static_cast<float>(order) * path_nm);
        sum += 2.0f * amplitude * (turn.re * s.re + turn.im * s.im);
        turn = turn * phase;
    }
    return sum;
}

// A reflection at a denser medium turns the wave over: the sign of its amplitude.
LUCH_FN float turn_over(float amplitude) { return amplitude >= 0.0f ? 1.0f : -1.0f; }

// Film over a dielectric of index eta. cos_t: of the ray in the dielectric, kept on total reflection.
LUCH_FN_SLOW Color film_over_dielectric(float thickness_nm, float film_ior, float eta, float cos_i, float* cos_t) {
    FilmPath f = film_path(thickness_nm, film_ior, cos_i);
    Polarized lower;
    if (f.total_reflection || !dielectric_amplitudes(f.cos_film, eta / f.ior, &lower, cos_t)) return make_vec3(1.0f);
    Complex phase_s = {-turn_over(lower.s) * turn_over(f.upper.s), 0.0f};
    Complex phase_p = {-turn_over(lower.p) * turn_over(f.upper.p), 0.0f};
    float r[3];
    for (int i = 0; i < 3; ++i)
        r[i] = saturate_f(0.5f * (airy_sum(i, sqr(f.upper.s), sqr(lower.s), f.path_nm, phase_s) +
                                  airy_sum(i, sqr(f.upper.p), sqr(lower.p), f.path_nm, phase_p)));
    return {r[0], r[1], r[2]};
}

LUCH_FN Complex unit_phase(float re, float im) {
    float modulus = sqrt_f(re * re + im * im);
    return modulus == 0.0f ? Complex{1.0f, 0.0f} : Complex{re / modulus, im / modulus};
}

// Film over a conductor n + ik, one channel. f82 >= 0: the F82 curve with that value at 82 degrees
// gives the lower face's reflectance, n and k only its phase.
LUCH_FN float film_over_conductor(const FilmPath& f, int channel, float n, float k, float f82) {
    if (f.total_reflection) return 1.0f;
    float c = f.cos_film;
    ConductorWave w = conductor_wave(c, f.ior, n, k);
    Polarized lower = conductor_reflectance(c, f.ior, n, k, w);
    if (f82 >= 0.0f) {
        float rel_n = n / f.ior, rel_k2 = sqr(k / f.ior);
        float f0 = (sqr(rel_n - 1.0f) + rel_k2) / (sqr(rel_n + 1.0f) + rel_k2);
        lower.s = lower.p = fresnel_f82(c, f0, f82_bend(f0, f82));
    }
    float nk = 2.0f * n * k, nn_kk = n * n - k * k;
    Complex s = unit_phase(sqr(f.ior * c) - w.u2 - w.v2, -2.0f * f.ior * c * w.v);
    Complex p =
        unit_phase(sqr((n * n + k * k) * c) - sqr(f.ior) * (w.u2 + w.v2), 2.0f * f.ior * c * (nk * w.u - nn_kk * w.v));
    float turn_s = -turn_over(f.upper.s), turn_p = -turn_over(f.upper.p);
    float sum = airy_sum(channel, sqr(f.upper.s), lower.s, f.path_nm, {s.re * turn_s, s.im * turn_s}) +
                airy_sum(channel, sqr(f.upper.p), lower.p, f.path_nm, {p.re * turn_p, p.im * turn_p});
    return saturate_f(0.5f * sum);
}

LUCH_FN_SLOW Color film_over_metal(float thickness_nm, float film_ior, Vec3 n, Vec3 k, float cos_i) {
    FilmPath f = film_path(thickness_nm, film_ior, cos_i);
    return {film_over_conductor(f, 0, n.x, k.x, -1.0f), film_over_conductor(f, 1, n.y, k.y, -1.0f),
            film_over_conductor(f, 2, n.z, k.z, -1.0f)};
}

// n and k of an F82 metal: F0 and the value at 82 degrees read as reflectance and edge tint.
// Source: Gulbrandsen 2014, "Artist Friendly Metallic Fresnel".
LUCH_FN float film_over_f82(const FilmPath& f, int channel, float f0, float b) {
    float r = min_f(f0, FILM_MOST_F0);
    float edge = fresnel_f82(F82_COSINE, f0, b);
    float root = sqrt_f(r);
    float n = mix_f((1.0f + root) / (1.0f - root), (1.0f - r) / (1.0f + r), edge);
    float k = safe_sqrt((r * sqr(n + 1.0f) - sqr(n - 1.0f)) / (1.0f - r));
    return film_over_conductor(f, channel, n, k, edge);
}
LUCH_FN_SLOW Color film_over_f82(float thickness_nm, float film_ior, Color f0, Color b, float cos_i) {
    FilmPath f = film_path(thickness_nm, film_ior, cos_i);
    return {film_over_f82(f, 0, f0.x, b.x), film_over_f82(f, 1, f0.y, b.y), film_over_f82(f, 2, f0.z, b.z)};
}

}  // namespace luch
