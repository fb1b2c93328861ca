// Which light photons bring and which light paths find, with photon maps (integrator "PHOTON").
//
// A vertex's lobes are sharp ones and the rest, "rough". Light that comes to a rough vertex over one or more sharp ones
// (a caustic) is brought by photons and gathered there; all other light paths find, as without photons. So a path that
// was at a rough vertex and since then left none but sharp lobes drops light that a photon could have started from, and
// every way from a lamp to the eye counts once. Source: Jensen 1996, "Global illumination using photon maps".
#pragma once
#include "luch/bsdf/bsdf.h"
#include "luch/integrator/render_view.h"

namespace luch {

// Lobes of a higher roughness squared are found well enough by paths, and spread photons widely: .1 is a roughness of .32.
inline constexpr float CAUSTIC_ALPHA = 0.1f;

LUCH_FN bool is_sharp(const Lobe& lobe) {
    return lobe.type >= LobeType::MICROFACET_REFLECTION && lobe.type <= LobeType::MICROFACET_GLASS &&
           max_f(lobe.alpha_x, lobe.alpha_y) <= CAUSTIC_ALPHA;
}

LUCH_FN bool has_photons(const RenderView& scene) { return plan::PHOTONS && scene.photon_maps; }

// Photons start at triangles that light meets and that a surface lit by them can see.
inline constexpr u32 CASTER_VISIBILITY = u32(RAY_SHADOW) | u32(RAY_DIFFUSE);

LUCH_FN bool casts_caustics(const SceneView& scene, u32 instance, u32 prim) {
    const InstanceView& at = scene.instances[instance];
    return (at.visibility & CASTER_VISIBILITY) == CASTER_VISIBILITY && is_triangle(scene.meshes[at.mesh], prim) &&
           scene.materials[material_at(scene, instance, prim)].casts_caustics != 0u;
}

// Sample weights of the sharp or of the rough lobes; of a surface that casts no caustics all count as rough.
LUCH_FN float part_weight(const ClosureSet& set, bool casts, bool sharp) {
    float sum = 0.0f;
    for (int i = 0; i < lobe_count(set); ++i)
        if ((casts && is_sharp(set.lobes[i])) == sharp) sum += set.lobes[i].sample_weight;
    return sum;
}

LUCH_FN void copy_part(const ClosureSet& set, bool casts, bool sharp, ClosureSet* part) {
    part->emission = set.emission, part->transparent = set.transparent;
    part->n_smooth = set.n_smooth, part->holdout = set.holdout;
    part->count = 0;
    for (int i = 0; i < lobe_count(set); ++i)
        if ((casts && is_sharp(set.lobes[i])) == sharp) part->lobes[part->count++] = set.lobes[i];
}

// Chooses one of the two parts by weight; *u becomes a fresh number. Returns its probability, *part its lobes.
LUCH_FN float choose_part(const ClosureSet& set, bool casts, float* u, bool* sharp, ClosureSet* part) {
    float sharp_weight = part_weight(set, casts, true), rough_weight = part_weight(set, casts, false);
    float probability = sharp_weight / (sharp_weight + rough_weight);
    *sharp = *u < probability;
    if (*sharp) {
        *u = min_f(*u / probability, BELOW_ONE);
    } else {
        *u = clamp_f((*u - probability) / (1.0f - probability), 0.0f, BELOW_ONE);
        probability = 1.0f - probability;
    }
    copy_part(set, casts, *sharp, part);
    return probability;
}

// What a bounce by that part makes of the path.
LUCH_FN void note_part(PathState& path, bool sharp) {
    if (!sharp)
        path.flags = (path.flags & ~u32(PATH_CAUSTIC)) | u32(PATH_AFTER_ROUGH);
    else if (path.flags & PATH_AFTER_ROUGH)
        path.flags |= PATH_CAUSTIC;
}

// Light that the path finds by itself is a caustic; where sampling of lights could choose it, too, photons bring it.
LUCH_FN bool is_caustic(const PathState& path) { return plan::PHOTONS && (path.flags & PATH_CAUSTIC); }

// What both parts scatter from wi, each by its own weight against finding the light by chance. pdf: of the sampled
// light; mis: it can be found by chance. Caustics are left out.
LUCH_FN BsdfValue eval_parts(const PathState& path, const ClosureSet& set, bool casts, Vec3 ng, Vec3 wo, Vec3 wi,
                             float pdf, bool mis) {
    BsdfValue sum = {};
    ClosureSet part;
    float whole = lobe_weight_sum(set) + average(set.transparent);
    for (int sharp = 0; sharp < 2; ++sharp) {
        if (sharp && (path.flags & PATH_AFTER_ROUGH)) break;
        copy_part(set, casts, sharp != 0, &part);
        if (part.count == 0) continue;
        float own_pdf = 0.0f;
        BsdfValue value = eval_closures(part, ng, wo, wi, &own_pdf);
        float weight = mis ? mis_weight(pdf, own_pdf * lobe_weight_sum(part) / whole) : 1.0f;
        sum.diffuse += value.diffuse * weight;
        sum.glossy += value.glossy * weight;
        sum.transmission += value.transmission * weight;
    }
    return sum;
}

}  // namespace luch
