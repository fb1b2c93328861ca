// Closures at one shading point: a short list of lobes with weights. Shader programs append lobes;
// the integrator evaluates and samples the list. One lobe model is one header beside this one.
#pragma once
#include "luch/math/vec.h"
#include "luch/plan.h"

namespace luch {

enum class LobeType : u8 {
    NONE_,
    DIFFUSE,         // Lambert
    OREN_NAYAR,
    TRANSLUCENT,
    TOON_DIFFUSE,
    // Scatter under the surface: no direction finds them, the integrator walks inside. c0: colour, c1: radii in metres,
    // ior and alpha_x: of the interface, extra: anisotropy (bsdf/subsurface.h).
    SUBSURFACE,         // random walk, the radius as given
    SUBSURFACE_SKIN,    // random walk, the radius made fit the colour; half of the entries diffuse
    SUBSURFACE_LEGACY,  // random walk of Blender before 5.2
    SUBSURFACE_DISK,    // Christensen and Burley's profile, probed
    SHEEN,           // microfibre, LTC; the last that counts as diffuse
    ASHIKHMIN_SHEEN, // legacy velvet
    TOON_GLOSSY,
    MICROFACET_REFLECTION,    // GGX / Beckmann; fresnel says which
    MICROFACET_REFRACTION,
    MICROFACET_GLASS,         // reflection and refraction in one lobe
    ASHIKHMIN_SHIRLEY,
    HAIR_FIBRE,               // Principled Hair
    HAIR_REFLECTION,          // the Hair BSDF node
    HAIR_TRANSMISSION,
    // ray portal: later, one line here and one header
};

// What a lobe counts as for passes, bounces and ray visibility.
enum LobeClass : u8 { CLASS_DIFFUSE = 0, CLASS_GLOSSY = 1, CLASS_TRANSMISSION = 2 };

// How a microfacet lobe reflects; the parameters lie in Lobe::c0, c1, c2, ior.
enum class Fresnel : u8 { NONE_, DIELECTRIC, CONDUCTOR, F82_TINT, GENERALIZED_SCHLICK };

enum class Distribution : u8 { GGX, BECKMANN };

enum LobeFlag : u8 {
    // The lobe is a reflection seen through the surface: directions meet it mirrored at the surface
    // and its normal points to the far side (thin walls).
    LOBE_MIRRORED = 1u,
    LOBE_BUMPED = 2u,     // normal is not the interpolated one: light leaks must be tested for
    LOBE_SOFTENED = 4u,   // bumped diffuse lobe whose terminator is softened
    LOBE_BLURRED = 8u,    // Filter Glossy has made it rougher
};

struct Lobe {
    LobeType type;
    Fresnel fresnel;
    Distribution distribution;
    u8 flags;             // LobeFlag
    float sample_weight;  // relative probability of being chosen; > 0
    Color weight;         // multiplies the lobe
    Vec3 normal;          // unit
    Vec3 tangent;         // unit, perpendicular to normal; only for anisotropy and sheen
    float alpha_x, alpha_y;  // roughness squared, or the model's own
    float ior;
    float extra;          // lobe specific
    Color c0, c1, c2;     // Fresnel parameters: tints, f0, f90, n and k; lobe specific
    float energy_scale;   // multiple-scattering compensation
    float thin_film_thickness, thin_film_ior;
};

struct ClosureSet {
    int count;
    Color emission;     // W m^-2 sr^-1, sum of emission closures
    Color transparent;  // straight-through transmission, sum of Transparent closures
    Vec3 n_smooth;      // interpolated normal before bump, set with every lobe
    float holdout;      // weight of Holdout closures
    Lobe lobes[plan::MOST_LOBES];
};

// Reflected radiance per class for unit incident radiance, times |cos|.
struct BsdfValue {
    Color diffuse, glossy, transmission;
};
LUCH_FN Color total(const BsdfValue& v) { return v.diffuse + v.glossy + v.transmission; }

struct BsdfSample {
    Vec3 direction;   // unit, away from the point
    Color throughput; // sum over lobes of f |cos| / pdf (for a delta lobe: of that lobe alone)
    float pdf_sa;     // per steradian; for a delta lobe 1 and `delta` is set; 0: no sample
    float roughness;  // of the chosen lobe, min(alpha_x, alpha_y), 1 for diffuse (Filter Glossy)
    float eta;        // relative IOR when the ray was refracted, else 1
    LobeClass lobe_class;
    bool delta, transmitted;
    BsdfValue value;  // f |cos| per class, for pass bookkeeping (not for delta)
};

// Implemented in bsdf/bsdf.h (room "bsdf"):
//   BsdfValue eval_closures(const ClosureSet&, Vec3 n_geometric, Vec3 wo, Vec3 wi, float* pdf_sa);
//   BsdfSample sample_closures(const ClosureSet&, Vec3 n_geometric, Vec3 wo, float u_lobe, Vec2 u);
//   void blur_closures(ClosureSet&, float roughness);                 // Filter Glossy
//   BsdfValue closure_albedo(const ClosureSet&, Vec3 wo);            // Diffuse/Glossy/Transmission Color
//   Vec3 shading_normal(const ClosureSet&, Vec3 fallback);           // Denoising Normal
// and one setup function per Blender node, in bsdf/setup.h:
//   void setup_principled(ClosureSet&, Color weight, const PrincipledParams&, const SetupContext&); ...

}  // namespace luch
