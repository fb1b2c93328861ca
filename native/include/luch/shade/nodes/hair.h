// Curves Info, and the closures of hair.
#pragma once
#include "luch/bsdf/setup_hair.h"
#include "luch/shade/nodes/closures.h"

namespace luch {

// Along a curve at the point, world, not unit; on a triangle along its first edge, on a sphere any tangent.
LUCH_FN_SLOW Vec3 fibre_direction(const OpContext& c, const InstanceView& instance) {
    const MeshView& mesh = c.scene->meshes[instance.mesh];
    const u32 prim = c.points->prim[c.lane];
    if (is_curve(mesh, prim)) {
        CurveSegment s = segment_at(*c.scene, instance, prim, time_at(c));
        return transform_direction(instance.to_world, curve_tangent(s, c.scene->curve_shape, c.points->u[c.lane]));
    }
    if (!is_triangle(mesh, prim)) return footprint_stencil(normal_at(c), 1.0f).dx;
    Triangle t = triangle_at(*c.scene, instance, prim, time_at(c));
    return transform_direction(instance.to_world, t.p[1] - t.p[0]);
}
LUCH_FN FibreSurface fibre_surface(const OpContext& c) {
    InstanceView moved;
    const InstanceView* instance = placed_at(c, &moved);
    bool curve = instance && is_curve(c.scene->meshes[instance->mesh], c.points->prim[c.lane]);
    Vec3 n = curve ? normal_at(c) : geometric_normal_at(c), t, b;
    make_frame(n, &t, &b);
    return {n, instance ? normalize_or(fibre_direction(c, *instance), t) : t};
}

// Curves Info; out: 1 on a curve, its thickness there in the world, the normal that lies across it towards the viewer.
LUCH_POINT_OP(OpCurvesInfo, 5, 0, {
    for (int k = 0; k < 5; k++) out[k] = 0.0f;
    InstanceView moved;
    const InstanceView* i = placed_at(c, &moved);
    const u32 prim = c.points->prim[c.lane];
    if (!i || !is_curve(c.scene->meshes[i->mesh], prim)) return;
    CurveSegment s = segment_at(*c.scene, *i, prim, time_at(c));
    float diameter = 2.0f * mix_f(s.k[1].radius, s.k[2].radius, c.points->u[c.lane]);
    out[0] = 1.0f;
    // A stretched one has many: this is the one towards (1, 1, 1), as Blender has it.
    out[1] = length(transform_direction(i->to_world, make_vec3(diameter * 0.57735027f)));
    Vec3 t = fibre_direction(c, *i);
    Vec3 wo = incoming_at(c);
    store_vec3(out + 2, safe_normalize(wo - t * safe_divide(dot(t, wo), dot(t, t))));
});

LUCH_LOBE_OP(OpClosurePrincipledHair, 19, 2, {  // params[1]: HairColor
    PrincipledHairParams p;
    p.color = read.vec3();
    p.melanin = read.number();
    p.melanin_redness = read.number();
    p.tint = read.vec3();
    p.absorption = read.vec3();
    p.roughness = read.number();
    p.radial_roughness = read.number();
    p.coat = read.number();
    p.ior = read.number();
    p.offset = read.number();
    p.random_color = read.number();
    p.random_roughness = read.number();
    p.random = read.number();
    p.parametrization = HairColor(params[1]);
    if constexpr (plan::FIBRES) setup_principled_hair(set, weight, p, fibre_surface(c), context);
});

LUCH_LOBE_OP(OpClosureHair, 9, 2, {  // colour, offset, roughness along and around, tangent; params[1]: transmission
    Color color = read.vec3();
    float offset = read.number();
    float along = read.number();
    float around = read.number();
    Vec3 tangent = read.vec3();
    FibreSurface surface = fibre_surface(c);
    if (!is_zero(tangent)) surface.tangent = normalize_or(tangent, surface.tangent);
    if constexpr (plan::HAIR_CONES)
        setup_hair(set, weight * color, params[1] != 0, offset, along, around, surface.tangent, context);
});

}  // namespace luch
