// Colours from tables: Blackbody, Wavelength. The tables are made by luch/spectrum.py.
//
// operation   inputs          outputs    params
// BLACKBODY   0 kelvin        0..2 color 0 table offset: 512 colours, even steps of 1/T, 12000 K to 800 K
// WAVELENGTH  0 nanometres    0..2 color 0 table offset: 81 colours, 380 nm to 780 nm
#pragma once
#include "luch/shade/scene_view.h"

namespace luch {

// Colour at a place of a table of colours, 0 <= at <= last.
LUCH_FN Vec3 look_up_colors(const float* table, float at, int last) {
    const int i = int(at) < last ? int(at) : last - 1;
    const float t = at - float(i);
    const float* a = table + 3 * i;
    return {mix_f(a[0], a[3], t), mix_f(a[1], a[4], t), mix_f(a[2], a[5], t)};
}

LUCH_FN void write_color(Vec3 color, float* out) {
    out[0] = max_f(color.x, 0.0f);
    out[1] = max_f(color.y, 0.0f);
    out[2] = max_f(color.z, 0.0f);
}

struct OpBlackbody {
    static constexpr int inputs = 1, outputs = 3, params = 1;

    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        constexpr float coldest = 800.0f, hottest = 12000.0f;
        constexpr int last = 511;
        const float kelvin = clamp_f(in[0], coldest, hottest);
        const float at = (1.0f / kelvin - 1.0f / hottest) * (float(last) / (1.0f / coldest - 1.0f / hottest));
        write_color(look_up_colors(table_of(c, params[0]), clamp_f(at, 0.0f, float(last)), last), out);
    }
};

struct OpWavelength {
    static constexpr int inputs = 1, outputs = 3, params = 1;

    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        constexpr float first_nm = 380.0f, step_nm = 5.0f;
        constexpr int last = 80;
        const float at = (in[0] - first_nm) * (1.0f / step_nm);
        const bool visible = at >= 0.0f && at < float(last);
        const Vec3 color = look_up_colors(table_of(c, params[0]), clamp_f(at, 0.0f, float(last)), last);
        write_color(visible ? color : make_vec3(0.0f), out);
    }
};

}  // namespace luch
