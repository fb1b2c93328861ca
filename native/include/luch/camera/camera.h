// Cameras: a raster position and a point on the lens give a ray, as Blender's cameras do.
//
// Camera space: perspective and orthographic cameras look along +z (x right, y up); panoramas
// look along +x with z up (camera/panorama.h). Axes are unit, whatever the camera object's scale.
#pragma once
#include "luch/camera/panorama.h"
#include "luch/geometry/ray.h"
#include "luch/sampling/warp.h"

namespace luch {

struct CameraView {
    CameraKind kind;
    Affine to_world, to_camera;
    // Raster to image plane: plane = (raster - centre) * scale, raster in pixels from the bottom left
    // corner of the full frame. Plane: perspective x/z and y/z, orthographic metres, panoramas as
    // camera/panorama.h says. Shift is part of the centre.
    Vec2 centre, scale;
    float clip_start, clip_length;  // along the camera's axis (panorama: along the ray), metres
    float aperture_radius;          // metres; 0: a pinhole
    float inverse_focus;            // 1 / distance to the plane in focus
    float blades, blades_rotation;  // blades 0: a round aperture
    float inverse_aperture_ratio;
    FisheyeView fisheye;
};

struct CameraRay {
    Ray ray;         // unit direction; starts at the near clipping plane; t_max below 0: the lens shows nothing here
    float footprint; // radius of the pixel's cone at the ray's origin, metres
    float spread;    // its growth per metre: radius(t) = footprint + t * spread
};

LUCH_FN Vec2 raster_to_plane(const CameraView& c, Vec2 raster) {
    return {(raster.x - c.centre.x) * c.scale.x, (raster.y - c.centre.y) * c.scale.y};
}

LUCH_FN Vec2 sample_aperture(const CameraView& c, Vec2 u) {
    Vec2 p = c.blades == 0.0f ? sample_disk(u) : sample_polygon(c.blades, c.blades_rotation, u);
    return {p.x * c.inverse_aperture_ratio * c.aperture_radius, p.y * c.aperture_radius};
}

// Ray from a point of camera space, moved to the near plane; `stretch` is the length of the ray per
// metre of camera depth.
LUCH_FN CameraRay finish_ray(const CameraView& c, Vec3 origin, Vec3 direction, float stretch, float spread) {
    float start = c.clip_start * stretch;
    Vec3 d = normalize(transform_direction(c.to_world, direction));
    Vec3 o = transform_point(c.to_world, origin) + d * start;
    return {{o, 0.0f, d, c.clip_length * stretch}, start * spread, spread};
}

LUCH_FN CameraRay perspective_ray(const CameraView& c, Vec2 plane, Vec2 lens_u) {
    Vec3 pixel = {plane.x, plane.y, 1.0f};  // the pinhole's direction, one metre deep
    float stretch = length(pixel);
    float inverse = 1.0f / stretch;
    // Change of the unit direction per pixel: the part of the step that is across it, over its length.
    Vec3 d = pixel * inverse;
    float across_x = safe_sqrt(1.0f - d.x * d.x), across_y = safe_sqrt(1.0f - d.y * d.y);
    float spread = 0.5f * inverse * (abs_f(c.scale.x) * across_x + abs_f(c.scale.y) * across_y);
    if (c.aperture_radius == 0.0f) return finish_ray(c, {0.0f, 0.0f, 0.0f}, d, stretch, spread);
    Vec2 lens = sample_aperture(c, lens_u);
    // Towards the pixel's point in the plane of focus, divided by its depth: finite for any focus.
    Vec3 bent = {plane.x - lens.x * c.inverse_focus, plane.y - lens.y * c.inverse_focus, 1.0f};
    return finish_ray(c, {lens.x, lens.y, 0.0f}, normalize(bent), stretch, spread);
}

LUCH_FN CameraRay orthographic_ray(const CameraView& c, Vec2 plane, Vec2 lens_u) {
    Vec2 lens = {0.0f, 0.0f};
    if (c.aperture_radius != 0.0f) lens = sample_aperture(c, lens_u);
    Vec3 axis = {-lens.x * c.inverse_focus, -lens.y * c.inverse_focus, 1.0f};  // one metre deep
    Vec3 near_point = {plane.x + lens.x + axis.x * c.clip_start, plane.y + lens.y + axis.y * c.clip_start,
                       c.clip_start};
    Vec3 d = normalize(transform_direction(c.to_world, normalize(axis)));
    Vec3 o = transform_point(c.to_world, near_point);
    return {{o, 0.0f, d, c.clip_length}, 0.5f * (abs_f(c.scale.x) + abs_f(c.scale.y)), 0.0f};
}

// Half the mean step that a pixel makes on the sphere of directions.
LUCH_FN float panorama_spread(const CameraView& c, Vec2 plane, Vec3 d) {
    if (c.kind == CameraKind::EQUIRECTANGULAR) {
        // Chords of one pixel's step; along a parallel they shrink towards the poles.
        float step_x = 2.0f * abs_f(sin_f(0.5f * c.scale.x)), step_y = 2.0f * abs_f(sin_f(0.5f * c.scale.y));
        return 0.5f * (step_x * abs_f(sin_f(plane.y)) + step_y);
    }
    Vec3 right, up;
    panorama_direction(c.kind, c.fisheye, {plane.x + c.scale.x, plane.y}, &right);
    panorama_direction(c.kind, c.fisheye, {plane.x, plane.y + c.scale.y}, &up);
    return 0.5f * (length(right - d) + length(up - d));
}

LUCH_FN CameraRay panorama_ray(const CameraView& c, Vec2 plane, Vec2 lens_u) {
    Vec3 d;
    bool seen = panorama_direction(c.kind, c.fisheye, plane, &d);
    float spread = panorama_spread(c, plane, d);
    CameraRay ray;
    if (c.aperture_radius == 0.0f) {
        ray = finish_ray(c, {0.0f, 0.0f, 0.0f}, d, 1.0f, spread);
    } else {
        Vec2 lens = sample_aperture(c, lens_u);
        Vec3 u = normalize_or({1.0f - d.x * d.x, -d.x * d.y, -d.x * d.z}, {0.0f, 1.0f, 0.0f});
        Vec3 v = normalize(cross(d, u));
        Vec3 p = u * lens.x + v * lens.y;
        ray = finish_ray(c, p, normalize(d - p * c.inverse_focus), 1.0f, spread);
    }
    if (!seen) ray.ray.t_max = -1.0f;
    return ray;
}

// raster: pixels, continuous, (0, 0) at the bottom left corner of the full frame, centre of the first
// pixel at (0.5, 0.5). lens_u: where on the lens, [0, 1)^2; unread by a pinhole.
LUCH_FN CameraRay generate_ray(const CameraView& c, Vec2 raster, Vec2 lens_u) {
    Vec2 plane = raster_to_plane(c, raster);
    if (c.kind == CameraKind::PERSPECTIVE) return perspective_ray(c, plane, lens_u);
    if (c.kind == CameraKind::ORTHOGRAPHIC) return orthographic_ray(c, plane, lens_u);
    return panorama_ray(c, plane, lens_u);
}

LUCH_FN Vec3 camera_position(const CameraView& c) { return {c.to_world.m[3], c.to_world.m[7], c.to_world.m[11]}; }

// Depth pass and Camera Data > View Z Depth: along the axis; from the centre of a panorama.
LUCH_FN float camera_depth(const CameraView& c, Vec3 p) {
    if (is_panorama(c.kind)) return length(p - camera_position(c));
    return transform_point(c.to_camera, p).z;
}

// Mist pass and Camera Data > View Distance: from the camera, or from an orthographic camera's plane.
LUCH_FN float camera_distance(const CameraView& c, Vec3 p) {
    if (c.kind == CameraKind::ORTHOGRAPHIC) return abs_f(transform_point(c.to_camera, p).z);
    return length(p - camera_position(c));
}

// Where a point stands on the raster, in pixels: the inverse of generate_ray for a pinhole.
LUCH_FN Vec2 world_to_raster(const CameraView& c, Vec3 p) {
    Vec3 q = transform_point(c.to_camera, p);
    Vec2 plane = {q.x, q.y};
    if (c.kind == CameraKind::PERSPECTIVE) plane = {safe_divide(q.x, q.z), safe_divide(q.y, q.z)};
    if (is_panorama(c.kind)) plane = panorama_plane(c.kind, c.fisheye, q);
    return {plane.x / c.scale.x + c.centre.x, plane.y / c.scale.y + c.centre.y};
}

}  // namespace luch
