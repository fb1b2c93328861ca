// Where light and data enter the film: pass rules follow Blender's light passes.
#pragma once
#include "luch/bsdf/bsdf.h"
#include "luch/integrator/render_view.h"
#include "luch/math/bounds.h"
#include "luch/shade/surface_setup.h"
#include "luch/shade/uv.h"

namespace luch {

// A shadow ray on its way, with the light it will bring if nothing blocks it.
struct ShadowRay {
    Color contribution;
    Color pass_diffuse, pass_glossy;
    u32 path;        // whose pixel and flags
    u32 lightgroup;
    // Of the path when the ray left; by now it may have gone on.
    u32 bounce;
    u32 transparent_depth, depth;  // surfaces passed straight; depth_word
    float footprint;
    bool for_ao;
    bool casts;      // false: the lamp casts no shadow, the ray counts as free
    bool volume_pass;  // belongs to the light passes of volumes
};

// Limits a contribution; false (and counted) when it is not finite: such light never enters.
LUCH_FN bool admit(const RenderView& scene, FilmWriter& writer, Color& c, u32 bounce, Refusal cause) {
    if (!finite_v(c)) {
        count_one(writer.refused + cause);
        return false;
    }
    c = clamp_contribution(c, bounce > 0 ? scene.limits.clamp_indirect : scene.limits.clamp_direct);
    return true;
}

// Notes what admit() took of a contribution to Combined.
LUCH_FN void note_clamped(FilmWriter& writer, Color before, Color after) {
    if (!plan::CLAMPING) return;
    float taken = average(before - after);
    if (taken > 0.0f) writer.clamped += u64(min_f(taken, MOST_CLAMPED) / CLAMPED_UNIT);
}

// A path that a limit of bounces ends at a surface: what lies beyond counts by so much, at most.
LUCH_FN void note_cut(FilmWriter& writer, const PathState& path, float opaque) {
    float weight = average(path.throughput) * opaque;
    if (weight > 0.0f && weight < MOST_CLAMPED) writer.cut += u64(weight / CUT_UNIT);
}

LUCH_FN_SLOW void add_to_light_passes(FilmWriter& writer, u32 pixel, Color c, Color diffuse, Color glossy, bool volume,
                                      bool direct) {
    const FilmLayout& layout = writer.film.layout;
    if (plan::VOLUMES && volume) {
        film_add(writer, pixel, direct ? layout.volume_direct : layout.volume_indirect, c);
        return;
    }
    Color rest = make_vec3(1.0f) - diffuse - glossy;
    film_add(writer, pixel, direct ? layout.diffuse_direct : layout.diffuse_indirect, c * diffuse);
    film_add(writer, pixel, direct ? layout.glossy_direct : layout.glossy_indirect, c * glossy);
    film_add(writer, pixel, direct ? layout.transmission_direct : layout.transmission_indirect, c * rest);
}

// Light that a path found by itself: an emitter, a lamp or the world. own_pass: the pass that shows it
// when it is seen directly.
LUCH_FN void add_emission(const RenderView& scene, FilmWriter& writer, const PathState& path, Color radiance,
                          u32 own_pass, u32 lightgroup) {
    Color c = path.throughput * radiance;
    const Color whole = c;
    if (is_zero(c) || !admit(scene, writer, c, path.bounce > 1 ? 1 : 0, REFUSED_EMISSION)) return;
    note_clamped(writer, whole, c);
    film_add_combined(writer, path.pixel, c);
    const FilmLayout& layout = writer.film.layout;
    if (!wants_light_passes(layout) && !gathers_features(path)) return;
    if (lightgroup) film_add_lightgroup(writer, path.pixel, lightgroup - 1, c);
    if (gathers_features(path)) {
        film_add(writer, path.pixel, layout.denoising_albedo, path.feature_throughput * c);
    }
    if (!(path.flags & PATH_PASS_CHOSEN)) {
        film_add(writer, path.pixel, own_pass, c);
    } else {
        add_to_light_passes(writer, path.pixel, c, path.pass_diffuse, path.pass_glossy, path.flags & PATH_VOLUME_PASS,
                            path.bounce == 1);
    }
}

// The world behind a transparent film: it shows in the Environment pass alone.
LUCH_FN void add_environment_only(const RenderView& scene, FilmWriter& writer, const PathState& path, Color radiance) {
    Color c = path.throughput * radiance;
    if (!is_zero(c) && admit(scene, writer, c, 0, REFUSED_EMISSION))
        film_add(writer, path.pixel, writer.film.layout.environment, c);
}

LUCH_FN void add_direct(const RenderView& scene, FilmWriter& writer, const PathState& path, const ShadowRay& shadow,
                        Color transmittance) {
    Color c = shadow.contribution * transmittance;
    const Color whole = c;
    if (!admit(scene, writer, c, shadow.bounce, REFUSED_DIRECT)) return;
    if (plan::AMBIENT_OCCLUSION && shadow.for_ao) {
        film_add(writer, path.pixel, writer.film.layout.ambient_occlusion, c);
        return;
    }
    note_clamped(writer, whole, c);
    film_add_combined(writer, path.pixel, c);
    if (!wants_light_passes(writer.film.layout)) return;
    if (shadow.lightgroup) film_add_lightgroup(writer, path.pixel, shadow.lightgroup - 1, c);
    add_to_light_passes(writer, path.pixel, c, shadow.pass_diffuse, shadow.pass_glossy, shadow.volume_pass,
                        shadow.bounce == 0);
}

// Light that goes on to a transparent background or into a holdout: 1 - alpha.
LUCH_FN void add_alpha_hole(FilmWriter& writer, const PathState& path, float transparent) {
    film_add_transparency(writer, path.pixel, transparent);
}

// aovs: 4 floats for each of the film's. Written whole at every surface up to the first that counts as opaque, as
// Blender does: an AOV is data.
LUCH_FN void write_aovs(FilmWriter& writer, const PathState& path, const float* aovs) {
    if (!(path.flags & PATH_THROUGH_FILM) || (path.flags & PATH_DATA_DONE)) return;
    for (u32 i = 0; i < writer.film.layout.aov_count; i++) {
        const float* value = aovs + u64(i) * 4u;
        // Alpha is 1 where the surface has an AOV Output. A value AOV writes its one float; what lies beside it is never
        // read.
        film_add_aov_color(writer, path.pixel, i, Color{value[0], value[1], value[2]}, value[3]);
    }
}

// Depth, Position and the indices are those of a pixel's first sample: averages would lie between surfaces.
LUCH_FN void write_first_sample(const RenderView& scene, FilmWriter& writer, u32 pixel, Vec3 p, u32 instance,
                                u32 material) {
    const ObjectView& object = scene.view.objects[scene.view.instances[instance].object];
    const FilmLayout& layout = writer.film.layout;
    film_set(writer, pixel, layout.depth, camera_depth(scene.camera, p));
    film_set(writer, pixel, layout.object_index, object.pass_index);
    film_set(writer, pixel, layout.material_index, scene.view.materials[material].pass_index);
    film_set_position(writer, pixel, p);
}

LUCH_FN void write_crypto(const RenderView& scene, FilmWriter& writer, const PathState& path, u32 instance,
                          u32 material, float alpha) {
    float weight = average(path.throughput) * alpha;
    const ObjectView& object = scene.view.objects[scene.view.instances[instance].object];
    const FilmLayout& layout = writer.film.layout;
    film_add_crypto(writer, path.pixel, layout.crypto_object, object.crypto_object, weight);
    film_add_crypto(writer, path.pixel, layout.crypto_material, scene.view.materials[material].crypto, weight);
    film_add_crypto(writer, path.pixel, layout.crypto_asset, object.crypto_asset, weight);
}

LUCH_FN_SLOW void write_data_passes(const RenderView& scene, FilmWriter& writer, PathState& path,
                                    const ShadePoints& points, int lane, const ClosureSet& set, u32 material) {
    if (!(path.flags & PATH_THROUGH_FILM)) return;
    const FilmLayout& layout = writer.film.layout;
    float alpha = 1.0f - average(set.transparent);
    Vec3 p = lane_position(points, lane);
    if (!(path.flags & PATH_DATA_DONE)) {
        if (path.sample == 0) write_first_sample(scene, writer, path.pixel, p, points.instance[lane], material);
        if (alpha >= scene.limits.alpha_threshold) {
            path.flags |= PATH_DATA_DONE;
            film_add(writer, path.pixel, layout.normal, shading_normal(set, lane_normal(points, lane)));
            if (layout.uv != NONE) film_add(writer, path.pixel, layout.uv, surface_uv(scene.view, points, lane));
        }
    }
    if (layout.diffuse_color != NONE || layout.glossy_color != NONE || layout.transmission_color != NONE) {
        BsdfValue albedo = closure_albedo(set, lane_to_viewer(points, lane));
        film_add(writer, path.pixel, layout.diffuse_color, albedo.diffuse * path.throughput);
        film_add(writer, path.pixel, layout.glossy_color, albedo.glossy * path.throughput);
        film_add(writer, path.pixel, layout.transmission_color, albedo.transmission * path.throughput);
    }
    if (layout.mist != NONE) {
        float mist = saturate_f((camera_distance(scene.camera, p) - scene.mist_start) * scene.mist_inverse_depth);
        if (scene.mist_exponent != 1.0f) mist = pow_f(mist, scene.mist_exponent);
        film_add(writer, path.pixel, layout.mist, (1.0f - mist) * average(path.throughput) * alpha);
    }
    if (layout.crypto_slots > 0) write_crypto(scene, writer, path, points.instance[lane], material, alpha);
}

LUCH_FN float smooth_step_between(float from, float to, float x) {
    float t = saturate_f((x - from) / (to - from));
    return t * t * (3.0f - 2.0f * t);
}

// Albedo and normal (in camera space) for a denoiser; transparency and sharp reflections pass the task on
// to what they show.
LUCH_FN_SLOW void write_features(const RenderView& scene, FilmWriter& writer, PathState& path, const ClosureSet& set,
                                 Vec3 to_viewer) {
    Vec3 normal = make_vec3(0.0f);
    Color rough_albedo = make_vec3(0.0f), sharp_albedo = make_vec3(0.0f);
    float sum = 0.0f, rough_sum = 0.0f;
    for (int i = 0; i < set.count; i++) {
        const Lobe& lobe = set.lobes[i];
        Color albedo = lobe.weight;
        if (!is_diffuse(lobe.type)) {
            FresnelTerm share = lobe_albedo(lobe, to_viewer);
            albedo *= share.reflected + share.transmitted;
        }
        float weight = average(albedo);
        float roughness = is_diffuse(lobe.type) ? 1.0f : sqrt_f(lobe.alpha_x * lobe.alpha_y);
        float rough = smooth_step_between(0.0f, 0.15f, roughness);
        normal += lobe.normal * weight;
        rough_albedo += albedo * rough;
        sharp_albedo += albedo * (1.0f - rough);
        sum += weight;
        rough_sum += weight * rough;
    }
    float write = sum > 0.0f ? smooth_step_between(0.0f, 0.5f, rough_sum / sum) : 0.0f;
    if (write > 0.0f) {
        const FilmLayout& layout = writer.film.layout;
        // The mean normal, by the share of the surface that is not transparent.
        float weight = write * average(path.feature_throughput) / (sum + average(set.transparent));
        film_add(writer, path.pixel, layout.denoising_normal,
                 transform_direction(scene.camera.to_camera, normal) * weight);
        film_add(writer, path.pixel, layout.denoising_albedo, path.feature_throughput * rough_albedo * write);
    }
    path.feature_throughput *= sharp_albedo * (1.0f - write) + set.transparent;
    if (!(max_component(path.feature_throughput) > FEATURE_CUTOFF)) path.flags &= ~u32(PATH_FEATURES);
}

}  // namespace luch
