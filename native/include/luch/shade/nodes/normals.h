// Nodes about normals: Fresnel, Layer Weight, Tangent, Bump, Normal Map, Displacement.
#pragma once
#include "luch/math/bounds.h"
#include "luch/shade/nodes/point.h"

namespace luch {

// Reflectance of a smooth dielectric interface for unpolarised light; eta: index ratio, inside over
// outside as the ray meets it. Total reflection gives 1.
LUCH_FN float dielectric_reflectance(float cos_incident, float eta) {
    float c = abs_f(cos_incident);
    float g2 = eta * eta - 1.0f + c * c;
    float g = safe_sqrt(g2);
    float a = (g - c) / (g + c), b = (c * (g + c) - 1.0f) / (c * (g - c) + 1.0f);
    return g2 > 0.0f ? 0.5f * a * a * (1.0f + b * b) : 1.0f;
}

struct OpFresnel {  // in: index, normal
    static constexpr int inputs = 4, outputs = 1;
    static constexpr bool reads_point = true;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float* out) {
        float eta = max_f(in[0], SMALLEST_IOR);
        eta = (c.points->flags[c.lane] & PATH_BACKFACING) ? 1.0f / eta : eta;
        out[0] = dielectric_reflectance(dot(incoming_at(c), load_vec3(in + 1)), eta);
    }
};
struct OpLayerWeightFresnel {  // in: blend, normal
    static constexpr int inputs = 4, outputs = 1;
    static constexpr bool reads_point = true;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float* out) {
        float eta = max_f(1.0f - in[0], SMALLEST_IOR);
        eta = (c.points->flags[c.lane] & PATH_BACKFACING) ? eta : 1.0f / eta;
        out[0] = dielectric_reflectance(dot(incoming_at(c), load_vec3(in + 1)), eta);
    }
};
struct OpLayerWeightFacing {  // in: blend, normal
    static constexpr int inputs = 4, outputs = 1;
    static constexpr bool reads_point = true;
    LUCH_FN static void eval(const OpContext& c, const u32*, const float* in, float* out) {
        float f = abs_f(dot(incoming_at(c), load_vec3(in + 1)));
        float blend = clamp_f(in[0], 0.0f, 1.0f - LAYER_FACING_MARGIN);
        float exponent = blend < 0.5f ? 2.0f * blend : 0.5f / (1.0f - blend);
        out[0] = 1.0f - (in[0] != 0.5f ? pow_f(f, exponent) : f);
    }
};

// The part of an object-space direction that lies in the surface, unit, world space.
LUCH_FN Vec3 surface_tangent(const OpContext& c, Vec3 direction_object) {
    Vec3 n = normal_at(c);
    InstanceView moved;
    Vec3 t = normal_to_world(placed_at(c, &moved), direction_object);
    return cross(n, normalize(cross(t, n)));
}
// params: stencil (unused corner 0), axis 0..2; 3: the surface's own tangent, around Z on a mesh. A sphere of a point cloud
// has no generated coordinates: places in Blender's world serve, and any tangent is its own.
struct OpTangentRadial {
    static constexpr int inputs = 0, outputs = 3, params = 3;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float*, float* out) {
        const InstanceView* i = instance_at(c);
        const bool sphere = i && is_sphere(c.scene->meshes[i->mesh], c.points->prim[c.lane]);
        if (sphere && params[2] == 3) return store_vec3(out, footprint_stencil(normal_at(c), 1.0f).dx);
        Vec3 g = (sphere ? blender_position(c, position_at(c)) : generated_at(c, params)) - make_vec3(0.5f);
        Vec3 t = params[2] == 0   ? make_vec3(0.0f, -g.z, g.y)
                 : params[2] == 1 ? make_vec3(-g.z, 0.0f, g.x)
                                  : make_vec3(-g.y, g.x, 0.0f);
        store_vec3(out, surface_tangent(c, t));
    }
};
struct OpTangentUv {  // params: stencil, tangent attribute; without one: zero
    static constexpr int inputs = 0, outputs = 3, params = 3;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float*, float* out) {
        AttributeValue a = read_attribute(c, attribute_of(c, params[2]), params);
        store_vec3(out, a.channels == 0 ? make_vec3(0.0f) : surface_tangent(c, load_vec3(a.value)));
    }
};

// Bump. in: strength, distance, filter width, height at the point, along x, along y, normal.
// params: inverted, object space.
struct OpBump {
    static constexpr int inputs = 9, outputs = 3, params = 2;
    static constexpr bool reads_point = true;
    LUCH_FN static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        InstanceView moved;
        const InstanceView* instance = placed_at(c, &moved);
        Stencil s = stencil_at(c);
        Vec3 n = load_vec3(in + 6);
        const bool object_space = params[1] != 0 && instance;
        if (object_space) {
            n = normal_to_object(instance, n);
            s = {transform_direction(instance->to_object, s.dx), transform_direction(instance->to_object, s.dy)};
        }
        Vec3 along_x = cross(s.dy, n), along_y = cross(n, s.dx);
        float area = dot(s.dx, along_x);
        Vec3 gradient = along_x * (in[4] - in[3]) + along_y * (in[5] - in[3]);
        float scale = (params[0] != 0 ? -in[1] : in[1]) * (area < 0.0f ? -1.0f : 1.0f);
        Vec3 bent = safe_normalize(n * (in[2] * abs_f(area)) - gradient * scale);
        float strength = max_f(in[0], 0.0f);
        Vec3 blended = is_zero(bent) ? n : normalize(bent * strength + n * (1.0f - strength));
        store_vec3(out, object_space ? normal_to_world(instance, blended) : blended);
    }
};

// The mesh's interpolated normal in object space, unit and not flipped towards the ray.
LUCH_FN Vec3 mesh_normal(const OpContext& c, const InstanceView& instance) {
    const SceneView& scene = *c.scene;
    const MeshView& mesh = scene.meshes[instance.mesh];
    const u32 prim = c.points->prim[c.lane];
    const bool back = (c.points->flags[c.lane] & PATH_BACKFACING) != 0;
    Vec3 flat = geometric_normal_at(c) * (back ? -1.0f : 1.0f);
    flat = normal_to_object(&instance, flat);
    if (mesh.normals_domain == Domain::NONE_ || !is_triangle(mesh, prim)) return flat;
    const u32* vertex = corners_of(scene, mesh, prim);
    float u = c.points->u[c.lane], v = c.points->v[c.lane], weight[3] = {1.0f - u - v, u, v};
    Vec3 n = make_vec3(0.0f);
    for (u32 k = 0; k < 3; k++) {
        u32 row = mesh.normals_domain == Domain::CORNER ? 3 * prim + k : vertex[k];
        n += normal_at_time(scene, instance, row, time_at(c)) * weight[k];
    }
    return normalize_or(n, flat);
}

// Normal Map. in: strength, colour. params: space (0 tangent, 1 object, 2 world), inverted green,
// tangent attribute (x, y, z, sign of the bitangent).
struct OpNormalMap {
    static constexpr int inputs = 4, outputs = 3, params = 3;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float* in, float* out) {
        Vec3 map = (load_vec3(in + 1) - make_vec3(0.5f)) * 2.0f, shading = normal_at(c), n;
        if (params[1] != 0) map.y = -map.y;
        const float strength = in[0];
        InstanceView moved;
        const InstanceView* instance = placed_at(c, &moved);
        if (params[0] == 0) {
            const u32 center[2] = {0u, 0u};
            AttributeValue a = read_attribute(c, attribute_of(c, params[2]), center);
            if (!instance || a.channels < 4) return store_vec3(out, shading);
            Vec3 normal = mesh_normal(c, *instance), tangent = load_vec3(a.value);
            Vec3 bitangent = cross(normal, tangent) * a.value[3];
            float z = 1.0f + (map.z - 1.0f) * saturate_f(strength);
            n = safe_normalize(tangent * (map.x * strength) + bitangent * (map.y * strength) + normal * z);
            n = normal_to_world(instance, n);
        } else {
            n = params[0] == 1 ? normal_to_world(instance, map) : safe_normalize(map);
        }
        if (c.points->flags[c.lane] & PATH_BACKFACING) n = -n;
        if (params[0] != 0 && strength != 1.0f) {
            n = safe_normalize(shading + (n - shading) * max_f(strength, 0.0f));
        }
        store_vec3(out, is_zero(n) || !finite_v(n) ? shading : n);
    }
};

}  // namespace luch
