// Next-event estimation: one light per shaded point, its emission, and the shadow ray.
#pragma once
#include "luch/integrator/borders.h"
#include "luch/integrator/scatter.h"
#include "luch/math/bounds.h"

namespace luch {

LUCH_FN Color only(BsdfValue& value, u32 visibility) {
    if (!(visibility & RAY_DIFFUSE)) value.diffuse = make_vec3(0.0f);
    if (!(visibility & RAY_GLOSSY)) value.glossy = make_vec3(0.0f);
    if (!(visibility & RAY_TRANSMISSION)) value.transmission = make_vec3(0.0f);
    return total(value);
}

// Blender's Max Bounces of a lamp or of the world, as Cycles hears it: it ends sampling, not seeing.
LUCH_FN bool light_is_spent(const LightsView& lights, const LightSample& s, u32 bounce) {
    if (s.kind == EmitterKind::LAMP) return bounce > lights.lamps[s.lamp].max_bounces;
    return s.kind == EmitterKind::WORLD && bounce > lights.world.max_bounces;
}

// Whether lights matter to the point.
LUCH_FN bool takes_light(const ClosureSet& set) { return set.count != 0 && has_smooth_lobe(set); }

// Whether a sample may bring light to the path's point.
LUCH_FN bool may_light(const RenderView& scene, const PathState& path, const LightSample& s) {
    if (s.kind == EmitterKind::NONE_ || !(s.pdf_sa > 0.0f)) return false;
    return !light_is_spent(*scene.view.lights, s, path.bounce);
}

// A light for the point, or false where none can reach it. u: two numbers for the place, one for the choice.
LUCH_FN bool choose_light(const RenderView& scene, const PathState& path, const ShadePoints& points, int lane,
                          const ClosureSet& set, Vec3 u, LightSample* s) {
    if (!takes_light(set)) return false;
    *s = sample_light(scene.view, lane_position(points, lane), lane_normal(points, lane), set_transmits(set), u.z,
                      {u.x, u.y}, lane_time(points, lane));
    return may_light(scene, path, *s);
}

LUCH_FN ConstantEmission emission_of(const RenderView& scene, const LightSample& s, float time) {
    if (s.kind == EmitterKind::LAMP)
        return {!scene.view.lights->lamps[s.lamp].has_program, {1.0f, 1.0f, 1.0f}, false, {}};
    if (s.kind == EmitterKind::WORLD) return scene.world_emission;
    ConstantEmission emission = scene.material_emission[material_at(scene.view, s.instance, s.prim)];
    if (emission.by_side) {  // the side as setup_surface_lane tells it
        InstanceView moved;
        const InstanceView& instance = instance_at_time(scene.view, s.instance, time, &moved);
        Vec3 ng = world_face_normal(instance, triangle_at(scene.view, instance, s.prim, time));
        if (dot(ng, -s.direction) < 0.0f) emission.radiance = emission.behind;
    }
    return emission;
}

LUCH_FN const Program& program_of(const RenderView& scene, const LightSample& s) {
    if (s.kind == EmitterKind::LAMP) return scene.view.lights->lamps[s.lamp].program;
    if (s.kind == EmitterKind::WORLD) return scene.view.world_program;
    return scene.view.materials[material_at(scene.view, s.instance, s.prim)].program;
}

// What the light's program reads at the sampled place. footprint, time: at the shaded point.
LUCH_FN void setup_light_lane(const RenderView& scene, const PathState& path, u32 path_index, const LightSample& s,
                              float footprint, float time, ShadePoints& points, int lane) {
    LaneInputs in;
    in.radial = make_vec3(0.0f);  // spheres are no lights
    in.point = s.kind == EmitterKind::WORLD ? s.direction : s.point;
    in.to_viewer = -s.direction;
    in.instance = s.instance, in.prim = s.prim;
    in.u = s.u, in.v = s.v;
    in.ray_length = finite_f(s.distance) ? s.distance : 0.0f;
    in.footprint = footprint;
    in.flags = (path.flags & 0xffffu & ~u32(PATH_CAMERA)) | PATH_EMISSION_ONLY;
    in.depth = depth_word(path);
    in.transparent_depth = path.transparent_bounce;
    in.path = path_index;
    in.seed = 0;
    in.time = time;
    if (s.kind == EmitterKind::TRIANGLE) {
        setup_surface_lane(scene.view, in, points, lane);
        return;
    }
    in.prim = s.kind == EmitterKind::LAMP ? s.lamp : NONE;
    setup_free_lane(in, s.kind == EmitterKind::LAMP ? s.normal : -s.direction, points, lane);
}

// Where a shadow ray leaves the surface. Where light grazes it, the flat triangles of a smooth-shaded mesh would shade
// themselves in steps: there the ray starts from the curved surface, wholly up to the cutoff, fading out to twice it.
LUCH_FN Vec3 shadow_ray_origin(const ShadePoints& points, int lane, SurfacePoint spot, Vec3 direction) {
    Vec3 ng = lane_face_normal(points, lane), n = lane_normal(points, lane);
    float cutoff = points.terminator[lane], cosine = dot(n, direction);
    if (!(cutoff > 0.0f)) return offset_origin(spot, ng, direction);
    float side = cosine < 0.0f ? -1.0f : 1.0f, cos_face = side * dot(ng, direction);
    float share = saturate_f(cosine < cutoff ? 2.0f - (cos_face + cosine) / cutoff : 1.0f - cos_face / cutoff);
    float height = share * (cosine < 0.0f ? points.below[lane] : points.above[lane]);
    if (height > 0.0f) {
        spot.p += n * (side * height);
        spot.error += gamma_f(1) * abs_v(spot.p);
    }
    return offset_origin(spot, ng, direction);
}

// The ray to the sampled light and what it brings; false where that is nothing. emission: of the light's program.
LUCH_FN bool make_shadow_ray(const RenderView& scene, const FilmLayout& layout, const PathState& path, u32 path_index,
                             const ShadePoints& points, int lane, const ClosureSet& set, const SurfacePoint& spawn,
                             const LightSample& s, Color emission, Ray* ray, ShadowRay* shadow) {
    Color light = emission * s.radiance;
    if (is_zero(light)) return false;
    Vec3 ng = lane_face_normal(points, lane);
    float bsdf_pdf = 0.0f;
    BsdfValue value;
    if (has_photons(scene))
        value = eval_parts(path, set, casts_caustics(scene.view, points.instance[lane], points.prim[lane]), ng,
                           lane_to_viewer(points, lane), s.direction, s.pdf_sa, s.mis);
    else
        value = eval_closures(set, ng, lane_to_viewer(points, lane), s.direction, &bsdf_pdf);
    Color reflected = only(value, s.visibility);
    if (is_zero(reflected)) return false;
    float lobes = lobe_weight_sum(set);
    bsdf_pdf *= lobes / (lobes + average(set.transparent));
    float weight = (s.mis ? mis_weight(s.pdf_sa, bsdf_pdf) : 1.0f) / s.pdf_sa;  // of parts, they have theirs already
    ray->origin = shadow_ray_origin(points, lane, spawn, s.direction);
    ray->t_min = 0.0f;
    ray->direction = s.direction;
    ray->t_max = s.distance;
    if (finite_f(s.distance)) {
        // From the moved origin to the very point on the light, stopped short of it.
        Vec3 to_light = s.point - ray->origin;
        float distance = length(to_light);
        if (!(distance > 0.0f)) return false;
        ray->direction = to_light * (1.0f / distance);
        ray->t_max = distance * (1.0f - LIGHT_SHORTENING);
    }
    shadow->contribution = path.throughput * reflected * light * weight;
    shadow->pass_diffuse = path.pass_diffuse;
    shadow->pass_glossy = path.pass_glossy;
    if (wants_light_passes(layout) && !(path.flags & PATH_PASS_CHOSEN)) {
        shadow->pass_diffuse = share(value.diffuse, reflected);
        shadow->pass_glossy = share(value.glossy, reflected);
    }
    shadow->path = path_index;
    shadow->bounce = path.bounce;
    shadow->transparent_depth = path.transparent_bounce;
    shadow->depth = depth_word(path);
    shadow->footprint = points.footprint[lane];
    shadow->lightgroup = s.lightgroup;
    shadow->for_ao = false;
    shadow->casts = s.cast_shadow;
    shadow->volume_pass = path.flags & PATH_VOLUME_PASS;
    return true;
}

// The ray for the Ambient Occlusion pass.
LUCH_FN void make_ao_ray(const RenderView& scene, const PathState& path, u32 path_index, const ShadePoints& points,
                         int lane, const ClosureSet& set, const SurfacePoint& spawn, Ray* ray, ShadowRay* shadow) {
    Vec3 n = shading_normal(set, lane_normal(points, lane));
    Vec2 u = sample_2d(path.sampler, path.dimension + DIM_AO);
    Vec3 t, b;
    make_frame(n, &t, &b);
    Vec3 direction = to_world(sample_cosine_hemisphere(u), t, b, n);
    *ray = {shadow_ray_origin(points, lane, spawn, direction), 0.0f, direction, scene.limits.ao_distance};
    *shadow = ShadowRay{};
    shadow->contribution = path.throughput * (make_vec3(1.0f) - set.transparent);
    shadow->path = path_index;
    shadow->transparent_depth = path.transparent_bounce;
    shadow->depth = depth_word(path);
    shadow->footprint = points.footprint[lane];
    shadow->for_ao = true;
    shadow->casts = true;
}

LUCH_FN bool wants_ao(const FilmLayout& layout, const PathState& path) {
    return plan::AMBIENT_OCCLUSION && layout.ambient_occlusion != NONE && (path.flags & PATH_CAMERA);
}

// The ray goes on from another point on its way, to the same end.
LUCH_FN void start_again(Ray* ray, Vec3 origin) {
    if (finite_f(ray->t_max)) ray->t_max -= dot(origin - ray->origin, ray->direction);
    ray->origin = origin;
}

// Takes the ray straight through a surface, as that is at a time, out of and into media.
LUCH_FN void pass_surface(const SceneView& scene, MediumStack& stack, const Hit& hit, float time, Ray* ray) {
    SurfacePoint spot = surface_point(scene, hit, *ray, time);
    Vec3 ng = border_normal(scene, hit, spot, time);
    cross_border(scene, stack, hit.instance, hit.prim, dot(ng, ray->direction) > 0.0f);
    start_again(ray, offset_origin(spot, ng, ray->direction));
}

// A shadow ray that met only surfaces that may be transparent: from one to the next, until it is dark.
// tracer.closest(ray) gives a Hit at tracer.time; shader.light(program, points, lane) a point's ClosureSet of light alone.
// *steps: surfaces looked through; *rays: traced. stack: media around the ray's beginning, which become those at its end;
// null: the scene has none.
template <class Tracer, class Shader>
LUCH_FN Color walk_transparent(const RenderView& scene, const Ray& first, const ShadowRay& shadow, MediumStack* stack,
                               Tracer& tracer, Shader& shader, ShadePoints& points, u64* steps, u64* rays) {
    Color through = make_vec3(1.0f);
    Ray ray = first;
    u32 borders = 0;
    for (u32 passed = shadow.transparent_depth; passed <= scene.limits.transparent; passed++) {
        Hit hit = tracer.closest(ray);
        ++*rays;
        if (plan::VOLUMES && stack) {
            through *= media_transmittance(scene.media, *stack, min_f(hit.t, ray.t_max));
            if (is_zero(through)) return through;
            if (hit.instance != NONE && is_border(scene.view, hit)) {
                pass_surface(scene.view, *stack, hit, tracer.time, &ray);
                passed--;  // no surface: it counts as none
                if (++borders > MOST_BORDERS) return make_vec3(0.0f);
                if (!(ray.t_max > 0.0f)) return through;
                continue;
            }
        }
        if (hit.instance == NONE) return through;
        if (passed == scene.limits.transparent) return make_vec3(0.0f);
        const MaterialView& material = scene.view.materials[material_at(scene.view, hit.instance, hit.prim)];
        if (!(material.program.flags & PROGRAM_TRANSPARENT) || !material.transparent_shadows) return make_vec3(0.0f);
        ++*steps;
        SurfacePoint spot = surface_point(scene.view, hit, ray, tracer.time);
        points.count = 1;
        LaneInputs in;
        in.point = spot.p, in.radial = spot.radial;
        in.to_viewer = -ray.direction;
        in.instance = hit.instance, in.prim = hit.prim;
        in.u = hit.u, in.v = hit.v;
        in.ray_length = hit.t;
        in.footprint = shadow.footprint;
        in.flags = PATH_SHADOW | PATH_TRANSPARENT_ONLY;
        in.depth = shadow.depth;
        in.transparent_depth = passed;
        in.path = 0, in.seed = 0;
        in.time = tracer.time;
        setup_surface_lane(scene.view, in, points, 0);
        through *= shader.light(material.program, points).transparent;
        if (!(max_component(through) > 0.0f)) return make_vec3(0.0f);
        if (plan::VOLUMES && stack)
            cross_border(scene.view, *stack, hit.instance, hit.prim, points.flags[0] & PATH_BACKFACING);
        start_again(&ray, offset_origin(spot, lane_face_normal(points, 0), ray.direction));
        if (!(ray.t_max > 0.0f)) return through;
    }
    return make_vec3(0.0f);
}

}  // namespace luch
