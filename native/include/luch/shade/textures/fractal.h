// Sums of gradient noise over octaves. Source of the multifractals: Musgrave in "Texturing and
// Modeling: A Procedural Approach", 3rd edition, 2003; semantics as in Blender's Noise Texture.
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/textures/perlin.h"

namespace luch {

enum class FractalType : u32 { MULTIFRACTAL, FBM, HYBRID, RIDGED, HETERO_TERRAIN };

template <class F>
struct FractalSettings {
    F detail;  // octaves beyond the first, 0..15; the fraction fades the last one in
    F roughness, lacunarity, offset, gain;
};

// Which lanes have octave i, and how many octaves the longest lane has.
template <class F>
struct Octaves {
    F whole, fraction;
    int longest;
    bool fractional;

    LUCH_FN explicit Octaves(F detail) {
        whole = lane_floor(detail);
        fraction = detail - whole;
        longest = int(largest_lane(whole));
        fractional = any_lane(fraction != 0.0f);
    }
    LUCH_FN MaskOf<F> has(int i) const { return whole >= float(i); }
};

// Fractional Brownian motion. normalize: to [0, 1], else centred on zero.
template <class F, int D>
LUCH_FN F fractal_fbm(Coord<F, D> p, const FractalSettings<F>& s, bool normalize) {
    const Octaves<F> octaves(s.detail);
    F frequency = spread<F>(1.0f), amplitude = frequency, total = F{}, sum = F{};
    for (int i = 0; i <= octaves.longest; i++) {
        const auto live = octaves.has(i);
        sum = select(live, sum + signed_noise<F, D>(p * frequency) * amplitude, sum);
        total = select(live, total + amplitude, total);
        amplitude = select(live, amplitude * s.roughness, amplitude);
        frequency = select(live, frequency * s.lacunarity, frequency);
    }
    F value = normalize ? 0.5f * sum / total + 0.5f : sum;
    if (octaves.fractional) {
        const F more = sum + signed_noise<F, D>(p * frequency) * amplitude;
        const F last = normalize ? 0.5f * more / (total + amplitude) + 0.5f : more;
        value = select(octaves.fraction != 0.0f, lane_mix(value, last, octaves.fraction), value);
    }
    return value;
}

template <class F, int D>
LUCH_FN F fractal_multi(Coord<F, D> p, const FractalSettings<F>& s) {
    const Octaves<F> octaves(s.detail);
    F value = spread<F>(1.0f), power = value;
    for (int i = 0; i <= octaves.longest; i++) {
        const auto live = octaves.has(i);
        value = select(live, value * (power * signed_noise<F, D>(p) + 1.0f), value);
        power = select(live, power * s.roughness, power);
        p = p * select(live, s.lacunarity, spread<F>(1.0f));
    }
    if (octaves.fractional) {
        value = value * (octaves.fraction * power * signed_noise<F, D>(p) + 1.0f);
    }
    return value;
}

template <class F, int D>
LUCH_FN F fractal_hetero(Coord<F, D> p, const FractalSettings<F>& s) {
    const Octaves<F> octaves(s.detail);
    F power = s.roughness;
    F value = s.offset + signed_noise<F, D>(p);
    p = p * s.lacunarity;
    for (int i = 1; i <= octaves.longest; i++) {
        const auto live = octaves.has(i);
        value = select(live, value + (signed_noise<F, D>(p) + s.offset) * power * value, value);
        power = select(live, power * s.roughness, power);
        p = p * select(live, s.lacunarity, spread<F>(1.0f));
    }
    if (octaves.fractional) {
        value = value + octaves.fraction * ((signed_noise<F, D>(p) + s.offset) * power * value);
    }
    return value;
}

template <class F, int D>
LUCH_FN F fractal_hybrid(Coord<F, D> p, const FractalSettings<F>& s) {
    const F one = spread<F>(1.0f);
    const Octaves<F> octaves(s.detail);
    F power = one, weight = one, value = F{};
    auto live = weight > FRACTAL_CUTOFF;  // a lane whose weight has died stays dead
    for (int i = 0; i <= octaves.longest; i++) {
        live = live & octaves.has(i) & (weight > FRACTAL_CUTOFF);
        if (!any_lane(live)) break;
        const F w = lane_min(weight, one);
        const F signal = (signed_noise<F, D>(p) + s.offset) * power;
        power = select(live, power * s.roughness, power);
        value = select(live, value + w * signal, value);
        weight = select(live, w * (s.gain * signal), weight);
        p = p * select(live, s.lacunarity, one);
    }
    if (octaves.fractional) {
        const F w = lane_min(weight, one);
        const F signal = (signed_noise<F, D>(p) + s.offset) * power;
        value = select(weight > FRACTAL_CUTOFF, value + octaves.fraction * w * signal, value);
    }
    return value;
}

// The fraction of detail has no effect here (as in Blender).
template <class F, int D>
LUCH_FN F fractal_ridged(Coord<F, D> p, const FractalSettings<F>& s) {
    const Octaves<F> octaves(s.detail);
    F power = s.roughness;
    F signal = s.offset - lane_abs(signed_noise<F, D>(p));
    signal = signal * signal;
    F value = signal;
    for (int i = 1; i <= octaves.longest; i++) {
        p = p * s.lacunarity;
        const F weight = lane_clamp(signal * s.gain, 0.0f, 1.0f);
        const F ridge = s.offset - lane_abs(signed_noise<F, D>(p));
        signal = ridge * ridge * weight;
        value = select(octaves.has(i), value + signal * power, value);
        power = power * s.roughness;
    }
    return value;
}

template <class F, int D>
LUCH_FN_SLOW F fractal_noise(Coord<F, D> p, const FractalSettings<F>& s, FractalType type, bool normalize) {
    if (type == FractalType::FBM) return fractal_fbm<F, D>(p, s, normalize);
    if (type == FractalType::MULTIFRACTAL) return fractal_multi<F, D>(p, s);
    if (type == FractalType::HYBRID) return fractal_hybrid<F, D>(p, s);
    if (type == FractalType::RIDGED) return fractal_ridged<F, D>(p, s);
    return fractal_hetero<F, D>(p, s);
}

}  // namespace luch
