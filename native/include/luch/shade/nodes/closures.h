// Operations that end in a closure: in[0..2] is the weight, what follows are the closure's own inputs.
// What they do with them stands in bsdf/setup.h; here inputs only find their names. A normal of zero
// length means the shading normal, a tangent of zero length that the lobe is round.
#pragma once
#include "luch/bsdf/setup.h"
#include "luch/math/bounds.h"
#include "luch/shade/nodes/point.h"

namespace luch {

// Reads a closure's inputs one after the other.
struct InputReader {
    const float* next;
    LUCH_FN float number() { return *next++; }
    LUCH_FN Vec3 vec3() {
        next += 3;
        return {next[-3], next[-2], next[-1]};
    }
};

// Bits of a lobe's params[0].
inline constexpr u32 BUMP_CORRECTION = 1u, OWN_NORMAL = 2u;  // SetupContext

LUCH_FN SetupContext setup_context(const OpContext& c, u32 normals) {
    SetupContext s;
    s.n = normal_at(c);
    s.ng = geometric_normal_at(c);
    s.wo = incoming_at(c);
    s.path_flags = c.points->flags[c.lane];
    s.caustics_reflective = !(c.scene->flags & SCENE_NO_REFLECTIVE_CAUSTICS);
    s.caustics_refractive = !(c.scene->flags & SCENE_NO_REFRACTIVE_CAUSTICS);
    s.bump_correction = (normals & BUMP_CORRECTION) != 0;
    s.own_normal = (normals & OWN_NORMAL) != 0;
    return s;
}
// Emission and shadow rays have no use for lobes.
LUCH_FN bool skips_lobes(const OpContext& c) {
    return (c.points->flags[c.lane] & (PATH_EMISSION_ONLY | PATH_TRANSPARENT_ONLY)) != 0;
}

// Radiance in W m^-2 sr^-1: weight alone (colour x strength x mix weights).
struct OpClosureEmission {
    static constexpr int inputs = 3, outputs = 0;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float*) {
        setup_emission(*c.closures, load_vec3(in), make_vec3(1.0f), 1.0f);
    }
};

struct OpClosureTransparent {
    static constexpr int inputs = 3, outputs = 0;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float*) {
        setup_transparent(*c.closures, load_vec3(in), make_vec3(1.0f));
    }
};

struct OpClosureHoldout {
    static constexpr int inputs = 3, outputs = 0;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float*) {
        setup_holdout(*c.closures, load_vec3(in));
    }
};

// A lobe. NUMBERS inputs after the weight; params[0]: BUMP_CORRECTION, OWN_NORMAL; BODY has `read` (the inputs),
// `weight`, `set` and `context`.
#define LUCH_LOBE_OP(STRUCT, NUMBERS, PARAMS, BODY)                                                \
    struct STRUCT {                                                                                \
        static constexpr int inputs = 3 + NUMBERS, outputs = 0, params = PARAMS;                   \
        LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float*) { \
            if (skips_lobes(c)) return;                                                            \
            InputReader read{in};                                                                  \
            Color weight = read.vec3();                                                            \
            SetupContext context = setup_context(c, params[0]);                                    \
            ClosureSet& set = *c.closures;                                                         \
            BODY                                                                                   \
        }                                                                                          \
    }

LUCH_LOBE_OP(OpClosureDiffuse, 7, 1, {  // colour, roughness, normal
    Color color = read.vec3();
    float roughness = read.number();
    setup_diffuse(set, weight, color, roughness, read.vec3(), context);
});
LUCH_LOBE_OP(OpClosureTranslucent, 6, 1, {  // colour, normal
    Color color = read.vec3();
    setup_translucent(set, weight, color, read.vec3(), context);
});

LUCH_LOBE_OP(OpClosureSheen, 7, 2, {  // colour, roughness, normal; params[1]: Ashikhmin's velvet
    Color color = read.vec3();
    float roughness = read.number();
    Vec3 normal = read.vec3();
    if (params[1] != 0) {
        setup_velvet(set, weight, color, roughness, normal, context);
    } else {
        setup_sheen(set, weight, color, roughness, normal, context);
    }
});

LUCH_LOBE_OP(OpClosureToon, 8, 2, {  // colour, size, smooth, normal; params[1]: glossy
    Color color = read.vec3();
    float size = read.number();
    float smooth = read.number();
    setup_toon(set, weight, color, size, smooth, params[1] != 0, read.vec3(), context);
});

LUCH_LOBE_OP(OpClosureGlossy, 12, 2, {  // params[1]: Microfacets, here and below
    GlossyParams p;
    p.color = read.vec3();
    p.roughness = read.number();
    p.anisotropy = read.number();
    p.rotation = read.number();
    p.normal = read.vec3();
    p.tangent = read.vec3();
    p.distribution = Microfacets(params[1]);
    setup_glossy(set, weight, p, context);
});

LUCH_LOBE_OP(OpClosureMetallic, 23, 3, {  // params[2]: physical conductor
    MetallicParams p;
    p.physical = params[2] != 0;
    p.base_color = read.vec3();
    p.edge_tint = read.vec3();
    p.ior = read.vec3();
    p.extinction = read.vec3();
    p.roughness = read.number();
    p.anisotropy = read.number();
    p.rotation = read.number();
    p.normal = read.vec3();
    p.tangent = read.vec3();
    p.thin_film_thickness = read.number();
    p.thin_film_ior = read.number();
    p.distribution = Microfacets(params[1]);
    setup_metallic(set, weight, p, context);
});

LUCH_LOBE_OP(OpClosureGlass, 10, 2, {
    GlassParams p;
    p.color = read.vec3();
    p.roughness = read.number();
    p.ior = read.number();
    p.normal = read.vec3();
    p.thin_film_thickness = read.number();
    p.thin_film_ior = read.number();
    p.distribution = Microfacets(params[1]);
    setup_glass(set, weight, p, context);
});

LUCH_LOBE_OP(OpClosureRefraction, 8, 2, {
    RefractionParams p;
    p.color = read.vec3();
    p.roughness = read.number();
    p.ior = read.number();
    p.normal = read.vec3();
    p.distribution = Microfacets(params[1]);
    setup_refraction(set, weight, p, context);
});

// Principled; alpha is part of the weight already. params: bump correction, multiple scattering,
// emits (its emission lies under a coat or sheen; elsewhere it is an emission closure of its own),
// lets through (a thin wall may have a transparent part).
struct OpClosurePrincipled {
    static constexpr int inputs = 3 + 43, outputs = 0, params = 4;
    LUCH_FN static PrincipledParams parameters(InputReader& read, const u32* params) {
        PrincipledParams p;
        p.base_color = read.vec3();
        p.metallic = read.number();
        p.roughness = read.number();
        p.ior = read.number();
        p.thin_wall = read.number() != 0.0f;
        p.normal = read.vec3();
        p.diffuse_roughness = read.number();
        p.subsurface_weight = read.number();
        p.subsurface_anisotropy = read.number();
        p.specular_ior_level = read.number();
        p.specular_tint = read.vec3();
        p.anisotropic = read.number();
        p.anisotropic_rotation = read.number();
        p.tangent = read.vec3();
        p.transmission_weight = read.number();
        p.coat_weight = read.number();
        p.coat_roughness = read.number();
        p.coat_ior = read.number();
        p.coat_tint = read.vec3();
        p.coat_normal = read.vec3();
        p.sheen_weight = read.number();
        p.sheen_roughness = read.number();
        p.sheen_tint = read.vec3();
        p.emission_color = read.vec3();
        p.emission_strength = read.number();
        p.thin_film_thickness = read.number();
        p.thin_film_ior = read.number();
        p.multiple_scattering = params[1] != 0;
        return p;
    }
    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float*) {
        const u32 flags = c.points->flags[c.lane];
        if ((flags & PATH_EMISSION_ONLY) && params[2] == 0) return;
        if ((flags & PATH_TRANSPARENT_ONLY) && params[3] == 0) return;
        InputReader read{in};
        Color weight = read.vec3();
        setup_principled(*c.closures, weight, parameters(read, params), setup_context(c, params[0]));
    }
};

// Where light may go in: triangles. In a sphere that is seen from outside alone, a walk would find no way out.
LUCH_FN float smallest_walk_radius(const OpContext& c) {
    u32 instance = c.points->instance[c.lane];
    if (instance == NONE) return INFINITE_DISTANCE;
    if (!is_triangle(c.scene->meshes[c.scene->instances[instance].mesh], c.points->prim[c.lane]))
        return INFINITE_DISTANCE;
    return SUBSURFACE_MIN_ULP * EPS * max_component(abs_v(position_at(c)));
}

LUCH_LOBE_OP(OpClosureSubsurface, 12, 2, {  // params[1]: SubsurfaceMethod
    SubsurfaceParams p;
    p.color = read.vec3();
    p.radius = read.vec3();
    p.ior = read.number();
    p.alpha = read.number();
    p.anisotropy = read.number();
    p.normal = read.vec3();
    p.method = SubsurfaceMethod(params[1]);
    context.subsurface_min_radius = smallest_walk_radius(c);
    setup_subsurface(set, weight, p, context);
});

// Principled that scatters under its surface. params[4]: SubsurfaceMethod.
struct OpClosurePrincipledSubsurface {
    static constexpr int inputs = OpClosurePrincipled::inputs + 4, outputs = 0, params = 5;
    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float*) {
        const u32 flags = c.points->flags[c.lane];
        if ((flags & PATH_EMISSION_ONLY) && params[2] == 0) return;
        if ((flags & PATH_TRANSPARENT_ONLY) && params[3] == 0) return;
        InputReader read{in};
        Color weight = read.vec3();
        Vec3 radius = read.vec3();
        float ior = read.number();
        PrincipledParams p = OpClosurePrincipled::parameters(read, params);
        p.subsurface_radius = radius;
        p.subsurface_ior = ior;
        p.subsurface_method = SubsurfaceMethod(params[4]);
        SetupContext context = setup_context(c, params[0]);
        context.subsurface_min_radius = smallest_walk_radius(c);
        setup_principled(*c.closures, weight, p, context);
    }
};

// AOV Output: in = red, green, blue, alpha (a value AOV reads the first); params: AOV slot.
struct OpStoreAov {
    static constexpr int inputs = 4, outputs = 0, params = 1;
    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float*) {
        const u32 aov = aov_of(c, params[0]);
        if (!c.aovs || aov == NONE) return;
        for (int k = 0; k < 4; k++) c.aovs[4 * aov + u32(k)] = in[k];
    }
};

}  // namespace luch
