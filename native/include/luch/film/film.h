// The film: per pixel one row of sums, which the passes of a render are read from at the end.
//
// Sums are double, so that 2^20 samples lose nothing; who renders a pixel adds to its row directly
// (a tile of rows stays in the first-level cache). A row belongs to one worker at a time, so results
// do not depend on the number of threads as long as the order within a pixel does not.
#pragma once
#include "luch/math/vec.h"

namespace luch {

using FilmSum = double;

// What Combined held when the samples reached a power of two is kept, of the last two powers: the samples before and
// after such a mark are two parts whose difference tells the picture's error.
inline constexpr u32 MARKS = 2, MARK_CHANNELS = 4;

// Where each pass starts in a pixel's row, in channels; NONE: the render does not ask for it.
struct FilmLayout {
    u32 stride;    // channels of a row
    u32 combined;  // r, g, b, transparency (1 - alpha)
    u32 marks;     // MARKS times r, g, b and count of the samples before a mark
    u32 depth, position, object_index, material_index;   // of the pixel's first sample
    u32 mist, normal, uv;                                // mist: sum of 1 - mist
    u32 emission, environment, ambient_occlusion;
    u32 diffuse_direct, diffuse_indirect, diffuse_color;
    u32 glossy_direct, glossy_indirect, glossy_color;
    u32 transmission_direct, transmission_indirect, transmission_color;
    u32 volume_direct, volume_indirect;
    u32 denoising_albedo, denoising_normal, denoising_depth;
    u32 lightgroups;  // 3 per light group
    u32 aovs;         // 4 per AOV, a value in the first
    u32 time;         // milliseconds that its paths took
    u32 crypto_object, crypto_material, crypto_asset;  // pairs of id and weight
    u32 lightgroup_count, aov_count, crypto_slots;  // 0: none asked for
    // What a path need not look for: light passes (direct, indirect, emission, environment, AO, light
    // groups) and what is written at the first opaque surface (all data passes, AOVs, cryptomatte).
    u32 any_light_pass, any_data_pass;
};

struct FilmView {
    FilmSum* rows;       // [pixel * stride + channel]; pixels of the rendered region, bottom row first
    u32* sample_counts;  // per pixel
    FilmLayout layout;
    u32 width, height;   // of the rendered region
    u32 x0, y0;          // its bottom left corner in the full frame
    FilmSum origin[3];   // Scene.origin: added to the Position pass
};

// Where a value came to light that is not finite. None should: each is a bug, or a number that a user's nodes made.
enum Refusal : u32 {
    REFUSED_EMISSION,  // light that a path met: an emitter, a lamp, the world
    REFUSED_DIRECT,    // light that was sampled
    REFUSED_SCATTER,   // a closure's sample
    REFUSED_FLIGHT,    // a point or a weight in a volume
    REFUSED_DATA,      // what a pass shows
    REFUSALS
};

// What one worker holds. Values that are not finite never enter; they are counted.
struct FilmWriter {
    FilmView film;
    u64* refused;  // REFUSALS counters
    // What settings took, in fixed point: sums that no order of threads changes.
    u64 clamped = 0;  // light that a limit cut off Combined; CLAMPED_UNIT
    u64 cut = 0;      // throughput of paths that a limit of bounces ended at a surface; CUT_UNIT
};
inline constexpr float CLAMPED_UNIT = 1.0f / 65536.0f, CUT_UNIT = 1.0f / 1048576.0f;
// The brightest sample that is counted in full: a thousand million of them fit.
inline constexpr float MOST_CLAMPED = 250000.0f;

// x - x is 0 for finite values and NaN for the others; one test for a whole colour.
LUCH_FN bool all_finite(Color c) { return (c.x - c.x) + (c.y - c.y) + (c.z - c.z) == 0.0f; }

LUCH_FN FilmSum* film_row(const FilmView& film, u32 pixel) {
    return film.rows + static_cast<u64>(pixel) * film.layout.stride;
}

// Adds to a pass; channel is one of the layout's, NONE adds nothing.
LUCH_FN void film_add(FilmWriter& writer, u32 pixel, u32 channel, float value) {
    if (channel == NONE) return;
    if (!finite_f(value)) {
        count_one(writer.refused + REFUSED_DATA);
        return;
    }
    film_row(writer.film, pixel)[channel] += value;
}

LUCH_FN void film_add(FilmWriter& writer, u32 pixel, u32 channel, Color value) {
    if (channel == NONE) return;
    if (!all_finite(value)) {
        count_one(writer.refused + REFUSED_DATA);
        return;
    }
    FilmSum* to = film_row(writer.film, pixel) + channel;
    to[0] += value.x;
    to[1] += value.y;
    to[2] += value.z;
}

LUCH_FN void film_add_combined(FilmWriter& writer, u32 pixel, Color value) {
    film_add(writer, pixel, writer.film.layout.combined, value);
}

// 1 - alpha of a path: its throughput where it leaves through a transparent film or a holdout.
LUCH_FN void film_add_transparency(FilmWriter& writer, u32 pixel, float value) {
    film_add(writer, pixel, writer.film.layout.combined + 3u, value);
}

LUCH_FN void film_add_lightgroup(FilmWriter& writer, u32 pixel, u32 group, Color value) {
    if (writer.film.layout.lightgroups != NONE)
        film_add(writer, pixel, writer.film.layout.lightgroups + 3u * group, value);
}

LUCH_FN void film_add_aov_color(FilmWriter& writer, u32 pixel, u32 aov, Color value, float alpha) {
    u32 channel = writer.film.layout.aovs + 4u * aov;
    film_add(writer, pixel, channel, value);
    film_add(writer, pixel, channel + 3u, alpha);
}

LUCH_FN void film_add_aov_value(FilmWriter& writer, u32 pixel, u32 aov, float value) {
    film_add(writer, pixel, writer.film.layout.aovs + 4u * aov, value);
}

// What a pixel's first sample sees: overwritten at every surface until one counts as opaque, and by
// film_set_background where the path leaves the scene before that.
LUCH_FN void film_set(FilmWriter& writer, u32 pixel, u32 channel, float value) {
    if (channel != NONE && finite_f(value)) film_row(writer.film, pixel)[channel] = value;
}

LUCH_FN void film_set_position(FilmWriter& writer, u32 pixel, Vec3 p) {
    const FilmView& film = writer.film;
    if (film.layout.position == NONE || !all_finite(p)) return;
    FilmSum* to = film_row(film, pixel) + film.layout.position;
    to[0] = film.origin[0] + p.x;
    to[1] = film.origin[1] + p.y;
    to[2] = film.origin[2] + p.z;
}

LUCH_FN void film_set_background(FilmWriter& writer, u32 pixel) {
    const FilmLayout& layout = writer.film.layout;
    FilmSum* row = film_row(writer.film, pixel);
    if (layout.depth != NONE) row[layout.depth] = 0;
    if (layout.object_index != NONE) row[layout.object_index] = 0;
    if (layout.material_index != NONE) row[layout.material_index] = 0;
    if (layout.position != NONE) row[layout.position] = row[layout.position + 1] = row[layout.position + 2] = 0;
}

// Adds weight to the id's slot of a cryptomatte (channel: one of the layout's crypto_*). When more ids
// meet in a pixel than there are slots, the last slot takes the rest, as Cycles has it.
LUCH_FN void film_add_crypto(FilmWriter& writer, u32 pixel, u32 channel, float id, float weight) {
    if (channel == NONE || !(weight > 0.0f) || !finite_f(weight)) return;
    FilmSum* slot = film_row(writer.film, pixel) + channel;
    u32 last = writer.film.layout.crypto_slots - 1u;
    for (u32 i = 0; i < last && slot[1] != 0 && slot[0] != id; ++i) slot += 2;
    if (slot[1] == 0) slot[0] = id;
    slot[1] += weight;
}

LUCH_FN void film_count_samples(FilmWriter& writer, u32 pixel, u32 samples) {
    writer.film.sample_counts[pixel] += samples;
}

LUCH_FN bool is_mark(u32 sample) { return sample != 0u && (sample & (sample - 1u)) == 0u; }

// First channel of a mark; neighbouring powers of two take turns.
LUCH_FN u32 mark_channel(const FilmLayout& layout, u32 sample) {
    return layout.marks + ((sample & 0x55555555u) ? 0u : MARK_CHANNELS);
}

// To be called before a pixel's sample of that number, where is_mark says so.
LUCH_FN void film_mark(FilmWriter& writer, u32 pixel, u32 sample) {
    const FilmLayout& layout = writer.film.layout;
    if (layout.marks == NONE) return;
    FilmSum* row = film_row(writer.film, pixel);
    FilmSum* to = row + mark_channel(layout, sample);
    for (u32 k = 0; k < 3u; ++k) to[k] = row[layout.combined + k];
    to[3] = writer.film.sample_counts[pixel];
}

// How many of the samples [first, first + count) come before the next mark.
LUCH_FN u32 samples_to_mark(u32 first, u32 count) {
    u32 next = 1u;
    while (next != 0u && next <= first) next <<= 1;
    return next != 0u && next - first < count ? next - first : count;
}

// What the first sample alone says, not a sum.
LUCH_FN bool film_is_first(const FilmLayout& layout, u32 channel) {
    return channel == layout.depth || channel == layout.object_index || channel == layout.material_index ||
           (layout.position != NONE && channel - layout.position < 3u);
}

// Pairs of id and weight.
LUCH_FN bool film_is_crypto(const FilmLayout& layout, u32 channel) {
    u32 width = 2u * layout.crypto_slots;
    return (layout.crypto_object != NONE && channel - layout.crypto_object < width) ||
           (layout.crypto_material != NONE && channel - layout.crypto_material < width) ||
           (layout.crypto_asset != NONE && channel - layout.crypto_asset < width);
}

// Adds what another film of the same layout holds of a pixel, e.g. other samples. What the first sample sees is kept
// where the pixel has samples.
LUCH_FN void film_merge_pixel(FilmWriter& writer, const FilmView& other, u32 pixel) {
    const FilmLayout& layout = writer.film.layout;
    FilmSum* to = film_row(writer.film, pixel);
    const FilmSum* from = film_row(other, pixel);
    bool empty = writer.film.sample_counts[pixel] == 0;
    for (u32 c = 0; c < layout.stride; ++c) {
        if (film_is_first(layout, c)) {
            if (empty) to[c] = from[c];
        } else if (!film_is_crypto(layout, c)) {
            to[c] += from[c];
        }
    }
    for (u32 kind = 0; kind < 3u && layout.crypto_slots > 0u; ++kind) {
        u32 channel = kind == 0u ? layout.crypto_object : kind == 1u ? layout.crypto_material : layout.crypto_asset;
        if (channel == NONE) continue;
        for (u32 c = channel; c < channel + 2u * layout.crypto_slots; c += 2u)
            film_add_crypto(writer, pixel, channel, static_cast<float>(from[c]), static_cast<float>(from[c + 1u]));
    }
    writer.film.sample_counts[pixel] += other.sample_counts[pixel];
}

}  // namespace luch
