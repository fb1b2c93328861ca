// Values of a mesh's attributes at a point, and how they change over the bump stencil.
#pragma once
#include "luch/shade/nodes/vector.h"
#include "luch/shade/scene_view.h"

namespace luch {

// The bump stencil: two steps of the ray's footprint along the surface. Cycles spans them by this
// very basis, which is why make_frame does not serve.
struct Stencil {
    Vec3 dx, dy;
};
LUCH_FN Stencil footprint_stencil(Vec3 geometric_normal, float radius) {
    Vec3 n = geometric_normal;
    Vec3 a = n.x != n.y || n.x != n.z ? make_vec3(n.z - n.y, n.x - n.z, n.y - n.x)
                                      : make_vec3(n.z - n.y, n.x + n.z, -n.y - n.x);
    a = normalize(a);
    return {a * radius, cross(n, a) * radius};
}
LUCH_FN Vec3 geometric_normal_at(const OpContext& c) {
    return {c.points->gx[c.lane], c.points->gy[c.lane], c.points->gz[c.lane]};
}
LUCH_FN Stencil stencil_at(const OpContext& c) {
    return footprint_stencil(geometric_normal_at(c), c.points->footprint[c.lane]);
}
// Displacement of the corner that the first two static words name, world space.
LUCH_FN Vec3 stencil_offset(const OpContext& c, const u32* params) {
    if (params[0] == 0) return make_vec3(0.0f);
    Stencil s = stencil_at(c);
    return (params[0] == 1 ? s.dx : s.dy) * bits_float(params[1]);
}

// Barycentrics of a corner of the stencil: solves p1 - p0, p2 - p0 against the step, in the plane
// where the triangle looks largest.
LUCH_FN Vec2 barycentric_step(Vec3 edge_u, Vec3 edge_v, Vec3 step, Vec3 n) {
    float xn = abs_f(n.x), yn = abs_f(n.y), zn = abs_f(n.z);
    bool drop_z = !(zn < xn || zn < yn), drop_y = !drop_z && yn >= xn && yn >= zn;
    Vec2 u = drop_z ? make_vec2(edge_u.x, edge_u.y)
                    : (drop_y ? make_vec2(edge_u.x, edge_u.z) : make_vec2(edge_u.y, edge_u.z));
    Vec2 v = drop_z ? make_vec2(edge_v.x, edge_v.y)
                    : (drop_y ? make_vec2(edge_v.x, edge_v.z) : make_vec2(edge_v.y, edge_v.z));
    Vec2 s = drop_z ? make_vec2(step.x, step.y) : (drop_y ? make_vec2(step.x, step.z) : make_vec2(step.y, step.z));
    float det = u.x * v.y - v.x * u.y;
    float inverse = det != 0.0f ? 1.0f / det : 0.0f;
    return {(s.x * v.y - s.y * v.x) * inverse, (s.y * u.x - s.x * u.y) * inverse};
}

// Of the path that came to the point; read where something moves.
LUCH_FN float time_at(const OpContext& c) { return plan::MOTION ? c.points->time[c.lane] : SHUTTER_MIDDLE; }

// Barycentrics u, v at the corner of the stencil that params[0..1] name.
LUCH_FN Vec2 barycentrics_at(const OpContext& c, const u32* params) {
    Vec2 uv = {c.points->u[c.lane], c.points->v[c.lane]};
    if (params[0] == 0) return uv;
    InstanceView moved;
    const InstanceView& instance = instance_at_time(*c.scene, c.points->instance[c.lane], time_at(c), &moved);
    const MeshView& mesh = c.scene->meshes[instance.mesh];
    if (!is_triangle(mesh, c.points->prim[c.lane])) return uv;
    Triangle t = triangle_at(*c.scene, instance, c.points->prim[c.lane], time_at(c));
    Vec3 edge_u = transform_direction(instance.to_world, t.p[1] - t.p[0]);
    Vec3 edge_v = transform_direction(instance.to_world, t.p[2] - t.p[0]);
    // Seen from behind, Cycles turns both edges round: attributes step the other way than places do.
    float side = (c.points->flags[c.lane] & PATH_BACKFACING) ? -1.0f : 1.0f;
    return uv + barycentric_step(edge_u, edge_v, stencil_offset(c, params), geometric_normal_at(c)) * side;
}

struct AttributeValue {
    float value[4];
    int channels;  // 0: the mesh has no such attribute
};

LUCH_FN AttributeValue read_attribute(const OpContext& c, u32 attribute, const u32* params) {
    AttributeValue result{{0.0f, 0.0f, 0.0f, 0.0f}, 0};
    const u32 instance_index = c.points->instance[c.lane];
    if (attribute == NONE || instance_index == NONE) return result;
    const SceneView& scene = *c.scene;
    const MeshView& mesh = scene.meshes[scene.instances[instance_index].mesh];
    const AttributeView& view = scene.attributes[mesh.first_attribute + attribute];
    result.channels = view.channels;
    if (view.channels == 0) return result;
    const float* data = scene.attribute_data + view.offset;
    const u32 prim = c.points->prim[c.lane], n = view.channels;
    const bool sphere = is_sphere(mesh, prim), curve = is_curve(mesh, prim);
    const bool of_curves = view.domain == Domain::CURVE || view.domain == Domain::CURVE_POINT;
    if (view.domain != Domain::MESH && (sphere != (view.domain == Domain::SPHERE) || curve != of_curves)) {
        result.channels = 0;  // the attribute is the mesh's other primitives'
        return result;
    }
    if (curve && of_curves) {
        const bool of_points = view.domain == Domain::CURVE_POINT;
        const u32 segment = mesh.first_segment + segment_of_prim(scene, mesh, prim);
        const u32 row = of_points ? scene.curve_segments[segment] >> 2 : scene.segment_curves[segment];
        const float* from = data + u64(row) * n;
        const float share = c.points->u[c.lane];
        for (u32 k = 0; k < n; k++) result.value[k] = of_points ? mix_f(from[k], from[n + k], share) : from[k];
        return result;
    }
    if (sphere || view.domain == Domain::FACE || view.domain == Domain::MESH) {
        u32 index = view.domain == Domain::MESH ? 0u : (sphere ? prim - mesh.triangle_count : prim);
        for (u32 k = 0; k < n; k++) result.value[k] = data[u64(index) * n + k];
        return result;
    }
    u32 index[3] = {3 * prim, 3 * prim + 1, 3 * prim + 2};
    if (view.domain == Domain::POINT) {
        const u32* vertex = corners_of(scene, mesh, prim);
        for (int k = 0; k < 3; k++) index[k] = vertex[k];
    }
    Vec2 uv = barycentrics_at(c, params);
    float w = 1.0f - uv.x - uv.y;
    for (u32 k = 0; k < n; k++) {
        result.value[k] =
            w * data[u64(index[0]) * n + k] + uv.x * data[u64(index[1]) * n + k] + uv.y * data[u64(index[2]) * n + k];
    }
    return result;
}

// out: x, y, z (one channel is repeated), factor, alpha. params: stencil (2), attribute slot.
struct OpAttributeValue {
    static constexpr int inputs = 0, outputs = 5, params = 3;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float*, float* out) {
        AttributeValue a = read_attribute(c, attribute_of(c, params[2]), params);
        if (params[2] == ATTRIBUTE_UV && c.points->instance[c.lane] == NONE && c.points->prim[c.lane] != NONE) {
            a = {{c.points->u[c.lane], c.points->v[c.lane], 0.0f, 0.0f}, 2};  // a lamp's own parameters
        }
        const float* v = a.value;
        out[0] = v[0];
        out[1] = a.channels == 1 ? v[0] : v[1];
        out[2] = a.channels == 1 ? v[0] : v[2];
        out[3] = a.channels <= 2 ? v[0] : (v[0] + v[1] + v[2]) * (1.0f / 3.0f);
        out[4] = a.channels == 4 ? v[3] : 1.0f;
    }
};

// Attribute of the object: in and out as above.
struct OpAttributeObject {
    static constexpr int inputs = 0, outputs = 5, params = 1;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float*, float* out) {
        for (int k = 0; k < 5; k++) out[k] = k == 4 ? 1.0f : 0.0f;  // missing
        const u32 instance = c.points->instance[c.lane];
        if (instance == NONE) return;
        const u32 first = c.scene->objects[c.scene->instances[instance].object].first_attribute;
        if (first == NONE) return;
        const AttributeView& view = c.scene->attributes[first + attribute_of(c, params[0])];
        if (view.channels != 4) return;
        const float* v = c.scene->attribute_data + view.offset;
        store_vec3(out, load_vec3(v));
        out[3] = (v[0] + v[1] + v[2]) * (1.0f / 3.0f);
        out[4] = v[3];
    }
};

// Color Attribute: as above, but a missing one is black and of alpha 0.
struct OpAttributeColor {
    static constexpr int inputs = 0, outputs = 4, params = 3;
    static constexpr bool reads_point = true;
    LUCH_FN_SLOW static void eval(const OpContext& c, const u32* params, const float*, float* out) {
        AttributeValue a = read_attribute(c, attribute_of(c, params[2]), params);
        for (int k = 0; k < 3; k++) out[k] = a.channels == 1 ? a.value[0] : a.value[k];
        out[3] = a.channels == 0 ? 0.0f : (a.channels == 4 ? a.value[3] : 1.0f);
    }
};

}  // namespace luch
