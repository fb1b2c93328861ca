// Samples of area lamps for a chunk of points: one loop, which vectorises. One by one, the spherical rectangle took a
// sixth of the time of a matt scene.
#pragma once
#include "luch/light/sample.h"
#include "luch/math/pack.h"
#include "luch/shade/point.h"

namespace luch::cpu {

class AreaLamps {
 public:
    void clear() { count_ = 0; }

    // A lamp was chosen for a point. u: two numbers for the place. Gives the entry's index.
    int add(const LightsView& lights, const LightChoice& choice, Vec3 p, Vec2 u) {
        AreaOutlook o = make_area_outlook(lights.lamps[choice.lamp], p);
        int i = count_++;
        shift_x_[i] = o.shift_x, shift_y_[i] = o.shift_y, height_[i] = o.height;
        half_u_[i] = o.half_u, half_v_[i] = o.half_v, tan_half_spread_[i] = o.tan_half_spread;
        ellipse_[i] = o.ellipse;
        u_[0][i] = u.x, u_[1][i] = u.y;
        lamp_[i] = choice.lamp, probability_[i] = choice.probability;
        return i;
    }

    // Finds the places of all.
    LUCH_FN_APART void sample_places() {
        // Whole vectors: what lies beyond the count is old or zero, and is not read.
        const int end = (count_ + WHOLE - 1) / WHOLE * WHOLE;
        for (int i = 0; i < end; i++) {
            AreaOutlook o{shift_x_[i], shift_y_[i],         height_[i],       half_u_[i],
                          half_v_[i],  tan_half_spread_[i], ellipse_[i] != 0u};
            AreaPlace place = sample_area_place(o, {u_[0][i], u_[1][i]});
            x_[i] = place.x, y_[i] = place.y;
            solid_angle_[i] = place.solid_angle, area_[i] = place.area;
        }
    }

    LightSample sample(const LightsView& lights, int i, Vec3 p) const {
        const LampView& lamp = lights.lamps[lamp_[i]];
        LampSample at = area_sample_at(lamp, p, {x_[i], y_[i], height_[i], solid_angle_[i], area_[i]});
        finish_lamp_sample(lamp, &at);
        return light_sample_at(lights, lamp_[i], at, probability_[i]);
    }

 private:
    static constexpr int WHOLE = PACK_LANES;
    static_assert(SHADE_LANES % WHOLE == 0);
    using Lanes = float[SHADE_LANES];

    int count_ = 0;
    Lanes shift_x_ = {}, shift_y_ = {}, height_ = {}, half_u_ = {}, half_v_ = {}, tan_half_spread_ = {}, u_[2] = {};
    u32 ellipse_[SHADE_LANES] = {};
    Lanes x_, y_, solid_angle_, area_;
    Lanes probability_;
    u32 lamp_[SHADE_LANES];
};

}  // namespace luch::cpu
