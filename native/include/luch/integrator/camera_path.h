// A path's beginning: its sampler, its ray through the lens, its first state.
#pragma once
#include "luch/integrator/render_view.h"

namespace luch {

// Row of the film for a pixel of the full frame.
LUCH_FN u32 film_pixel(const FilmView& film, u32 x, u32 y) { return (y - film.y0) * film.width + (x - film.x0); }

// When a path of this line of pixels sees the scene; only where something moves. Time is the third coordinate of the
// place in the pixel, which stays what it is: an edge that moves slowly is a plane among the three, and comes
// out with a quarter less error than by a dimension apart (64 samples, measured).
LUCH_FN float path_time(const RenderView& scene, float u, u32 py) {
    return shutter_time(*scene.shutter, u, py, static_cast<u32>(scene.view.frame_size.y));
}
LUCH_FN float path_time(const RenderView& scene, const Sampler& sampler, u32 py) {
    return path_time(scene, sample_3d(sampler, first_dimension(scene.sampler) + DIM_PIXEL).z, py);
}

LUCH_FN CameraRay camera_ray(const RenderView& scene, Vec2 raster, Vec2 lens_u, float time) {
    if (!has_motion(scene) || (scene.shutter->camera_keys == 0u && !scene.shutter->zooms))
        return generate_ray(scene.camera, raster, lens_u);
    return generate_ray(camera_at_time(scene.camera, *scene.shutter, time), raster, lens_u);
}

// px, py: pixel of the full frame. filter_u, lens_u: the sampler's dimensions DIM_PIXEL and DIM_LENS (lens_u unused
// without a lens); time: unused without motion.
LUCH_FN Ray begin_path(const RenderView& scene, const FilmView& film, u32 px, u32 py, u32 sample,
                       const Sampler& sampler, Vec2 filter_u, Vec2 lens_u, float time, PathState& path) {
    Vec2 offset = sample_filter(*scene.filter, filter_u);
    CameraRay camera =
        camera_ray(scene, {static_cast<float>(px) + 0.5f + offset.x, static_cast<float>(py) + 0.5f + offset.y},
                   scene.has_lens ? lens_u : Vec2{0.5f, 0.5f}, time);
    path = PathState{};
    path.sampler = sampler;
    path.sample = sample - scene.first_sample;
    path.throughput = path.feature_throughput = make_vec3(1.0f);
    path.continuation = 1.0f;
    path.min_pdf = 1e30f;
    path.flags =
        u32(PATH_CAMERA) | PATH_NO_MIS | PATH_THROUGH_FILM | (wants_features(film.layout) ? u32(PATH_FEATURES) : 0u);
    path.visibility = RAY_CAMERA;
    path.dimension = first_dimension(scene.sampler) + DIMENSIONS_CAMERA;
    path.pixel = film_pixel(film, px, py);
    path.mis_origin = camera.ray.origin;
    path.footprint = camera.footprint;
    path.spread = camera.spread;
    if (camera.ray.t_max < 0.0f) {  // beside a fisheye's circle: black and opaque, as in Cycles
        path.throughput = path.feature_throughput = make_vec3(0.0f);
        path.flags &= ~u32(PATH_THROUGH_FILM | PATH_FEATURES);
        path.visibility = 0u;
    }
    return camera.ray;
}

}  // namespace luch
