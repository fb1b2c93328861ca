// A path's beginning: its sampler, its ray through the lens, its first state.
#pragma once
#include "luch/integrator/render_view.h"

namespace luch {

// Row of the film for a pixel of the full frame.
LUCH_FN u32 film_pixel(const FilmView& film, u32 x, u32 y) { return (y - film.y0) * film.width + (x - film.x0); }

// px, py: pixel of the full frame. filter_u, lens_u: the sampler's dimensions 0 and 1 (lens_u unused without a lens).
LUCH_FN Ray begin_path(const RenderView& scene, const FilmView& film, u32 px, u32 py, u32 sample,
                       const Sampler& sampler, Vec2 filter_u, Vec2 lens_u, PathState& path) {
    Vec2 offset = sample_filter(*scene.filter, filter_u);
    CameraRay camera =
        generate_ray(scene.camera, {static_cast<float>(px) + 0.5f + offset.x, static_cast<float>(py) + 0.5f + offset.y},
                     scene.has_lens ? lens_u : Vec2{0.5f, 0.5f});
    path = PathState{};
    path.sampler = sampler;
    path.sample = sample - scene.first_sample;
    path.throughput = path.feature_throughput = make_vec3(1.0f);
    path.continuation = 1.0f;
    path.min_pdf = 1e30f;
    path.flags =
        u32(PATH_CAMERA) | PATH_NO_MIS | PATH_THROUGH_FILM | (wants_features(film.layout) ? u32(PATH_FEATURES) : 0u);
    path.visibility = RAY_CAMERA;
    path.dimension = DIMENSIONS_CAMERA;
    path.pixel = film_pixel(film, px, py);
    path.mis_origin = camera.ray.origin;
    path.footprint = camera.footprint;
    path.spread = camera.spread;
    return camera.ray;
}

}  // namespace luch
