// Bump mapping turns the normal but not the surface. Two consequences: light from behind the real
// surface must not leak in, and diffuse light must fade, not stop, at the bumped terminator.
// Source: Conty Estevez, Lecocq, Stein 2019, "A Microfacet-Based Shadowing Function to Solve the
// Bump Terminator Problem".
#pragma once
#include "luch/bsdf/closure.h"
#include "luch/math/bounds.h"

namespace luch {

// Factor on a bumped lobe's light from wi. Sampling a glossy lobe does not test for leaks (`eval`
// false): its own sampling already tested against the geometric normal.
LUCH_FN float bump_shadow(const Lobe& lobe, bool diffuse, Vec3 n_smooth, Vec3 wi, bool eval) {
    if (!diffuse && !eval) return 1.0f;
    float smooth_wi = dot(n_smooth, wi);
    float smooth_bump = dot(n_smooth, lobe.normal);
    // wi and the bumped normal lie on one side of the bumped surface, on two sides of the smooth one.
    if (smooth_wi * smooth_bump * dot(lobe.normal, wi) < 0.0f) return 0.0f;
    if (!diffuse || !(lobe.flags & LOBE_SOFTENED)) return 1.0f;
    float cos_wi = abs_f(smooth_wi), cos_bump = abs_f(smooth_bump);
    if (cos_bump >= 1.0f || cos_wi >= 1.0f) return 1.0f;
    if (cos_wi < SMALLEST_COSINE) return 0.0f;
    float bump_alpha2 = saturate_f(0.125f * (1.0f / sqr(cos_bump) - 1.0f));
    float tan2 = max_f(1.0f / sqr(cos_wi) - 1.0f, 0.0f);
    float lambda = 0.5f * (sqrt_f(1.0f + bump_alpha2 * tan2) - 1.0f);  // Smith's for GGX
    return 1.0f / (1.0f + lambda);
}

}  // namespace luch
