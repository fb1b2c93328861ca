// One flight of a path through media, from where its ray begins to the next surface: what the medium does to a metre of
// it, and the light that it gives by itself.
#pragma once
#include "luch/integrator/direct_light.h"
#include "luch/integrator/medium.h"
#include "luch/math/bounds.h"

namespace luch {

// Dimensions of one flight through a medium, beside those of the event that follows.
inline constexpr u32 DIMENSIONS_PER_FLIGHT = 7;
enum FlightDimension : u32 {
    FLIGHT_DISTANCE,
    FLIGHT_LIT,
    FLIGHT_REFERENCE,
    FLIGHT_PIVOT,
    FLIGHT_LIGHT,
    FLIGHT_PHASE,
    FLIGHT_TERMINATE
};

// Borders between the camera and its lens, or near clip, that are looked at.
inline constexpr u32 MAX_CAMERA_BORDERS = 64;

LUCH_FN float channel_sum(Color c) { return c.x + c.y + c.z; }

LUCH_FN float keep_inside(float t, float length, const Ray& ray) {
    if (!finite_f(length)) return t;
    float margin = FLIGHT_MARGIN * (length + max_component(abs_v(ray.origin)));
    return max_f(min_f(t, length - margin), min_f(margin, 0.5f * length));
}

// One of the colour's channels by u in [0, 1), in proportion to positive weights.
LUCH_FN float pick_channel(Color weights, Color values, float u) {
    float target = u * channel_sum(weights);
    if (target < weights.x) return values.x;
    if (target < weights.x + weights.y || !(weights.z > 0.0f)) return weights.y > 0.0f ? values.y : values.x;
    return values.z;
}

// Of a flight as far as `length`: what a metre of it does, and what of the path's light each channel carries.
struct Flight {
    MediumSum sum;
    Color carried;  // relative, sums to 1
    float length;
};

LUCH_FN Flight make_flight(const MediaView& media, const MediumStack& stack, const PathState& path, float length) {
    Flight flight{sum_media(media, stack), abs_v(path.throughput), length};
    float sum = channel_sum(flight.carried);
    flight.carried = sum > 0.0f && finite_f(sum) ? flight.carried * (1.0f / sum) : make_vec3(1.0f / 3.0f);
    return flight;
}

// ---- the medium's own light ----------------------------------------------------------------------

LUCH_FN_SLOW void add_medium_emission(const RenderView& scene, FilmWriter& writer, const PathState& path,
                                      const MediumStack& stack, const Flight& flight) {
    Color reach = transmitted_length(flight.sum.extinction, flight.length);
    for_each_medium(scene.media, stack, [&](const MediumView& medium, u32 instance) {
        if (is_zero(medium.emission)) return;
        u32 group = instance == NONE ? scene.world_lightgroup
                                     : scene.view.objects[scene.view.instances[instance].object].lightgroup;
        add_emission(scene, writer, path, medium.emission * reach, writer.film.layout.emission, group);
    });
}

}  // namespace luch
