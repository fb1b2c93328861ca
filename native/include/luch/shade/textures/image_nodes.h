// Image Texture and Environment Texture.
//
// operation    inputs                                   outputs             params
// IMAGE        0..2 vector                              0..2 color, 3 alpha 0 image slot (or tile count, see below),
//                                                                           1 Interpolation, 2 Extension,
//                                                                           3 ImageProjection, 4 ImageFlag
// IMAGE_BOX    0..2 vector, 3..5 normal (object space)  the same            0 image slot, 1 Interpolation,
//                                                                           2 Extension, 3 blend (float), 4 ImageFlag
// ENVIRONMENT  0..2 direction                           the same            0 image slot, 1 Interpolation,
//                                                                           2 mirror ball (0/1)
// With IMAGE_TILED, param 0 of IMAGE is a count and as many pairs (tile number, image slot) follow param 4.
#pragma once
#include "luch/shade/textures/image.h"

namespace luch {

enum class ImageProjection : u32 { FLAT, SPHERE, TUBE };
enum ImageFlag : u32 {
    IMAGE_UNASSOCIATE = 1u,  // alpha is used: give the colour without it
    IMAGE_TILED = 2u,        // UDIM
};

// A looked-up value that is still encoded, and whether it has to be decoded from sRGB.
struct EncodedTexel {
    Texel texel;
    bool srgb;
};

LUCH_FN Texel divide_out_alpha(Texel t) {
    const float s = t.a != 0.0f ? 1.0f / t.a : 1.0f;
    return {t.r * s, t.g * s, t.b * s, t.a};
}

LUCH_FN EncodedTexel sample_image(const ImageView& image, Vec2 uv, Interpolation interpolation, Extension extension,
                                  u32 flags) {
    EncodedTexel e{look_up_image(image, uv.x, uv.y, interpolation, extension), image.srgb != 0};
    const auto alpha = ImageAlpha(image.alpha);
    const bool associated = alpha == ImageAlpha::PREMULTIPLIED || (alpha == ImageAlpha::STRAIGHT && image.srgb);
    if ((flags & IMAGE_UNASSOCIATE) && associated) e.texel = divide_out_alpha(e.texel);
    return e;
}

// What the image operations share: `find` gives an encoded value per lane; decoding is a loop of its own,
// which vectorises, while the lookups cannot.
template <class Op>
struct ImageOp {
    static constexpr bool reads_point = true;  // images are not there when programs are built

    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        const EncodedTexel e = Op::find(c, params, in);
        out[0] = e.srgb ? srgb_to_linear(e.texel.r) : e.texel.r;
        out[1] = e.srgb ? srgb_to_linear(e.texel.g) : e.texel.g;
        out[2] = e.srgb ? srgb_to_linear(e.texel.b) : e.texel.b;
        out[3] = e.texel.a;
    }

#if !LUCH_CUDA
    // Compiled once per operation, by cpu/shade/texture_lanes.cpp.
    static void eval_lanes(const OpContext& c, const u32* params, const float* const* in, float* const* out, int count);
#endif
};

struct OpImage : ImageOp<OpImage> {
    static constexpr int inputs = 3, outputs = 4, params = 5;

    LUCH_FN static EncodedTexel find(const OpContext& c, const u32* params, const float* in) {
        Vec2 uv = project(ImageProjection(params[3]), in);
        u32 slot = params[0];
        if (params[4] & IMAGE_TILED) {
            slot = find_tile(params, &uv);
            if (slot == NONE) return {{1.0f, 0.0f, 1.0f, 1.0f}, false};  // Blender's sign of a missing image
        }
        return sample_image(image_of(c, slot), uv, Interpolation(params[1]), Extension(params[2]), params[4]);
    }

 private:
    LUCH_FN static Vec2 project(ImageProjection projection, const float* in) {
        if (projection == ImageProjection::FLAT) return {in[0], in[1]};
        const Vec3 p{in[0] * 2.0f - 1.0f, in[1] * 2.0f - 1.0f, in[2] * 2.0f - 1.0f};
        const bool on_axis = p.x == 0.0f && p.y == 0.0f;
        const float around = on_axis ? 0.0f : 0.5f - atan2_f(p.x, p.y) * (0.5f * INV_PI);
        if (projection == ImageProjection::TUBE) return on_axis ? Vec2{0.0f, 0.0f} : Vec2{around, (p.z + 1.0f) * 0.5f};
        const float r = length(p);
        return {around, r > 0.0f ? 1.0f - acos_f(p.z / r) * INV_PI : 0.0f};
    }

    // The image slot of the UDIM tile under uv, which becomes relative to the tile; NONE outside all tiles.
    LUCH_FN static u32 find_tile(const u32* params, Vec2* uv) {
        if (!(abs_f(uv->x) < 1e6f && abs_f(uv->y) < 1e6f)) return NONE;
        const int column = int(uv->x), row = int(uv->y);
        if (column < 0 || row < 0 || column >= 10) return NONE;
        const u32 number = u32(1001 + 10 * row + column);
        for (u32 k = 0; k < params[0]; k++) {
            if (params[5 + 2 * k] == number) {
                *uv = {uv->x - float(column), uv->y - float(row)};
                return params[6 + 2 * k];
            }
        }
        return NONE;
    }
};

struct OpImageBox : ImageOp<OpImageBox> {
    static constexpr int inputs = 6, outputs = 4, params = 5;

    LUCH_FN static EncodedTexel find(const OpContext& c, const u32* params, const float* in) {
        const Vec3 p{in[0], in[1], in[2]}, n{in[3], in[4], in[5]};
        const ImageView& image = image_of(c, params[0]);
        const Vec3 w = face_weights(abs_v(n), bits_float(params[3]));
        // No face shows the image mirrored.
        const Vec2 uv[3] = {{n.x < 0.0f ? 1.0f - p.y : p.y, p.z},
                            {n.y > 0.0f ? 1.0f - p.x : p.x, p.z},
                            {n.z > 0.0f ? 1.0f - p.y : p.y, p.x}};
        Texel sum{0.0f, 0.0f, 0.0f, 0.0f};
        for (int face = 0; face < 3; face++) {
            if (!(w[face] > 0.0f)) continue;
            const EncodedTexel e =
                sample_image(image, uv[face], Interpolation(params[1]), Extension(params[2]), params[4]);
            Texel t = e.texel;
            if (e.srgb) t = {srgb_to_linear(t.r), srgb_to_linear(t.g), srgb_to_linear(t.b), t.a};
            sum = sum + t * w[face];
        }
        return {sum, false};
    }

 private:
    // How much of each pair of faces a normal sees. One face far from the edges of the box; within
    // `blend` of an edge two, near a corner three (the three weights are then barycentric).
    LUCH_FN static Vec3 face_weights(Vec3 n, float blend) {
        const float sum = n.x + n.y + n.z;
        if (!(sum > 0.0f)) return {1.0f, 0.0f, 0.0f};
        n = {n.x / sum, n.y / sum, n.z / sum};
        const float limit = 0.5f * (1.0f + blend);
        if (n.x > limit * (n.x + n.y) && n.x > limit * (n.x + n.z)) return {1.0f, 0.0f, 0.0f};
        if (n.y > limit * (n.x + n.y) && n.y > limit * (n.y + n.z)) return {0.0f, 1.0f, 0.0f};
        if (n.z > limit * (n.x + n.z) && n.z > limit * (n.y + n.z)) return {0.0f, 0.0f, 1.0f};
        if (!(blend > 0.0f)) return {1.0f, 0.0f, 0.0f};
        const float rest = 1.0f - limit;
        if (n.z < rest * (n.y + n.x)) {
            const float w = first_of_two(n.x, n.y, blend);
            return {w, 1.0f - w, 0.0f};
        }
        if (n.x < rest * (n.y + n.z)) {
            const float w = first_of_two(n.y, n.z, blend);
            return {0.0f, w, 1.0f - w};
        }
        if (n.y < rest * (n.x + n.z)) {
            const float w = first_of_two(n.x, n.z, blend);
            return {w, 0.0f, 1.0f - w};
        }
        const float s = 1.0f / (2.0f * limit - 1.0f);
        return {((2.0f - limit) * n.x + (limit - 1.0f)) * s, ((2.0f - limit) * n.y + (limit - 1.0f)) * s,
                ((2.0f - limit) * n.z + (limit - 1.0f)) * s};
    }
    LUCH_FN static float first_of_two(float a, float b, float blend) {
        return saturate_f((a / (a + b) - 0.5f * (1.0f - blend)) / blend);
    }
};

struct OpEnvironment : ImageOp<OpEnvironment> {
    static constexpr int inputs = 3, outputs = 4, params = 3;

    LUCH_FN static EncodedTexel find(const OpContext& c, const u32* params, const float* in) {
        const Vec3 d = normalize_or({in[0], in[1], in[2]}, {0.0f, 0.0f, 0.0f});
        const Vec2 uv = params[2] ? mirror_ball(d) : equirectangular(d);
        return sample_image(image_of(c, params[0]), uv, Interpolation(params[1]), Extension::REPEAT, 0);
    }

 private:
    LUCH_FN static Vec2 equirectangular(Vec3 d) {
        if (is_zero(d)) return {0.0f, 0.0f};
        return {0.5f - atan2_f(d.y, d.x) * (0.5f * INV_PI), 1.0f - acos_f(d.z) * INV_PI};
    }
    LUCH_FN static Vec2 mirror_ball(Vec3 d) {
        const float y = d.y - 1.0f;
        const float size = 2.0f * safe_sqrt(-0.5f * y);
        const float s = size > 0.0f ? 1.0f / size : 1.0f;
        return {0.5f * (d.x * s + 1.0f), 0.5f * (d.z * s + 1.0f)};
    }
};

}  // namespace luch
