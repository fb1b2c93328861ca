// Looking up images. As in Cycles, texels are blended as they are stored (sRGB bytes with the alpha
// multiplied in) and decoded to scene-linear afterwards.
#pragma once
#include "luch/shade/scene_view.h"

namespace luch {

enum class Interpolation : u32 { LINEAR, CLOSEST, CUBIC };
enum class Extension : u32 { REPEAT, EXTEND, CLIP, MIRROR };

enum class ImageAlpha : u8 { STRAIGHT, PREMULTIPLIED, CHANNEL_PACKED, NONE_ };

struct Texel {
    float r, g, b, a;
};
LUCH_FN Texel operator*(Texel t, float s) { return {t.r * s, t.g * s, t.b * s, t.a * s}; }
LUCH_FN Texel operator+(Texel s, Texel t) { return {s.r + t.r, s.g + t.g, s.b + t.b, s.a + t.a}; }

LUCH_FN float half_to_float(u16 h) {
    const u32 magnitude = u32(h & 0x7fffu) << 13, sign = u32(h & 0x8000u) << 16;
    // Scaling by 2^112 moves the exponent's bias and makes subnormals exact; infinities get theirs back.
    const float scaled = bits_float(magnitude) * 5.192296858534828e33f;
    const u32 bits = magnitude >= 0x0f800000u ? (magnitude | 0x70000000u) : float_bits(scaled);
    return bits_float(bits | sign);
}

// One channel as a number, bytes as 0..1.
LUCH_FN float read_channel(const u8* p) { return float(*p) * (1.0f / 255.0f); }
LUCH_FN float read_channel(const u16* p) { return half_to_float(*p); }
LUCH_FN float read_channel(const float* p) { return *p; }

// Which texel in memory: 0 <= x < width, 0 <= y < height.
LUCH_FN u64 texel_index(const ImageView& image, u32 x, u32 y) {
    if (image.tiles_across == 0) return u64(y) * image.width + x;
    u64 tile = u64(y / IMAGE_TILE) * image.tiles_across + x / IMAGE_TILE;
    return (tile * IMAGE_TILE + y % IMAGE_TILE) * IMAGE_TILE + x % IMAGE_TILE;
}

// 0 <= x < width, 0 <= y < height. Straight alpha of colours is multiplied in; data stays as it is.
template <class Stored>
LUCH_FN Texel read_texel(const ImageView& image, int x, int y) {
    const Stored* p = static_cast<const Stored*>(image.pixels) + texel_index(image, u32(x), u32(y)) * image.channels;
    Texel t;
    t.r = read_channel(p);
    t.g = image.channels >= 3 ? read_channel(p + 1) : t.r;
    t.b = image.channels >= 3 ? read_channel(p + 2) : t.r;
    t.a = (image.channels & 1) == 0 ? read_channel(p + image.channels - 1) : 1.0f;
    const auto alpha = ImageAlpha(image.alpha);
    if (alpha == ImageAlpha::NONE_) t.a = 1.0f;
    const float factor = alpha == ImageAlpha::STRAIGHT && image.srgb ? t.a : 1.0f;
    return {t.r * factor, t.g * factor, t.b * factor, t.a};
}

// Pixel number at or below x (one lower for negative whole numbers, where the fraction is 1).
LUCH_FN int pixel_below(float x, float* fraction) {
    const float tame = abs_f(x) < 2e9f ? x : 0.0f;  // NaN: 0
    const int i = int(tame) - (tame < 0.0f ? 1 : 0);
    *fraction = tame - float(i);
    return i;
}

LUCH_FN int wrap_pixel(int x, int size, Extension extension) {
    if (u32(x) < u32(size)) return x;
    if (extension == Extension::REPEAT) {
        const int m = x % size;
        return m < 0 ? m + size : m;
    }
    if (extension == Extension::MIRROR) {
        const int m = (x < 0 ? -(x + 1) : x) % (2 * size);
        return m >= size ? 2 * size - 1 - m : m;
    }
    return x < 0 ? 0 : (x >= size ? size - 1 : x);
}

// N weighted texels per axis, the first at (x, y).
template <class Stored, int N>
LUCH_FN Texel blend_texels(const ImageView& image, int x, int y, const float (&wx)[N], const float (&wy)[N],
                           Extension extension) {
    const int width = int(image.width), height = int(image.height);
    const bool clip = extension == Extension::CLIP;
    int column[N];
    float weight[N];
    for (int i = 0; i < N; i++) {
        column[i] = wrap_pixel(x + i, width, extension);
        weight[i] = clip && column[i] != x + i ? 0.0f : wx[i];
    }
    Texel sum{0.0f, 0.0f, 0.0f, 0.0f};
    LUCH_KEEP_LOOP
    for (int j = 0; j < N; j++) {
        const int row = wrap_pixel(y + j, height, extension);
        const float row_weight = clip && row != y + j ? 0.0f : wy[j];
        for (int i = 0; i < N; i++) {
            sum = sum + read_texel<Stored>(image, column[i], row) * (weight[i] * row_weight);
        }
    }
    return sum;
}

// Weights of the uniform cubic B-spline.
LUCH_FN void cubic_weights(float t, float (&w)[4]) {
    const float s = 1.0f - t;
    w[0] = s * s * s * (1.0f / 6.0f);
    w[1] = (0.5f * t - 1.0f) * t * t + 2.0f / 3.0f;
    w[2] = (0.5f * s - 1.0f) * s * s + 2.0f / 3.0f;
    w[3] = t * t * t * (1.0f / 6.0f);
}

template <class Stored>
LUCH_FN Texel interpolate_image(const ImageView& image, float x, float y, Interpolation interpolation,
                                Extension extension) {
    float fx, fy;
    if (interpolation == Interpolation::CLOSEST) {
        const int ix = pixel_below(x, &fx), iy = pixel_below(y, &fy);
        const float one[1] = {1.0f};
        return blend_texels<Stored, 1>(image, ix, iy, one, one, extension);
    }
    const int ix = pixel_below(x - 0.5f, &fx), iy = pixel_below(y - 0.5f, &fy);
    if (interpolation == Interpolation::LINEAR) {
        const float wx[2] = {1.0f - fx, fx}, wy[2] = {1.0f - fy, fy};
        return blend_texels<Stored, 2>(image, ix, iy, wx, wy, extension);
    }
    if constexpr (!plan::CUBIC_IMAGES) return {};
    float wx[4], wy[4];
    cubic_weights(fx, wx);
    cubic_weights(fy, wy);
    return blend_texels<Stored, 4>(image, ix - 1, iy - 1, wx, wy, extension);
}

// The stored value at (u, v), 0..1 over the image, v upwards.
LUCH_FN_SLOW Texel look_up_image(const ImageView& image, float u, float v, Interpolation interpolation,
                                 Extension extension) {
    const float x = u * float(image.width), y = v * float(image.height);
    if (!(plan::HALF_IMAGES || plan::FLOAT_IMAGES) || image.format == PixelFormat::U8)
        return interpolate_image<u8>(image, x, y, interpolation, extension);
    if (plan::HALF_IMAGES && image.format == PixelFormat::F16)
        return interpolate_image<u16>(image, x, y, interpolation, extension);
    if constexpr (!plan::FLOAT_IMAGES) return {};
    return interpolate_image<float>(image, x, y, interpolation, extension);
}

LUCH_FN float srgb_to_linear(float c) {
    const float low = max_f(c, 0.0f) * (1.0f / 12.92f);
    const float high = pow_f((max_f(c, 0.0f) + 0.055f) * (1.0f / 1.055f), 2.4f);
    return c < 0.04045f ? low : high;
}

}  // namespace luch
