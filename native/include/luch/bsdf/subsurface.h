// Light that scatters under the surface: which lobe a node's inputs make. What the path does inside stands in
// integrator/subsurface.h.
#pragma once
#include "luch/bsdf/params.h"
#include "luch/bsdf/setup_context.h"
#include "luch/math/bounds.h"
#include "luch/plan.h"

namespace luch {

// The profile of Christensen and Burley, and the walk of old, take the radius for a diffusion length; this makes both
// look alike.
inline constexpr float SUBSURFACE_RADIUS_SCALE = 0.0795774715459477f;  // 1 / (4 pi)

LUCH_FN LobeType subsurface_lobe(SubsurfaceMethod method) {
    switch (method) {
        case SubsurfaceMethod::SKIN:
            return LobeType::SUBSURFACE_SKIN;
        case SubsurfaceMethod::LEGACY:
            return LobeType::SUBSURFACE_LEGACY;
        case SubsurfaceMethod::BURLEY:
            return LobeType::SUBSURFACE_DISK;
        case SubsurfaceMethod::RANDOM_WALK:
            break;
    }
    return LobeType::SUBSURFACE;
}

// Diffuse reflectance of a half space by the dipole. Source: Jensen and Buhler 2002, equation 5.
// boundary: 4/3 A, of the mismatch of indices.
LUCH_FN float dipole_reflectance(float reduced_albedo, float boundary) {
    float s = sqrt_f(3.0f * (1.0f - reduced_albedo));
    return 0.5f * reduced_albedo * (1.0f + exp_f(-boundary * s)) * exp_f(-s);
}

// Halvings that find the albedo a colour stands for. More would be closer to it, by up to a fifth of the radius of
// colours near white; Cycles makes so many, and it is its look that users know.
inline constexpr int SKIN_HALVINGS = 12;

// Mean free path of skin: what is given is the length over which diffused light fades, so that colours of a texture
// do not change how far light goes.
LUCH_FN float skin_radius_factor(float color, float boundary) {
    float low = 0.0f, high = 1.0f, middle = 0.5f;
    for (int i = 0; i < SKIN_HALVINGS; ++i) {
        middle = 0.5f * (low + high);
        bool darker = dipole_reflectance(middle, boundary) < color;
        low = darker ? middle : low;
        high = darker ? high : middle;
    }
    if (color < SKIN_DARKEST) middle = 0.0f;
    if (color >= SKIN_BRIGHTEST) middle = MEDIUM_MAX_ALBEDO;
    return sqrt_f(3.0f * (1.0f - middle));
}

LUCH_FN Vec3 skin_radius(Vec3 radius, Color color, float ior) {
    float inverse = 1.0f / ior;
    float inside = inverse * (-1.440f * inverse + 0.710f) + 0.668f + 0.0636f * ior;  // diffuse Fresnel reflectance
    float boundary = (4.0f / 3.0f) * (1.0f + inside) / (1.0f - inside);
    return {radius.x * skin_radius_factor(color.x, boundary), radius.y * skin_radius_factor(color.y, boundary),
            radius.z * skin_radius_factor(color.z, boundary)};
}

// weight: the closure's, without the colour.
LUCH_FN_SLOW void setup_subsurface(ClosureSet& set, Color weight, const SubsurfaceParams& p, const SetupContext& c) {
    const Color none = make_vec3(0.0f);
    Vec3 normal = specular_normal(closure_normal(p.normal, c), c);
    Color color = max_v(p.color, none), whole = weight * color;
    Vec3 radius = max_v(p.radius, none);
    // Behind a diffuse surface the profile is not told from diffuse, and its probes miss too often.
    bool plain = p.method == SubsurfaceMethod::BURLEY && (c.path_flags & PATH_DIFFUSE_ANCESTOR);
    float shortest = plain ? INFINITE_DISTANCE : max_f(SUBSURFACE_MIN_RADIUS, c.subsurface_min_radius);
    bool x = radius.x >= shortest, y = radius.y >= shortest, z = radius.z >= shortest;  // NaN: diffuse
    Lobe lobe;
    Color diffuse = {x ? 0.0f : whole.x, y ? 0.0f : whole.y, z ? 0.0f : whole.z};
    if (!(x && y && z) && start_lobe(lobe, LobeType::DIFFUSE, diffuse, normal, c)) add_lobe(set, lobe, c);
    if (!start_lobe(lobe, subsurface_lobe(p.method), whole - diffuse, normal, c)) return;
    // Chosen more often than its weight asks for: the walk is what is noisy.
    lobe.sample_weight *= float(int(x) + int(y) + int(z));
    lobe.c0 = color;
    lobe.c1 = {x ? radius.x : 0.0f, y ? radius.y : 0.0f, z ? radius.z : 0.0f};
    lobe.ior = clamp_f(p.ior, SUBSURFACE_MIN_IOR, SUBSURFACE_MAX_IOR);
    bool walk = p.method == SubsurfaceMethod::RANDOM_WALK, skin = p.method == SubsurfaceMethod::SKIN;
    lobe.extra = clamp_f(p.anisotropy, -SUBSURFACE_MAX_ANISOTROPY,
                         walk ? SUBSURFACE_MAX_ANISOTROPY : SUBSURFACE_MAX_ANISOTROPY_FIT);
    lobe.alpha_x = lobe.alpha_y = skin ? 1.0f : saturate_f(p.alpha);
    if (skin) lobe.c1 = skin_radius(lobe.c1, color, lobe.ior);
    if (!walk && !skin) lobe.c1 *= SUBSURFACE_RADIUS_SCALE;
    add_lobe(set, lobe, c);
}

}  // namespace luch
