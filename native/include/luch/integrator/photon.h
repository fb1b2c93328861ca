// Photons: where they start, where they lie, and what a path gathers of them.
//
// A photon starts at a triangle that casts caustics, lit by one sampled light: it comes from that light, and must meet
// the triangle first, or surfaces that let light straight through. From there it follows sharp lobes alone and leaves a
// record at every surface with rough ones. Each map serves some samples of every pixel and is of a smaller radius than
// the ones before, so that noise and blur vanish together. Sources: Jensen 1996, "Global illumination using photon
// maps"; Hachisuka, Ogaki, Jensen 2008, "Progressive photon mapping"; Knaus and Zwicker 2011, "Progressive photon
// mapping: a probabilistic approach" (maps of their own for each pass, radii by a formula).
#pragma once
#include "luch/integrator/direct_light.h"
#include "luch/integrator/photon_map.h"
#include "luch/math/bounds.h"

namespace luch {

// -- starting ----------------------------------------------------------------------------------------

// Dimensions of a photon's start, before its events': the place on the triangle with the triangle, the light, the object
// with the time.
inline constexpr u32 DIMENSIONS_PHOTON = 4;
enum PhotonDimension : u32 { DIM_CASTER, DIM_CASTER_LIGHT, DIM_CASTER_OBJECT };
// A photon's numbers are no path's: the seed is hashed with this and the map's first sample.
inline constexpr u32 PHOTON_SEED = 0x70686f74u;

// What a photon remembers until it is at its triangle, in members of PathState that are a camera path's otherwise.
struct PhotonGoal {
    u32 instance, prim;
    float distance;  // from the light
    u32 visibility;  // of the light, RayKind bits
    u32 lightgroup;
};
LUCH_FN void set_goal(PathState& path, const PhotonGoal& goal) {
    path.pass_diffuse = {bits_float(goal.instance), bits_float(goal.prim), goal.distance};
    path.pass_glossy = {bits_float(goal.visibility), bits_float(goal.lightgroup), 0.0f};
}
LUCH_FN PhotonGoal goal_of(const PathState& path) {
    return {float_bits(path.pass_diffuse.x), float_bits(path.pass_diffuse.y), path.pass_diffuse.z,
            float_bits(path.pass_glossy.x), float_bits(path.pass_glossy.y)};
}

// Chooses an entry of a table (find_interval); *probability is multiplied by its own.
LUCH_FN u32 choose_by_cdf(const float* cdf, u32 count, float u, float* probability) {
    float within;
    u32 i = find_interval(cdf, count, u, &within);
    *probability *= cdf[i + 1u] - cdf[i];
    return i;
}

// Starts a photon; false where it brings nothing. emission(sample, path, time): of the light's program there.
template <class Emission>
LUCH_FN bool begin_photon(const RenderView& scene, u32 map, u32 start, Emission& emission, PathState& path, Ray* ray,
                          float* time) {
    const CastersView& casters = scene.casters;
    path = PathState{};
    path.sampler = {hash_u32(scene.seed, PHOTON_SEED, map), start};
    u32 first = first_dimension(scene.sampler);
    Vec3 u_place = sample_3d(path.sampler, first + DIM_CASTER);
    Vec3 u_light = sample_3d(path.sampler, first + DIM_CASTER_LIGHT);
    Vec2 u_object = sample_2d(path.sampler, first + DIM_CASTER_OBJECT);
    path.dimension = first + DIMENSIONS_PHOTON;
    *time = has_motion(scene) ? shutter_time(*scene.shutter, u_object.y, 0u, 1u) : SHUTTER_MIDDLE;
    float chosen = 1.0f;
    u32 instance = casters.instances[choose_by_cdf(casters.instance_cdf, casters.count, u_object.x, &chosen)];
    u32 object = scene.view.instances[instance].object, from = casters.object_first[object];
    u32 prim = casters.prims[from + choose_by_cdf(casters.prim_cdf + from + object,
                                                  casters.object_first[object + 1u] - from, u_place.z, &chosen)];
    if (!(chosen > 0.0f)) return false;
    float root = sqrt_f(u_place.x);
    InstanceView moved;
    const InstanceView& at = instance_at_time(scene.view, instance, *time, &moved);
    Triangle triangle = triangle_at(scene.view, at, prim, *time);
    Vec3 spread = cross(transform_direction(at.to_world, triangle.p[1] - triangle.p[0]),
                        transform_direction(at.to_world, triangle.p[2] - triangle.p[0]));
    float area = 0.5f * length(spread);
    if (!(area > 0.0f)) return false;
    Vec3 ng = spread * (0.5f / area);
    Vec3 p = triangle_point(triangle, root * (1.0f - u_place.y), root * u_place.y, at).p;
    LightSample s = sample_light(scene.view, p, ng, true, u_light.z, {u_light.x, u_light.y}, *time);
    if (s.kind == EmitterKind::NONE_ || !(s.pdf_sa > 0.0f)) return false;
    path.flags = u32(PATH_DIFFUSE) | PATH_DIFFUSE_ANCESTOR | PATH_REFLECT | PATH_NO_MIS;
    Color light = emission(s, path, *time) * s.radiance;
    float density = chosen / area * s.pdf_sa;
    path.throughput = light * (abs_f(dot(ng, s.direction)) / density);
    if (is_zero(path.throughput) || !finite_v(path.throughput)) return false;
    float distance = finite_f(s.distance) ? s.distance : casters.reach;
    if (!s.cast_shadow) distance = min_f(distance, SHADOWLESS_DISTANCE * sqrt_f(area));
    path.continuation = 1.0f;
    path.min_pdf = 1e30f;
    path.visibility = RAY_SHADOW;
    path.pixel = start;
    set_goal(path, {instance, prim, distance, s.visibility, s.lightgroup});
    *ray = {p + s.direction * distance, distance * LIGHT_SHORTENING, -s.direction, INFINITE_DISTANCE};
    return true;
}

// -- at a surface ------------------------------------------------------------------------------------

// Flux and radiance are told by face and by smooth normals: a photon is as bright as the path that goes its way back.
// Source: Veach 1997, section 5.3.
LUCH_FN float normal_correction(Vec3 n, Vec3 ng, Vec3 from, Vec3 to) {
    float turned = abs_f(dot(n, from) * dot(ng, to)), flat = abs_f(dot(ng, from) * dot(n, to));
    return flat > 0.0f ? min_f(turned / flat, MOST_NORMAL_CORRECTION) : 0.0f;
}

LUCH_FN bool passes_on(const RenderView& scene, PathState& path, const ShadePoints& points, int lane,
                       const SurfacePoint& spawn, Color through, Vec3 incoming, float distance, Ray* next) {
    path.throughput *= through;
    path.travelled += distance;
    count_transparent(path, scene.limits);
    if (is_zero(path.throughput) || (path.flags & PATH_ENDS_AT_SURFACE)) return false;
    *next = ray_from(spawn, lane_face_normal(points, lane), incoming);
    return true;
}

// A photon at a surface whose program has run. True where it goes on, by *next. *lands: it leaves a record, *photon.
LUCH_FN bool photon_at_surface(const RenderView& scene, u64* refused, PathState& path, const ShadePoints& points,
                               int lane, const ClosureSet& set, const SurfacePoint& spawn, Vec3 incoming,
                               float distance, Ray* next, Photon* photon, bool* lands) {
    *lands = false;
    const u32 instance = points.instance[lane], prim = points.prim[lane];
    const PhotonGoal goal = goal_of(path);
    bool begins = !(path.flags & PATH_CAUSTIC);
    if (begins) {
        float off = abs_f(path.travelled + distance - goal.distance);
        bool there = instance == goal.instance && (prim == goal.prim || off <= CASTER_DISTANCE_ERROR * goal.distance);
        if (!there) return passes_on(scene, path, points, lane, spawn, set.transparent, incoming, distance, next);
    }
    Vec3 ng = lane_face_normal(points, lane), wo = lane_to_viewer(points, lane);
    bool casts = casts_caustics(scene.view, instance, prim);
    if (!begins && part_weight(set, casts, false) > 0.0f) {
        *lands = true;
        *photon = {lane_position(points, lane), path.pixel, ng, goal.lightgroup, wo, path.bounce, path.throughput, 0u};
    }
    float through = begins ? 0.0f : average(set.transparent), sharp = casts ? part_weight(set, true, true) : 0.0f;
    if (!(through + sharp > 0.0f)) return false;
    Vec3 u = sample_3d(path.sampler, path.dimension + DIM_BSDF);
    float through_probability = through / (through + sharp);
    if (u.z < through_probability)
        return passes_on(scene, path, points, lane, spawn, set.transparent * (1.0f / through_probability), incoming,
                         distance, next);
    float u_lobe = min_f((u.z - through_probability) / (1.0f - through_probability), BELOW_ONE);
    ClosureSet part;
    copy_part(set, casts, true, &part);
    BsdfSample s = sample_closures(part, ng, wo, u_lobe, {u.x, u.y});
    if (!(s.pdf_sa > 0.0f) || is_zero(s.throughput)) return false;
    if (begins && !(goal.visibility & (s.transmitted ? RAY_TRANSMISSION : RAY_GLOSSY))) return false;
    float correction = normal_correction(shading_normal(part, lane_normal(points, lane)), ng, wo, s.direction);
    // Radiance, as paths count it here and in Cycles, is the same on both sides of an interface; so flux must not be.
    if (s.transmitted) correction /= sqr(s.eta);
    Color weight = s.throughput * (correction / (1.0f - through_probability));
    if (!finite_v(weight)) {
        count_one(refused + REFUSED_SCATTER);
        return false;
    }
    // As much power goes on, in the mean, by as many photons as the surface leaves of it.
    float survival = min_f(max_component(weight), 1.0f);
    if (!(sample_1d(path.sampler, path.dimension + DIM_TERMINATE) < survival)) return false;
    path.throughput *= weight * (1.0f / survival);
    path.bounce++;
    u8& counted = s.transmitted ? path.transmission_bounce : path.glossy_bounce;
    if (++counted > (s.transmitted ? scene.limits.transmission : scene.limits.glossy)) return false;
    if (path.bounce > scene.limits.bounces) return false;
    path.flags = (path.flags | u32(PATH_CAUSTIC)) & ~u32(PATH_BEHIND_TRANSPARENT);
    path.visibility = RAY_ALL;
    path.travelled = 0.0f;
    path.dimension += DIMENSIONS_PER_EVENT;
    *next = ray_from(spawn, ng, s.direction);
    return true;
}

// -- gathering ---------------------------------------------------------------------------------------

// Light of the photons around a point, by its rough lobes; what its light group takes goes to the film at once.
LUCH_FN_SLOW BsdfValue gather_photons(const RenderView& scene, FilmWriter& writer, const PathState& path,
                                      const ShadePoints& points, int lane, const ClosureSet& set) {
    const PhotonMap& map = scene.photons;
    BsdfValue sum = {};
    ClosureSet part;
    copy_part(set, casts_caustics(scene.view, points.instance[lane], points.prim[lane]), false, &part);
    if (part.count == 0) return sum;
    Vec3 p = lane_position(points, lane), ng = lane_face_normal(points, lane), wo = lane_to_viewer(points, lane);
    const PhotonLevel& level = map.levels[level_at(map, p)];
    float radius2 = sqr(level.radius);
    for_each_cell(cells_around(p, level.inverse_cell), [&](const PhotonCell& cell) {
        u32 bucket = bucket_of(cell, level.mask), end = level.first[bucket + 1u];
        for (u32 i = level.first[bucket]; i < end; ++i) {
            const PhotonPlace& place = level.places[i];
            Vec3 to = place.point - p;
            float distance2 = length_squared(to);
            if (!(distance2 < radius2)) continue;
            PhotonCell own = cell_of(place.point, level.inverse_cell);  // another cell may share the bucket
            if (own.x != cell.x || own.y != cell.y || own.z != cell.z) continue;
            if (abs_f(dot(to, ng)) > FLAT_PART * level.radius) continue;
            const Photon& photon = map.photons[place.photon];
            if (abs_f(dot(photon.normal, ng)) < SAME_SIDE_COSINE) continue;
            if (u32(path.bounce) + photon.bounce >= scene.limits.bounces) continue;
            float pdf;
            BsdfValue value = eval_closures(part, ng, wo, photon.direction, &pdf);
            // Epanechnikov's kernel; per area across the ray, as closures count |cos|.
            float share = 2.0f * (1.0f - distance2 / radius2) * level.scale /
                          max_f(abs_f(dot(ng, photon.direction)), LEAST_PHOTON_COSINE);
            Color brought = photon.power * share;
            sum.diffuse += value.diffuse * brought;
            sum.glossy += value.glossy * brought;
            sum.transmission += value.transmission * brought;
            if (plan::LIGHT_PASSES && photon.lightgroup)
                film_add_lightgroup(writer, path.pixel, photon.lightgroup - 1u,
                                    path.throughput * total(value) * brought);
        }
    });
    return sum;
}

// Adds what the photons around a surface point bring to the path's pixel: indirect light.
LUCH_FN void add_photons(const RenderView& scene, FilmWriter& writer, const PathState& path, const ShadePoints& points,
                         int lane, const ClosureSet& set) {
    if (!has_photons(scene) || scene.photons.count == 0u || set.count == 0) return;
    // A path would have to leave here by a bounce, and then be lit by more than what it comes upon.
    if (u32(path.diffuse_bounce) + 1u >= scene.limits.diffuse) return;
    BsdfValue value = gather_photons(scene, writer, path, points, lane, set);
    Color sum = total(value), c = path.throughput * sum;
    const Color whole = c;
    if (is_zero(c) || !admit(scene, writer, c, 1u, REFUSED_DIRECT)) return;
    note_clamped(writer, whole, c);
    film_add_combined(writer, path.pixel, c);
    if (!wants_light_passes(writer.film.layout)) return;
    Color diffuse = path.pass_diffuse, glossy = path.pass_glossy;
    if (!(path.flags & PATH_PASS_CHOSEN)) diffuse = share(value.diffuse, sum), glossy = share(value.glossy, sum);
    add_to_light_passes(writer, path.pixel, c, diffuse, glossy, path.flags & PATH_VOLUME_PASS, false);
}

}  // namespace luch
