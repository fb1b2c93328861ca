#include "bindings/bind.h"

PYBIND11_MODULE(LUCH_MODULE_NAME, m) {
    m.doc() = "Luch's native core.";
    luch::bindings::bind_bsdf(m);
    luch::bindings::bind_accel(m);
    luch::bindings::bind_camera(m);
    luch::bindings::bind_film(m);
    luch::bindings::bind_kd_short_stack(m);
    luch::bindings::bind_light(m);
    luch::bindings::bind_math(m);
    luch::bindings::bind_media(m);
    luch::bindings::bind_motion(m);
    luch::bindings::bind_photons(m);
    luch::bindings::bind_render(m);
    luch::bindings::bind_sampling(m);
    luch::bindings::bind_shade(m);
    luch::bindings::bind_sky(m);
    luch::bindings::bind_scene_trees(m);
    luch::bindings::bind_structure(m);
    luch::bindings::bind_textures(m);
    luch::bindings::bind_triangle_tests(m);
}
