// Lookups in the directional-albedo tables, linear between entries.
#pragma once
#include "luch/bsdf/tables.h"
#include "luch/math/fn.h"

namespace luch {

struct TableSpot {
    int index, next;
    float t;
};
LUCH_FN TableSpot table_spot(float x, int size) {
    float at = saturate_f(x) * static_cast<float>(size - 1);  // NaN: the first entry
    int i = static_cast<int>(at);
    return {i, i + 1 < size ? i + 1 : i, at - static_cast<float>(i)};
}
LUCH_FN float table_1d(const float* table, TableSpot x) { return mix_f(table[x.index], table[x.next], x.t); }
LUCH_FN float table_2d(const float* table, TableSpot x, TableSpot y, int x_size) {
    return mix_f(table_1d(table + y.index * x_size, x), table_1d(table + y.next * x_size, x), y.t);
}
LUCH_FN float table_3d(const float* table, TableSpot x, TableSpot y, TableSpot z, int x_size, int y_size) {
    int slice = x_size * y_size;
    return mix_f(table_2d(table + z.index * slice, x, y, x_size), table_2d(table + z.next * slice, x, y, x_size), z.t);
}

// The tables' axes: roughness = sqrt(alpha); z = F0^(1/4), the same for an index and its inverse.
LUCH_FN float table_roughness(float alpha_x, float alpha_y) { return sqrt_f(sqrt_f(alpha_x * alpha_y)); }
LUCH_FN float table_z(float ior) { return sqrt_f(abs_f((ior - 1.0f) / (ior + 1.0f))); }

struct Albedo {
    float directional, mean;
};
LUCH_FN Albedo reflection_albedo(float roughness, float mu) {
    TableSpot x = table_spot(roughness, 32);
    return {table_2d(GGX_ALBEDO, x, table_spot(mu, 32), 32), table_1d(GGX_MEAN_ALBEDO, x)};
}
LUCH_FN Albedo glass_albedo(float roughness, float mu, float ior) {
    TableSpot x = table_spot(roughness, 16), y = table_spot(mu, 16), z = table_spot(table_z(ior), 16);
    bool inside = ior < 1.0f;
    return {table_3d(inside ? GLASS_INSIDE_ALBEDO : GLASS_ALBEDO, x, y, z, 16, 16),
            table_2d(inside ? GLASS_INSIDE_MEAN_ALBEDO : GLASS_MEAN_ALBEDO, x, z, 16)};
}
// Where a rough surface's reflectance lies between F0 (0) and 1 (1).
LUCH_FN float dielectric_place(float roughness, float mu, float ior) {
    return table_3d(SCHLICK_DIELECTRIC, table_spot(roughness, 16), table_spot(mu, 16), table_spot(table_z(ior), 16), 16,
                    16);
}
LUCH_FN float metal_place(float roughness, float mu) {
    return table_2d(SCHLICK_FIFTH, table_spot(roughness, 16), table_spot(mu, 16), 16);
}

}  // namespace luch
