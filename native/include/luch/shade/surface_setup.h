// From a hit to a ShadePoints lane: position, normals, view direction, footprint.
#pragma once
#include "luch/shade/scene_view.h"

namespace luch {

// Unit outward normal of the triangle in world space (zero area: an arbitrary unit vector).
LUCH_FN Vec3 world_face_normal(const InstanceView& instance, const Triangle& t) {
    Vec3 n = normalize_or(cross(t.p[1] - t.p[0], t.p[2] - t.p[0]), {0.0f, 0.0f, 1.0f});
    return normalize_or(transform_direction_transposed(instance.to_object, n), n);
}

// Interpolated shading normal in world space; face_normal where the mesh is flat or the sum vanishes.
LUCH_FN Vec3 world_smooth_normal(const SceneView& scene, const MeshView& mesh, const InstanceView& instance, u32 prim,
                                 float u, float v, Vec3 face_normal) {
    if (mesh.normals_domain == Domain::NONE_) return face_normal;
    u32 i0 = prim * 3, i1 = i0 + 1, i2 = i0 + 2;
    if (mesh.normals_domain == Domain::POINT) {
        const u32* t = corners_of(scene, mesh, prim);
        i0 = t[0], i1 = t[1], i2 = t[2];
    }
    Vec3 n = vec3_row(scene.normals, mesh.first_normal + i0) * (1.0f - u - v) +
             vec3_row(scene.normals, mesh.first_normal + i1) * u + vec3_row(scene.normals, mesh.first_normal + i2) * v;
    return normalize_or(transform_direction_transposed(instance.to_object, n), face_normal);
}

struct LaneInputs {
    Vec3 point, to_viewer;  // world; to_viewer unit
    Vec3 radial;            // of a point on a sphere: SurfacePoint::radial, its normal as shaders see it
    u32 instance, prim;
    float u, v;
    float ray_length, footprint;
    u32 flags, depth, transparent_depth, path, seed;
};

// Fills lane `lane` for a point on a triangle or sphere. Normals are turned to the viewer's side and
// PATH_BACKFACING is set when that turned them.
LUCH_FN void setup_surface_lane(const SceneView& scene, const LaneInputs& in, ShadePoints& points, int lane) {
    const InstanceView& instance = scene.instances[in.instance];
    const MeshView& mesh = scene.meshes[instance.mesh];
    Vec3 ng, n;
    if (is_sphere(mesh, in.prim)) {
        ng = n = in.radial;
    } else {
        ng = world_face_normal(instance, triangle_at(scene, mesh, in.prim));
        n = world_smooth_normal(scene, mesh, instance, in.prim, in.u, in.v, ng);
    }
    bool back = dot(ng, in.to_viewer) < 0.0f;
    if (back) {
        ng = -ng;
        n = -n;
    }
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
}

// The same for the world (instance NONE, prim NONE: the point is the unit direction looked along) and
// for lamps (prim = lamp, the point lies on it, normal faces the viewer).
LUCH_FN void setup_free_lane(const LaneInputs& in, Vec3 normal, ShadePoints& points, int lane) {
    points.px[lane] = in.point.x, points.py[lane] = in.point.y, points.pz[lane] = in.point.z;
    points.nx[lane] = points.gx[lane] = normal.x;
    points.ny[lane] = points.gy[lane] = normal.y;
    points.nz[lane] = points.gz[lane] = normal.z;
    points.ix[lane] = in.to_viewer.x, points.iy[lane] = in.to_viewer.y, points.iz[lane] = in.to_viewer.z;
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

LUCH_FN Vec3 lane_position(const ShadePoints& p, int i) { return {p.px[i], p.py[i], p.pz[i]}; }
LUCH_FN Vec3 lane_normal(const ShadePoints& p, int i) { return {p.nx[i], p.ny[i], p.nz[i]}; }
LUCH_FN Vec3 lane_face_normal(const ShadePoints& p, int i) { return {p.gx[i], p.gy[i], p.gz[i]}; }
LUCH_FN Vec3 lane_to_viewer(const ShadePoints& p, int i) { return {p.ix[i], p.iy[i], p.iz[i]}; }

}  // namespace luch
