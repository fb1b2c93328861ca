// Geometry, Texture Coordinate, Object Info, Light Path, Camera Data: what the point itself knows.
// Operations on a place take the corner of the bump stencil in params[0..1] (see attribute.h).
#pragma once
#include "luch/camera/camera.h"
#include "luch/light/light.h"
#include "luch/shade/nodes/attribute.h"
#include "luch/shade/textures/hash.h"

namespace luch {

LUCH_FN Vec3 position_at(const OpContext& c) {
    return {c.points->px[c.lane], c.points->py[c.lane], c.points->pz[c.lane]};
}
LUCH_FN Vec3 normal_at(const OpContext& c) {
    return {c.points->nx[c.lane], c.points->ny[c.lane], c.points->nz[c.lane]};
}
LUCH_FN Vec3 incoming_at(const OpContext& c) {
    return {c.points->ix[c.lane], c.points->iy[c.lane], c.points->iz[c.lane]};
}
// Lamps and the world have no instance; their position is a direction or lies on the lamp.
LUCH_FN const InstanceView* instance_at(const OpContext& c) {
    const u32 index = c.points->instance[c.lane];
    return index == NONE ? nullptr : c.scene->instances + index;
}

// The same as it stands at the path's time; *moved: room for one that moves.
LUCH_FN const InstanceView* placed_at(const OpContext& c, InstanceView* moved) {
    const u32 index = c.points->instance[c.lane];
    return index == NONE ? nullptr : &instance_at_time(*c.scene, index, time_at(c), moved);
}

LUCH_FN const LampView* lamp_at(const OpContext& c) {
    const u32 index = c.points->prim[c.lane];
    return c.points->instance[c.lane] == NONE && index != NONE ? c.scene->lights->lamps + index : nullptr;
}
LUCH_FN bool is_distant(const OpContext& c) {  // a sun or the world
    if (c.points->instance[c.lane] != NONE) return false;
    const LampView* lamp = lamp_at(c);
    return !lamp || lamp->kind == LampKind::SUN;
}
// Blender's world position: the scene's origin is added back. A world's direction stays one, a sun's
// place is the direction in which it shines.
LUCH_FN Vec3 blender_position(const OpContext& c, Vec3 p) {
    if (!is_distant(c)) return p + c.scene->origin;
    return lamp_at(c) ? -p : p;
}
LUCH_FN Vec3 to_lamp(const LampView& lamp, Vec3 v) {
    const float* m = lamp.to_local;
    return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
            m[6] * v.x + m[7] * v.y + m[8] * v.z};
}
LUCH_FN Vec3 lamp_parameters(const OpContext& c) { return {c.points->u[c.lane], c.points->v[c.lane], 0.0f}; }

// An input operation of no inputs: BODY sets out from c and params.
#define LUCH_POINT_OP(STRUCT, OUTPUTS, PARAMS, BODY)                                                \
    struct STRUCT {                                                                                 \
        static constexpr int inputs = 0, outputs = OUTPUTS, params = PARAMS;                        \
        static constexpr bool reads_point = true;                                                   \
        LUCH_FN static void eval(const OpContext& c, const u32* params, const float*, float* out) { \
            (void)params;                                                                           \
            BODY                                                                                    \
        }                                                                                           \
    }

LUCH_POINT_OP(OpPointPosition, 3, 2,
              { store_vec3(out, blender_position(c, position_at(c) + stencil_offset(c, params))); });
LUCH_POINT_OP(OpPointNormal, 3, 0, { store_vec3(out, normal_at(c)); });
LUCH_POINT_OP(OpPointTrueNormal, 3, 0, { store_vec3(out, geometric_normal_at(c)); });
LUCH_POINT_OP(OpPointIncoming, 3, 0, { store_vec3(out, incoming_at(c)); });
LUCH_POINT_OP(OpPointBackfacing, 1, 0, { out[0] = (c.points->flags[c.lane] & PATH_BACKFACING) ? 1.0f : 0.0f; });
// Barycentrics as Blender counts them: weight of the first corner, of the second.
LUCH_POINT_OP(OpPointParametric, 3, 2, {
    if (c.points->instance[c.lane] == NONE)
        return store_vec3(out, lamp_at(c) ? lamp_parameters(c) : make_vec3(1.0f, 0.0f, 0.0f));
    Vec2 uv = barycentrics_at(c, params);
    store_vec3(out, {1.0f - uv.x - uv.y, uv.x, 0.0f});
});

// Object space; params[2..13]: another object's world-to-object matrix in Blender's world, where
// the instruction has it.
LUCH_FN Vec3 object_position(const OpContext& c, const u32* params) {
    InstanceView moved;
    const InstanceView* instance = placed_at(c, &moved);
    Vec3 p = position_at(c) + stencil_offset(c, params);
    if (instance) return transform_point(instance->to_object, p);
    const LampView* lamp = lamp_at(c);
    return lamp ? to_lamp(*lamp, blender_position(c, p) - (lamp->position + c.scene->origin)) : p;
}
LUCH_POINT_OP(OpPointObject, 3, 2, { store_vec3(out, object_position(c, params)); });
LUCH_POINT_OP(OpPointOtherObject, 3, 14, {
    Affine to_object;
    for (int k = 0; k < 12; k++) to_object.m[k] = bits_float(params[2 + k]);
    Vec3 p = blender_position(c, position_at(c) + stencil_offset(c, params));
    store_vec3(out, transform_point(to_object, p));
});
LUCH_FN Vec3 normal_to_object(const InstanceView* instance, Vec3 n) {
    return instance ? safe_normalize(transform_direction_transposed(instance->to_world, n)) : n;
}
LUCH_FN Vec3 normal_to_world(const InstanceView* instance, Vec3 n) {
    return instance ? safe_normalize(transform_direction_transposed(instance->to_object, n)) : n;
}
LUCH_POINT_OP(OpPointObjectNormal, 3, 0, {
    InstanceView moved;
    const LampView* lamp = lamp_at(c);
    store_vec3(out, lamp ? safe_normalize(to_lamp(*lamp, normal_at(c)))
                         : normal_to_object(placed_at(c, &moved), normal_at(c)));
});

// 0..1 over Blender's texture space; an attribute of undeformed coordinates wins.
LUCH_FN Vec3 generated_at(const OpContext& c, const u32* params) {
    const InstanceView* instance = instance_at(c);
    if (!instance) return object_position(c, params);
    AttributeValue a = read_attribute(c, c.scene->generated_attribute, params);
    if (a.channels >= 3) return load_vec3(a.value);
    const MeshView& mesh = c.scene->meshes[instance->mesh];
    Vec3 p = object_position(c, params) - mesh.texture_location;
    Vec3 size = mesh.texture_size;
    return {safe_divide(p.x, size.x) * 0.5f + 0.5f, safe_divide(p.y, size.y) * 0.5f + 0.5f,
            safe_divide(p.z, size.z) * 0.5f + 0.5f};
}
LUCH_POINT_OP(OpPointGenerated, 3, 2, { store_vec3(out, generated_at(c, params)); });
LUCH_POINT_OP(OpInstancerGenerated, 3, 0, {
    const InstanceView* instance = instance_at(c);
    store_vec3(out, instance ? instance->generated : make_vec3(0.0f));
});
LUCH_POINT_OP(OpInstancerUv, 3, 0, {
    const InstanceView* instance = instance_at(c);
    store_vec3(out, instance ? make_vec3(instance->uv.x, instance->uv.y, 0.0f) : make_vec3(0.0f));
});

LUCH_POINT_OP(OpPointCamera, 3, 2, {
    Vec3 p = position_at(c) + stencil_offset(c, params);
    if (!c.scene->camera) return store_vec3(out, make_vec3(0.0f));
    if (!instance_at(c)) p = p + camera_position(*c.scene->camera);
    store_vec3(out, transform_point(c.scene->camera->to_camera, p));
});
LUCH_POINT_OP(OpPointWindow, 3, 2, {
    Vec3 p = position_at(c);
    if (!c.scene->camera) return store_vec3(out, make_vec3(0.0f));
    if (!instance_at(c)) p = p + camera_position(*c.scene->camera);
    Vec2 raster = world_to_raster(*c.scene->camera, p);
    // One corner of the stencil is one pixel.
    float step = params[0] == 0 ? 0.0f : bits_float(params[1]);
    raster = raster + (params[0] == 1 ? make_vec2(step, 0.0f) : make_vec2(0.0f, step));
    store_vec3(out, {raster.x / c.scene->frame_size.x, raster.y / c.scene->frame_size.y, 0.0f});
});
LUCH_POINT_OP(OpPointReflection, 3, 0, {
    Vec3 i = incoming_at(c);
    store_vec3(out, instance_at(c) ? reflect(i, normal_at(c)) : i);
});
// out: unit direction from the camera, camera space; depth along the axis; distance.
LUCH_POINT_OP(OpCameraData, 5, 0, {
    Vec3 p = make_vec3(0.0f);
    // A world's direction is taken for a place, as in Cycles.
    Vec3 place = instance_at(c) ? position_at(c) : position_at(c) - c.scene->origin;
    if (c.scene->camera) p = transform_point(c.scene->camera->to_camera, place);
    store_vec3(out, safe_normalize(p));
    out[3] = p.z;
    out[4] = length(p);
});

LUCH_POINT_OP(OpObjectLocation, 3, 0, {
    InstanceView moved;
    const InstanceView* i = placed_at(c, &moved);
    const LampView* lamp = lamp_at(c);
    Vec3 place = lamp ? lamp->position + c.scene->origin : make_vec3(0.0f);
    if (i) place = make_vec3(i->to_world.m[3], i->to_world.m[7], i->to_world.m[11]) + c.scene->origin;
    store_vec3(out, place);
});
LUCH_POINT_OP(OpObjectColor, 4, 0, {
    const InstanceView* i = instance_at(c);
    for (int k = 0; k < 4; k++) out[k] = i ? c.scene->objects[i->object].color[k] : 0.0f;
});
LUCH_POINT_OP(OpObjectIndex, 1, 0, {
    const InstanceView* i = instance_at(c);
    out[0] = i ? c.scene->objects[i->object].pass_index : 0.0f;
});
LUCH_POINT_OP(OpObjectRandom, 1, 0, {
    const InstanceView* i = instance_at(c);
    const LampView* lamp = lamp_at(c);
    out[0] = i ? i->random : (lamp ? lamp->random : 0.0f);
});

// Point Info; out: centre in Blender's world, radius there, random number. Zero where the point is on no sphere.
LUCH_POINT_OP(OpPointInfo, 5, 0, {
    for (int k = 0; k < 5; k++) out[k] = 0.0f;
    InstanceView moved;
    const InstanceView* i = placed_at(c, &moved);
    const u32 prim = c.points->prim[c.lane];
    if (!i || !is_sphere(c.scene->meshes[i->mesh], prim)) return;
    const MeshView& mesh = c.scene->meshes[i->mesh];
    const float* s = sphere_at(*c.scene, mesh, prim);
    store_vec3(out, transform_point(i->to_world, load_vec3(s)) + c.scene->origin);
    // A stretched one has many radii: this is the one towards (1, 1, 1), as Blender has it.
    out[3] = length(transform_direction(i->to_world, make_vec3(abs_f(s[3]) * 0.57735027f)));
    out[4] = float(hash_words(prim - mesh.triangle_count, 0u)) * (1.0f / 4294967295.0f);
});

// params[0]: bits of PathFlag, any of which gives 1.
LUCH_POINT_OP(OpLightPathFlag, 1, 1, { out[0] = (c.points->flags[c.lane] & params[0]) ? 1.0f : 0.0f; });
LUCH_POINT_OP(OpLightPathLength, 1, 0, { out[0] = c.points->ray_length[c.lane]; });
// Light that arrives (from the world, a lamp, a sampled point, or by a shadow ray) counts as one bounce
// further.
LUCH_POINT_OP(OpLightPathDepth, 1, 0, {
    const bool arrives =
        (c.points->flags[c.lane] & (PATH_SHADOW | PATH_EMISSION_ONLY)) != 0 || c.points->instance[c.lane] == NONE;
    out[0] = float(c.points->depth[c.lane] & 255u) + (arrives ? 1.0f : 0.0f);
});
// params[0]: 8 diffuse, 16 glossy, 24 transmission.
LUCH_POINT_OP(OpLightPathKindDepth, 1, 1, { out[0] = float((c.points->depth[c.lane] >> params[0]) & 255u); });
LUCH_POINT_OP(OpLightPathTransparentDepth, 1, 0, { out[0] = float(c.points->transparent_depth[c.lane]); });

// Light Falloff; in: strength, smooth; out: quadratic, linear, constant.
struct OpLightFalloff {
    static constexpr int inputs = 2, outputs = 3;
    static constexpr bool reads_point = true;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float* out) {
        float length = c.points->ray_length[c.lane];
        bool distant = is_distant(c) || !(length < 1e30f);  // there the node does nothing
        float squared = length * length;
        float smooth = in[1] > 0.0f ? squared / (in[1] + squared) : 1.0f;
        out[0] = distant ? in[0] : in[0] * smooth;
        out[1] = distant ? in[0] : in[0] * length * smooth;
        out[2] = distant ? in[0] : in[0] * squared * smooth;
    }
};

// Wireframe; in: size; out: 1 within half of size of an edge. params: stencil, pixel size.
struct OpWireframe {
    static constexpr int inputs = 1, outputs = 1, params = 3;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        out[0] = 0.0f;
        InstanceView moved;
        const InstanceView* instance = placed_at(c, &moved);
        if (!instance) return;
        const MeshView& mesh = c.scene->meshes[instance->mesh];
        if (!is_triangle(mesh, c.points->prim[c.lane])) return;
        Triangle t = triangle_at(*c.scene, *instance, c.points->prim[c.lane], time_at(c));
        float width = 1.0f;
        if (params[2] != 0) {  // seen across the ray
            Stencil s = stencil_at(c);
            Vec3 i = incoming_at(c);
            width = 0.5f * (length(s.dx - i * dot(s.dx, i)) + length(s.dy - i * dot(s.dy, i)));
        }
        float reach = sqr(0.5f * width * in[0]);
        Vec3 p = position_at(c) + stencil_offset(c, params);
        for (int k = 0; k < 3; k++) {
            Vec3 a = transform_point(instance->to_world, t.p[k]);
            Vec3 edge = a - transform_point(instance->to_world, t.p[k == 0 ? 2 : k - 1]);
            Vec3 area = cross(edge, p - a);
            if (dot(area, area) < dot(edge, edge) * reach) out[0] = 1.0f;
        }
    }
};

// Vector Transform between object, world and camera; params: from, to (0 world, 1 object, 2 camera),
// kind (0 vector, 1 point, 2 normal).
struct OpVectorTransform {
    static constexpr int inputs = 3, outputs = 3, params = 3;
    static constexpr bool reads_point = true;
    // Applies `to`, whose inverse is `from`, to a vector, point or normal.
    LUCH_FN static Vec3 apply(const Affine& to, const Affine& from, Vec3 v, u32 kind) {
        if (kind == 1) return transform_point(to, v);
        return kind == 0 ? transform_direction(to, v) : safe_normalize(transform_direction_transposed(from, v));
    }
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        Vec3 v = load_vec3(in);
        const u32 from = params[0], to = params[1], kind = params[2];
        InstanceView moved;
        const InstanceView* instance = placed_at(c, &moved);
        const Vec3 origin = kind == 1 ? c.scene->origin : make_vec3(0.0f);
        if (from == to) return store_vec3(out, v);
        // To camera-relative world space, then to where it is wanted.
        if (from == 0) v = v - origin;
        if (from == 1 && instance) v = apply(instance->to_world, instance->to_object, v, kind);
        if (from == 2 && c.scene->camera) v = apply(c.scene->camera->to_world, c.scene->camera->to_camera, v, kind);
        if (to == 0) v = v + origin;
        if (to == 1 && instance) v = apply(instance->to_object, instance->to_world, v, kind);
        if (to == 2 && c.scene->camera) v = apply(c.scene->camera->to_camera, c.scene->camera->to_world, v, kind);
        store_vec3(out, v);
    }
};

}  // namespace luch
