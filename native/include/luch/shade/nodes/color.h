// Colour nodes: spaces, adjustments, and the blend modes of Mix.
#pragma once
#include "luch/shade/nodes/math.h"
#include "luch/shade/nodes/vector.h"

namespace luch {

// Hue in turns, saturation, value.
LUCH_FN Vec3 rgb_to_hsv(Vec3 c) {
    float hi = max_component(c), lo = min_component(c), span = hi - lo;
    float s = hi != 0.0f ? span / hi : 0.0f;
    float per = span != 0.0f ? 1.0f / span : 0.0f;
    float h = c.x == hi ? (c.y - c.z) * per : c.y == hi ? 2.0f + (c.z - c.x) * per : 4.0f + (c.x - c.y) * per;
    h = h * (1.0f / 6.0f);
    h = h < 0.0f ? h + 1.0f : h;
    return {s != 0.0f ? h : 0.0f, s, hi};
}

// Hues outside 0..1 keep the last sextant, as in Blender.
LUCH_FN Vec3 hsv_to_rgb(Vec3 hsv) {
    float h = (hsv.x == 1.0f ? 0.0f : hsv.x) * 6.0f, s = hsv.y, v = hsv.z;
    float i = floor_f(h), f = h - i;
    float p = v * (1.0f - s), q = v * (1.0f - s * f), t = v * (1.0f - s * (1.0f - f));
    float r = i == 0.0f ? v : i == 1.0f ? q : i == 2.0f ? p : i == 3.0f ? p : i == 4.0f ? t : v;
    float g = i == 0.0f ? t : i == 1.0f ? v : i == 2.0f ? v : i == 3.0f ? q : i == 4.0f ? p : p;
    float b = i == 0.0f ? p : i == 1.0f ? p : i == 2.0f ? t : i == 3.0f ? v : i == 4.0f ? v : q;
    return s != 0.0f ? make_vec3(r, g, b) : make_vec3(v);
}

LUCH_FN Vec3 rgb_to_hsl(Vec3 c) {
    float hi = max_component(c), lo = min_component(c), span = hi - lo;
    float l = min_f(1.0f, (hi + lo) * 0.5f);
    float s = l > 0.5f ? safe_divide(span, 2.0f - hi - lo) : safe_divide(span, hi + lo);
    float h = hi == c.x   ? safe_divide(c.y - c.z, span) + (c.y < c.z ? 6.0f : 0.0f)
              : hi == c.y ? safe_divide(c.z - c.x, span) + 2.0f
                          : safe_divide(c.x - c.y, span) + 4.0f;
    return {span != 0.0f ? h * (1.0f / 6.0f) : 0.0f, span != 0.0f ? s : 0.0f, l};
}

LUCH_FN Vec3 hsl_to_rgb(Vec3 hsl) {
    float h = hsl.x * 6.0f, l = hsl.z;
    float chroma = (1.0f - abs_f(2.0f * l - 1.0f)) * hsl.y;
    float r = saturate_f(abs_f(h - 3.0f) - 1.0f);
    float g = saturate_f(2.0f - abs_f(h - 2.0f));
    float b = saturate_f(2.0f - abs_f(h - 4.0f));
    return {(r - 0.5f) * chroma + l, (g - 0.5f) * chroma + l, (b - 0.5f) * chroma + l};
}

#define LUCH_COLOR_OP(STRUCT, FUNCTION)                                                       \
    struct STRUCT {                                                                           \
        static constexpr int inputs = 3, outputs = 3;                                         \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            store_vec3(out, FUNCTION(load_vec3(in)));                                         \
        }                                                                                     \
    }
LUCH_COLOR_OP(OpRgbToHsv, rgb_to_hsv);
LUCH_COLOR_OP(OpHsvToRgb, hsv_to_rgb);
LUCH_COLOR_OP(OpRgbToHsl, rgb_to_hsl);
LUCH_COLOR_OP(OpHslToRgb, hsl_to_rgb);

struct OpColorLuminance {
    static constexpr int inputs = 3, outputs = 1;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        out[0] = luminance(load_vec3(in));
    }
};

struct OpHueSaturation {  // in: hue (0.5 changes nothing), saturation, value, factor, colour
    static constexpr int inputs = 7, outputs = 3;
    LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) {
        Vec3 color = load_vec3(in + 4), hsv = rgb_to_hsv(color);
        hsv = {fract_f(hsv.x + in[0] + 0.5f), saturate_f(hsv.y * in[1]), hsv.z * in[2]};
        // Oversaturated mixes may go below 0: cut there.
        store_vec3(out, max_v(hsv_to_rgb(hsv) * in[3] + color * (1.0f - in[3]), make_vec3(0.0f)));
    }
};

// Componentwise adjustments: a is the colour's component.
LUCH_FLOAT_OP2(OpColorInvert, b * (1.0f - a) + (1.0f - b) * a);
LUCH_FLOAT_OP3(OpColorBrightContrast, max_f((1.0f + c) * a + (b - c * 0.5f), 0.0f));
LUCH_FLOAT_OP2(OpColorGamma, b == 0.0f ? 1.0f : (a > 0.0f ? pow_f(a, b) : a));

// Blend modes of Mix on one component: a is the first colour, b the second, c the factor. MIX, ADD,
// SUBTRACT, MULTIPLY, DIFFERENCE, DARKEN and LIGHTEN are blends towards a Math operation.
LUCH_FN float blend_overlay(float a, float b, float t) {
    float dark = a * (1.0f - t + 2.0f * t * b);
    return a < 0.5f ? dark : 1.0f - (1.0f - t + 2.0f * t * (1.0f - b)) * (1.0f - a);
}
LUCH_FN float blend_dodge(float a, float b, float t) {
    float rest = 1.0f - t * b;
    float lit = rest <= 0.0f ? 1.0f : min_f(a / rest, 1.0f);
    return a != 0.0f ? lit : 0.0f;
}
LUCH_FN float blend_burn(float a, float b, float t) {
    float rest = 1.0f - t + t * b;
    return rest <= 0.0f ? 0.0f : saturate_f(1.0f - (1.0f - a) / rest);
}
LUCH_FN float blend_soft_light(float a, float b, float t) {
    float screen = 1.0f - (1.0f - b) * (1.0f - a);
    return (1.0f - t) * a + t * ((1.0f - a) * b * a + a * screen);
}
LUCH_FLOAT_OP3(OpBlendMix, mix_f(a, b, c));
LUCH_FLOAT_OP3(OpBlendDivide, b != 0.0f ? (1.0f - c) * a + c * a / b : a);
LUCH_FLOAT_OP3(OpBlendScreen, 1.0f - (1.0f - c + c * (1.0f - b)) * (1.0f - a));
LUCH_FLOAT_OP3(OpBlendOverlay, blend_overlay(a, b, c));
LUCH_FLOAT_OP3(OpBlendDodge, blend_dodge(a, b, c));
LUCH_FLOAT_OP3(OpBlendBurn, blend_burn(a, b, c));
LUCH_FLOAT_OP3(OpBlendSoftLight, blend_soft_light(a, b, c));
LUCH_FLOAT_OP3(OpBlendLinearLight, a + c * (2.0f * b - 1.0f));
LUCH_FLOAT_OP3(OpBlendExclusion, max_f(mix_f(a, a + b - 2.0f * a * b, c), 0.0f));

// Blend modes through HSV: in = first colour, second colour, factor.
#define LUCH_HSV_BLEND(STRUCT, BODY)                                                          \
    struct STRUCT {                                                                           \
        static constexpr int inputs = 7, outputs = 3;                                         \
        LUCH_FN static void eval(const OpContext&, const u32*, const float* in, float* out) { \
            Vec3 a = load_vec3(in), b = load_vec3(in + 3);                                    \
            Vec3 ha = rgb_to_hsv(a), hb = rgb_to_hsv(b);                                      \
            float t = in[6];                                                                  \
            store_vec3(out, (BODY));                                                          \
        }                                                                                     \
    }
LUCH_HSV_BLEND(OpBlendHue, hb.y != 0.0f ? mix(a, hsv_to_rgb({hb.x, ha.y, ha.z}), t) : a);
LUCH_HSV_BLEND(OpBlendSaturation, ha.y != 0.0f ? hsv_to_rgb({ha.x, (1.0f - t) * ha.y + t * hb.y, ha.z}) : a);
LUCH_HSV_BLEND(OpBlendValue, hsv_to_rgb({ha.x, ha.y, (1.0f - t) * ha.z + t * hb.z}));
LUCH_HSV_BLEND(OpBlendColor, hb.y != 0.0f ? mix(a, hsv_to_rgb({hb.x, hb.y, ha.z}), t) : a);

}  // namespace luch
