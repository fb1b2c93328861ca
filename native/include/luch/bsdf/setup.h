// One setup function per Blender node: it turns the node's inputs into lobes, emission,
// transparency or holdout. `weight` is the closure's weight in its mix and add tree; where a node
// has a colour, `color` is passed beside it and not multiplied in. Normals need not be unit; the
// zero vector means "the shading normal". A zero tangent means isotropic. The nodes with many inputs
// (glossy, metallic, glass, refraction, principled) take a struct: setup_specular.h, principled.h.
#pragma once
#include "luch/bsdf/diffuse.h"
#include "luch/bsdf/principled.h"
#include "luch/bsdf/setup_specular.h"
#include "luch/bsdf/sheen.h"
#include "luch/bsdf/toon.h"
#include "luch/math/bounds.h"

namespace luch {

LUCH_FN void setup_diffuse(ClosureSet& set, Color weight, Color color, float roughness, Vec3 normal,
                           const SetupContext& c) {
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::DIFFUSE, weight * color, closure_normal(normal, c), c)) return;
    if (plan::ROUGH_DIFFUSE && roughness >= OREN_NAYAR_MIN_ROUGHNESS)
        prepare_oren_nayar(lobe, color, dot(lobe.normal, c.wo), roughness);
    add_lobe(set, lobe, c);
}

LUCH_FN void setup_toon(ClosureSet& set, Color weight, Color color, float size, float smooth, bool glossy, Vec3 normal,
                        const SetupContext& c) {
    if (glossy && !allows_reflective_caustics(c)) return;
    Lobe lobe;
    LobeType type = glossy ? LobeType::TOON_GLOSSY : LobeType::TOON_DIFFUSE;
    if (!start_lobe(lobe, type, weight * color, closure_normal(normal, c), c)) return;
    prepare_toon(lobe, size, smooth);
    add_lobe(set, lobe, c);
}

LUCH_FN void setup_translucent(ClosureSet& set, Color weight, Color color, Vec3 normal, const SetupContext& c) {
    Lobe lobe;
    Vec3 n = specular_normal(closure_normal(normal, c), c);
    if (start_lobe(lobe, LobeType::TRANSLUCENT, weight * color, n, c)) add_lobe(set, lobe, c);
}

LUCH_FN void setup_transparent(ClosureSet& set, Color weight, Color color) {
    Color through = weight * color;
    float mean = abs_f(average(through));
    if (mean >= LOBE_WEIGHT_CUTOFF && finite_f(mean)) set.transparent += through;  // NaN: nothing
}

LUCH_FN void setup_emission(ClosureSet& set, Color weight, Color color, float strength) {
    set.emission += weight * color * strength;
}
LUCH_FN void setup_background(ClosureSet& set, Color weight, Color color, float strength) {
    set.emission += weight * color * strength;
}

LUCH_FN void setup_holdout(ClosureSet& set, Color weight) { set.holdout += average(weight); }

LUCH_FN_SLOW void setup_sheen(ClosureSet& set, Color weight, Color color, float roughness, Vec3 normal,
                              const SetupContext& c) {
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::SHEEN, weight * color, closure_normal(normal, c), c)) return;
    if (prepare_sheen(lobe, c.wo, roughness)) add_lobe(set, lobe, c);
}

// The sheen node's older distribution.
LUCH_FN void setup_velvet(ClosureSet& set, Color weight, Color color, float roughness, Vec3 normal,
                          const SetupContext& c) {
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::ASHIKHMIN_SHEEN, weight * color, closure_normal(normal, c), c)) return;
    lobe.extra = 1.0f / sqr(clamp_f(roughness, VELVET_MIN_ROUGHNESS, 1.0f));
    add_lobe(set, lobe, c);
}

}  // namespace luch
