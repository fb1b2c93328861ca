// From a hit to a ShadePoints lane: position, normals, view direction, footprint.
#pragma once
#include "luch/geometry/surface.h"
#include "luch/shade/scene_view.h"

namespace luch {

// Unit outward normal of the triangle in world space (zero area: an arbitrary unit vector).
LUCH_FN Vec3 world_face_normal(const InstanceView& instance, const Triangle& t) {
    Vec3 n = normalize_or(area_normal(t), {0.0f, 0.0f, 1.0f});
    return normalize_or(transform_direction_transposed(instance.to_object, n), n);
}

// The curved surface that smooth normals speak of, at a point of its flat triangle.
struct SmoothSurface {
    Vec3 normal;           // unit, world, on the side of the face normal
    float above, below;    // how far it may reach out of the triangle along the normal, and the other way; world
};

// Room over the triangle under the tangent plane at a corner, which is lifted where other corners are above it, and
// the same below; at the point with weights wj, wk of the other corners j and k.
LUCH_FN void limit_to_tangent(Vec3 normal, Vec3 to_j, Vec3 to_k, float wj, float wk, float* above, float* below) {
    float j = dot(normal, to_j), k = dot(normal, to_k), height = wj * j + wk * k;
    *above = min_f(*above, max_f(max_f(j, k), 0.0f) - height);
    *below = min_f(*below, height - min_f(min_f(j, k), 0.0f));
}

// Of a triangle t with normals. side: -1 where it is seen from behind. face_normal: taken where the normals' sum
// vanishes. The curved surface lies under its tangent planes at the corners; as in Cycles, it is taken for the lowest.
LUCH_FN SmoothSurface smooth_surface(const SceneView& scene, const MeshView& mesh, const InstanceView& instance,
                                     u32 prim, const Triangle& t, float u, float v, float time, float side,
                                     Vec3 face_normal) {
    u32 i0 = prim * 3, i1 = i0 + 1, i2 = i0 + 2;
    if (mesh.normals_domain == Domain::POINT) {
        const u32* corner = corners_of(scene, mesh, prim);
        i0 = corner[0], i1 = corner[1], i2 = corner[2];
    }
    Vec3 n0 = normal_at_time(scene, instance, i0, time) * side;
    Vec3 n1 = normal_at_time(scene, instance, i1, time) * side;
    Vec3 n2 = normal_at_time(scene, instance, i2, time) * side;
    float w = 1.0f - u - v;
    Vec3 sum = n0 * w + n1 * u + n2 * v, n = transform_direction_transposed(instance.to_object, sum);
    Vec3 e01 = t.p[1] - t.p[0], e12 = t.p[2] - t.p[1], e20 = t.p[0] - t.p[2];
    float above = INFINITE_DISTANCE, below = INFINITE_DISTANCE;
    limit_to_tangent(n0, e01, -e20, u, v, &above, &below);
    limit_to_tangent(n1, e12, -e01, v, w, &above, &below);
    limit_to_tangent(n2, e20, -e12, w, u, &above, &below);
    // Normals shrink as the object grows: so much it is scaled along them.
    float scale = instance.flags & INSTANCE_WORLD_NORMALS ? length(n) : safe_divide(length_squared(sum), length(n));
    return {normalize_or(n, face_normal), above * scale, below * scale};
}

struct LaneInputs {
    Vec3 point, to_viewer;  // world; to_viewer unit
    Vec3 radial;            // of a point on a sphere or curve: SurfacePoint::radial, its normal as shaders see it
    u32 instance, prim;
    float u, v;
    float ray_length, footprint;
    u32 flags, depth, transparent_depth, path, seed;
    float time;
};

// Fills lane `lane` for a point on a triangle, sphere or curve. Normals are turned to the viewer's side and
// PATH_BACKFACING is set when that turned them.
LUCH_FN void setup_surface_lane(const SceneView& scene, const LaneInputs& in, ShadePoints& points, int lane) {
    InstanceView moved;
    const InstanceView& instance = instance_at_time(scene, in.instance, in.time, &moved);
    const MeshView& mesh = scene.meshes[instance.mesh];
    bool round = !is_triangle(mesh, in.prim);
    Triangle t{};
    if (!round) t = triangle_at(scene, instance, in.prim, in.time);
    Vec3 ng = round ? in.radial : world_face_normal(instance, t);
    // A ribbon is turned to the ray, and only shaded as if it were round.
    bool ribbon = is_curve(mesh, in.prim) && look_of(scene.curve_shape) == CurveShape::RIBBON;
    if (ribbon) ng = in.to_viewer;
    bool back = dot(ng, in.to_viewer) < 0.0f;
    if (back) ng = -ng;
    SmoothSurface smooth = {ribbon ? in.radial : ng, 0.0f, 0.0f};
    if (!round && mesh.normals_domain != Domain::NONE_)
        smooth = smooth_surface(scene, mesh, instance, in.prim, t, in.u, in.v, in.time, back ? -1.0f : 1.0f, ng);
    Vec3 n = smooth.normal;
    points.above[lane] = smooth.above, points.below[lane] = smooth.below;
    points.terminator[lane] = scene.objects[instance.object].shadow_terminator;
    points.px[lane] = in.point.x, points.py[lane] = in.point.y, points.pz[lane] = in.point.z;
    points.nx[lane] = n.x, points.ny[lane] = n.y, points.nz[lane] = n.z;
    points.gx[lane] = ng.x, points.gy[lane] = ng.y, points.gz[lane] = ng.z;
    points.ix[lane] = in.to_viewer.x, points.iy[lane] = in.to_viewer.y, points.iz[lane] = in.to_viewer.z;
    points.u[lane] = in.u, points.v[lane] = in.v;
    points.ray_length[lane] = in.ray_length;
    points.footprint[lane] = in.footprint;
    points.flags[lane] = (in.flags & ~u32(PATH_BACKFACING)) | (back ? u32(PATH_BACKFACING) : 0u);
    points.prim[lane] = in.prim;
    points.instance[lane] = in.instance;
    points.depth[lane] = in.depth;
    points.transparent_depth[lane] = in.transparent_depth;
    points.path[lane] = in.path;
    points.seed[lane] = in.seed;
    if (plan::MOTION) points.time[lane] = in.time;
}

// The same for the world (instance NONE, prim NONE: the point is the unit direction looked along) and
// for lamps (prim = lamp, the point lies on it, normal faces the viewer).
LUCH_FN void setup_free_lane(const LaneInputs& in, Vec3 normal, ShadePoints& points, int lane) {
    points.px[lane] = in.point.x, points.py[lane] = in.point.y, points.pz[lane] = in.point.z;
    points.nx[lane] = points.gx[lane] = normal.x;
    points.ny[lane] = points.gy[lane] = normal.y;
    points.nz[lane] = points.gz[lane] = normal.z;
    points.ix[lane] = in.to_viewer.x, points.iy[lane] = in.to_viewer.y, points.iz[lane] = in.to_viewer.z;
    points.above[lane] = points.below[lane] = points.terminator[lane] = 0.0f;
    points.u[lane] = in.u, points.v[lane] = in.v;
    points.ray_length[lane] = in.ray_length;
    points.footprint[lane] = in.footprint;
    points.flags[lane] = in.flags & ~u32(PATH_BACKFACING);
    points.prim[lane] = in.prim;
    points.instance[lane] = NONE;
    points.depth[lane] = in.depth;
    points.transparent_depth[lane] = in.transparent_depth;
    points.path[lane] = in.path;
    points.seed[lane] = in.seed;
}

// Read by nobody but what moves.
LUCH_FN float lane_time(const ShadePoints& p, int i) { return plan::MOTION ? p.time[i] : SHUTTER_MIDDLE; }
LUCH_FN Vec3 lane_position(const ShadePoints& p, int i) { return {p.px[i], p.py[i], p.pz[i]}; }
LUCH_FN Vec3 lane_normal(const ShadePoints& p, int i) { return {p.nx[i], p.ny[i], p.nz[i]}; }
LUCH_FN Vec3 lane_face_normal(const ShadePoints& p, int i) { return {p.gx[i], p.gy[i], p.gz[i]}; }
LUCH_FN Vec3 lane_to_viewer(const ShadePoints& p, int i) { return {p.ix[i], p.iy[i], p.iz[i]}; }

}  // namespace luch
