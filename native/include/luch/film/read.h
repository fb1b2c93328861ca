// Passes read out of a film's sums, and what its marks tell of the error: one pixel at a time.
#pragma once
#include "luch/film/film.h"

namespace luch {

// How a pass is read from its row.
enum class PassKind : u32 {
    COMBINED,      // mean; exposure on colour; alpha from transparency
    LIGHT,         // mean, exposure
    DIVIDED_LIGHT, // divided by the colour pass, exposure
    MEAN,          // mean
    FIRST,         // as it is
    DEPTH,         // as it is, 0 becomes 1e10
    MIST,          // 1 - mean
    TOTAL,         // sum, as it is
    SAMPLE_COUNT,
    CRYPTO,        // ids as they are, mean weights, sorted by weight
};

// Where a pass comes from. A device gets the same bytes.
struct PassSource {
    PassKind kind;
    u32 channels;        // of the result
    u32 channel;         // in the row
    u32 divisor = NONE;  // DIVIDED_LIGHT: channel of the colour pass
    u32 layer = 0;       // CRYPTO: which pair of slots
};

// All that a device must be told of a pass beside its film. Passed by value.
struct PassRead {
    PassSource from;
    FilmSum exposure;
};

inline constexpr u32 MOST_CRYPTO_SLOTS = 16;

LUCH_FN FilmSum within(FilmSum x, FilmSum lo, FilmSum hi) { return x < lo ? lo : x > hi ? hi : x; }

// A sum as the nearest float, without turning a large finite sum into an infinity.
LUCH_FN float to_float(FilmSum x) {
    const FilmSum largest = bits_float(0x7f7fffffu);
    return static_cast<float>(within(x, -largest, largest));
}

// Of the marks, the one that leaves the most even parts; of equal ones the later.
LUCH_FN const FilmSum* most_even_mark(const FilmSum* row, const FilmLayout& layout, u32 samples) {
    const FilmSum* best = row + layout.marks;
    for (u32 i = 1; i < MARKS; ++i) {
        const FilmSum* mark = row + layout.marks + i * MARK_CHANNELS;
        FilmSum gain = mark[3] * (samples - mark[3]) - best[3] * (samples - best[3]);
        if (gain > 0.0f || (gain == 0.0f && mark[3] > best[3])) best = mark;
    }
    return best;
}

// Samples of a pixel before and after its mark, those in all; both 0 where a part is empty.
struct MarkedSamples {
    u32 before, all;
};

// Combined without alpha and one draw of its error, three floats each, as Film::deviations has them: NaN where a part is
// empty.
LUCH_FN MarkedSamples read_deviation(const FilmSum* row, const FilmLayout& layout, u32 samples, FilmSum exposure,
                                     float* mean, float* deviation) {
    const FilmSum *sum = row + layout.combined, *mark = most_even_mark(row, layout, samples);
    FilmSum n = samples, a = mark[3], b = n - a;
    bool both = a > 0.0f && b > 0.0f;
    FilmSum scale = n > 0.0f ? exposure / n : 0.0f;
    // With independent samples of variance v, means of a and of b samples differ by v / a + v / b = v n / (ab), and the
    // mean of all errs by v / n.
    FilmSum weight = both ? __builtin_sqrt(a * b) * scale : 0.0f;
    for (int k = 0; k < 3; ++k) {
        mean[k] = to_float(sum[k] * scale);
        deviation[k] = both ? to_float((mark[k] / a - (sum[k] - mark[k]) / b) * weight) : bits_float(0x7fc00000u);
    }
    return both ? MarkedSamples{u32(a), samples} : MarkedSamples{0u, 0u};
}

// Light over colour. Where the colour has no red (green, blue), the others speak for it.
LUCH_FN void divide_color(const FilmSum* light, const FilmSum* color, FilmSum scale, float* out) {
    FilmSum sum = 0.0f;
    int defined = 0;
    for (int k = 0; k < 3; ++k) {
        if (color[k] == 0.0f) continue;
        sum += light[k] / color[k];
        ++defined;
    }
    FilmSum others = defined ? sum / defined : 0.0f;
    for (int k = 0; k < 3; ++k) out[k] = to_float(scale * (color[k] != 0.0f ? light[k] / color[k] : others));
}

// The pixel's slots by falling weight (by id where equal), of which the layer holds two.
LUCH_FN void read_crypto(const FilmSum* slots, u32 slot_count, u32 layer, FilmSum scale, float* out) {
    u32 order[MOST_CRYPTO_SLOTS];
    for (u32 i = 0; i < slot_count; ++i) {
        const FilmSum* own = slots + 2 * i;
        u32 place = i;
        for (; place > 0; --place) {
            const FilmSum* before = slots + 2 * order[place - 1];
            if (before[1] > own[1] || (before[1] == own[1] && before[0] <= own[0])) break;
            order[place] = order[place - 1];
        }
        order[place] = i;
    }
    for (u32 i = 0; i < 2; ++i) {
        const FilmSum* slot = slots + 2 * order[2 * layer + i];
        out[2 * i] = static_cast<float>(slot[0]);
        out[2 * i + 1] = to_float(slot[1] * scale);
    }
}

// pass.channels floats of one pixel, which has samples.
LUCH_FN void read_pixel(const PassSource& pass, const FilmSum* row, const FilmLayout& layout, u32 samples,
                        FilmSum exposure, float* out) {
    FilmSum mean = FilmSum(1) / samples;
    const FilmSum* from = row + pass.channel;
    switch (pass.kind) {
        case PassKind::COMBINED:
            for (int k = 0; k < 3; ++k) out[k] = to_float(from[k] * mean * exposure);
            out[3] = to_float(within(1 - from[3] * mean, 0, 1));
            break;
        case PassKind::LIGHT:
            for (u32 k = 0; k < pass.channels; ++k) out[k] = to_float(from[k] * mean * exposure);
            break;
        case PassKind::DIVIDED_LIGHT:
            divide_color(from, row + pass.divisor, exposure, out);
            break;
        case PassKind::MEAN:
            for (u32 k = 0; k < pass.channels; ++k) out[k] = to_float(from[k] * mean);
            break;
        case PassKind::FIRST:
            for (u32 k = 0; k < pass.channels; ++k) out[k] = to_float(from[k]);
            break;
        case PassKind::DEPTH:
            out[0] = from[0] == 0.0f ? 1e10f : to_float(from[0]);
            break;
        case PassKind::MIST:
            out[0] = to_float(within(1 - from[0] * mean, 0, 1));
            break;
        case PassKind::TOTAL:
            out[0] = to_float(from[0]);
            break;
        case PassKind::SAMPLE_COUNT:
            out[0] = static_cast<float>(samples);
            break;
        case PassKind::CRYPTO:
            read_crypto(from, layout.crypto_slots, pass.layer, mean, out);
            break;
    }
}

}  // namespace luch
