// One setup function per Blender node: it turns the node's inputs into lobes, emission,
// transparency or holdout. `weight` is the closure's weight in its mix and add tree; where a node
// has a colour, `color` is passed beside it and not multiplied in. Normals need not be unit; the
// zero vector means "the shading normal". A zero tangent means isotropic.
#pragma once
#include "luch/bsdf/diffuse.h"
#include "luch/bsdf/params.h"
#include "luch/bsdf/setup_context.h"

namespace luch {

LUCH_FN void setup_diffuse(ClosureSet& set, Color weight, Color color, float roughness, Vec3 normal,
                           const SetupContext& c) {
    Lobe lobe;
    if (!start_lobe(lobe, LobeType::DIFFUSE, weight * color, closure_normal(normal, c), c)) return;
    if (roughness >= OREN_NAYAR_MIN_ROUGHNESS) prepare_oren_nayar(lobe, color, dot(lobe.normal, c.wo), roughness);
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

// To come, in this very file's include list:
//   setup_glossy(ClosureSet&, Color weight, const GlossyParams&, const SetupContext&);
//   setup_metallic(ClosureSet&, Color weight, const MetallicParams&, const SetupContext&);
//   setup_glass(ClosureSet&, Color weight, const GlassParams&, const SetupContext&);
//   setup_refraction(ClosureSet&, Color weight, const RefractionParams&, const SetupContext&);
//   setup_sheen(ClosureSet&, Color weight, Color color, float roughness, Vec3 normal, const SetupContext&);
//   setup_velvet(ClosureSet&, Color weight, Color color, float roughness, Vec3 normal, const SetupContext&);
//   setup_principled(ClosureSet&, Color weight, const PrincipledParams&, const SetupContext&);

}  // namespace luch
