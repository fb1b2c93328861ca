// Emissive triangles of instances: one emitter each, or one for a whole instance where there are too many.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "cpu/light/build.h"
#include "cpu/light/cdf.h"
#include "luch/light/triangle.h"

namespace luch::cpu {
namespace {

const MaterialView& material_of(const SceneView& scene, const InstanceView& at, u32 slot, u32* index) {
    *index = material_of_slot(scene, at, slot);
    return scene.materials[*index];
}

bool samples_as_light(const MaterialView& material) {
    return (material.program.flags & PROGRAM_EMISSION) != 0u && material.emission_sampling != 0u;
}

bool any_light(const SceneView& scene, const InstanceView& at) {
    if (at.visibility == 0u) return false;
    for (u32 slot = 0; slot < std::max(at.material_count, 1u); ++slot) {
        u32 index;
        if (samples_as_light(material_of(scene, at, slot, &index))) return true;
    }
    return false;
}

// Everything on it emits and hides what lies behind.
bool all_light(const SceneView& scene, const InstanceView& at) {
    for (u32 slot = 0; slot < std::max(at.material_count, 1u); ++slot) {
        u32 index;
        const MaterialView& material = material_of(scene, at, slot, &index);
        if (!samples_as_light(material) || (material.program.flags & PROGRAM_TRANSPARENT) != 0u) return false;
    }
    return true;
}

// Lights that move are looked at so many times while the shutter is open.
constexpr u32 LOOKS = 17;
float look_time(u32 look) { return float(look) / float(LOOKS - 1); }
bool is_moving(const InstanceView& at) { return (at.flags & (INSTANCE_MOVES | INSTANCE_DEFORMS)) != 0u; }

// Widens the bounds of a triangle, those of the shutter's middle, to all places and directions on its way: an emitter is
// chosen by bounds, and sampled where it is at the path's time.
void follow_triangle(const SceneView& scene, u32 instance, u32 prim, EmitterBounds* b) {
    Vec3 low = b->low, high = b->high;
    auto corners_at = [&](float time) {
        InstanceView moved;
        const InstanceView& at = instance_at_time(scene, instance, time, &moved);
        Triangle t = triangle_at(scene, at, prim, time);
        for (Vec3& p : t.p) p = transform_point(at.to_world, p);
        return t;
    };
    auto normal_of = [](const Triangle& t) { return cross(t.p[1] - t.p[0], t.p[2] - t.p[0]); };
    // The side that shines is the one that the axis shows in the middle.
    float side = dot(normal_of(corners_at(SHUTTER_MIDDLE)), b->axis) < 0.0f ? -1.0f : 1.0f;
    for (u32 look = 0; look < LOOKS; ++look) {
        Triangle t = corners_at(look_time(look));
        for (Vec3 p : t.p) {
            low = min_v(low, p);
            high = max_v(high, p);
        }
        float cosine = side * dot(normalize_or(normal_of(t), b->axis * side), b->axis);
        b->normals_rad = max_f(b->normals_rad, acos_f(clamp_f(cosine, -1.0f, 1.0f)));
    }
    // What may lie between two looks.
    Vec3 margin = (high - low) * (0.5f / float(LOOKS - 1));
    b->low = low - margin;
    b->high = high + margin;
    b->normals_rad = min_f(b->normals_rad * (1.0f + 1.0f / float(LOOKS - 1)), PI);
}

// False: no area, or not finite. sides: 1 front, 2 back, 3 both.
bool triangle_bounds(const SceneView& scene, u32 instance, u32 prim, u32 sides, Color estimate, EmitterBounds* b) {
    const InstanceView& at = scene.instances[instance];
    const MeshView& mesh = scene.meshes[at.mesh];
    Triangle triangle = triangle_at(scene, mesh, prim);
    Vec3 corner[3];
    for (int i = 0; i < 3; ++i) corner[i] = transform_point(at.to_world, triangle.p[i]);
    Vec3 normal = cross(corner[1] - corner[0], corner[2] - corner[0]);
    float double_area = length(normal);
    if (!(double_area > 0.0f && finite_f(double_area))) return false;
    bool back_only = sides == 2u;
    bool flip = back_only != ((at.flags & INSTANCE_MIRRORED) != 0u);
    b->low = min_v(corner[0], min_v(corner[1], corner[2]));
    b->high = max_v(corner[0], max_v(corner[1], corner[2]));
    b->axis = normal / (flip ? -double_area : double_area);
    b->normals_rad = 0.0f;
    b->emission_rad = HALF_PI;
    b->two_sided = sides == 3u;
    float strength = luminance(abs_v(estimate));
    b->intensity =
        clamp_f((strength > 0.0f && finite_f(strength) ? strength : 1.0f) * 0.5f * double_area, 1e-30f, 1e30f);
    if (is_moving(at)) follow_triangle(scene, instance, prim, b);
    return finite_v(b->low) && finite_v(b->high);
}

// Light of one triangle for choosing: luminance times area in object space; 0: it is no light.
float cluster_weight(const SceneView& scene, const InstanceView& at, u32 prim, const std::vector<Color>& estimates,
                     u32 sides) {
    const MeshView& mesh = scene.meshes[at.mesh];
    u32 index;
    const MaterialView& material = material_of(scene, at, scene.material_slots[mesh.first_triangle + prim], &index);
    if (!samples_as_light(material) || (material.emission_sampling & sides) == 0u) return 0.0f;
    Triangle t = triangle_at(scene, mesh, prim);
    float area = 0.5f * length(cross(t.p[1] - t.p[0], t.p[2] - t.p[0]));
    float strength = index < estimates.size() ? luminance(abs_v(estimates[index])) : 1.0f;
    float weight = area * (strength > 0.0f && finite_f(strength) ? strength : 1.0f);
    return finite_f(weight) ? weight : 0.0f;
}

// Fills the emitters of all instances.
class Collector {
 public:
    Collector(const SceneView& scene, const std::vector<Color>& estimates, EmissiveArrays* out,
              std::vector<Emitter>* emitters, std::vector<EmitterBounds>* bounds)
        : scene_(scene), estimates_(estimates), out_(*out), emitters_(*emitters), bounds_(*bounds) {}

    void collect(size_t most_triangles) {
        out_.instances.assign(scene_.instance_count, InstanceLight{NONE, NONE, 0u, 3u});
        std::vector<u32> lit, uses(scene_.mesh_count, 0u);
        size_t triangles = 0;
        for (u32 i = 0; i < scene_.instance_count; ++i) {
            if (!any_light(scene_, scene_.instances[i])) continue;
            lit.push_back(i);
            uses[scene_.instances[i].mesh] += 1u;
            triangles += scene_.meshes[scene_.instances[i].mesh].triangle_count;
        }
        for (u32 i : lit) {
            out_.instances[i].sides = sides_of(scene_.instances[i]);
            if (triangles > most_triangles && uses[scene_.instances[i].mesh] > 1u)
                add_cluster(i);
            else
                add_triangles(i);
        }
    }

 private:
    u32 sides_of(const InstanceView& at) {
        // Through faces that cast no shadow the inner sides shine as well.
        if (!all_light(scene_, at) || !(at.visibility & RAY_SHADOW)) return 3u;
        auto [found, fresh] = sides_.try_emplace(at.mesh, 3u);
        if (fresh) found->second = outer_sides(scene_, scene_.meshes[at.mesh]);
        return found->second;
    }

    void add_triangles(u32 instance) {
        const InstanceView& at = scene_.instances[instance];
        const MeshView& mesh = scene_.meshes[at.mesh];
        InstanceLight& light = out_.instances[instance];
        u32 first = static_cast<u32>(out_.triangle_emitters.size());
        out_.triangle_emitters.resize(first + mesh.triangle_count, NONE);
        light.triangles = first;
        for (u32 prim = 0; prim < mesh.triangle_count; ++prim) {
            u32 index;
            const MaterialView& material =
                material_of(scene_, at, scene_.material_slots[mesh.first_triangle + prim], &index);
            u32 sides = material.emission_sampling & light.sides;
            if (!samples_as_light(material) || sides == 0u) continue;
            EmitterBounds b{};
            Color estimate = index < estimates_.size() ? estimates_[index] : Color{1.0f, 1.0f, 1.0f};
            if (!triangle_bounds(scene_, instance, prim, sides, estimate, &b)) continue;
            if (!places_.insert(place_of(at, mesh, prim)).second) continue;
            out_.triangle_emitters[first + prim] = static_cast<u32>(emitters_.size());
            emitters_.push_back({NONE, instance, prim, NONE});
            bounds_.push_back(b);
        }
    }

    // A triangle's place, whatever the order of its corners. Of emitters that lie in one place rays only ever
    // meet the first (equal distance: the smaller instance, then prim); sampling the others too would count
    // their light twice.
    using Place = std::array<std::array<float, 3>, 3>;
    Place place_of(const InstanceView& at, const MeshView& mesh, u32 prim) const {
        Triangle t = triangle_at(scene_, mesh, prim);
        Place place;
        for (int i = 0; i < 3; ++i) {
            Vec3 p = transform_point(at.to_world, t.p[i]);
            place[static_cast<size_t>(i)] = {p.x, p.y, p.z};
        }
        std::sort(place.begin(), place.end());
        return place;
    }

    struct Cluster {
        u32 cdf;
        float light;      // sum of luminance times area, object space; 0: none
        Vec3 low, high;   // object space
    };

    const Cluster& cluster_of(const InstanceView& at, u32 sides) {
        auto [found, fresh] = clusters_.try_emplace({at.mesh, at.first_material}, Cluster{});
        if (!fresh) return found->second;
        const MeshView& mesh = scene_.meshes[at.mesh];
        Cluster& c = found->second;
        c = {static_cast<u32>(out_.cluster_cdf.size()), 0.0f, make_vec3(1e38f), make_vec3(-1e38f)};
        std::vector<double> weights;
        for (u32 prim = 0; prim < mesh.triangle_count; ++prim)
            weights.push_back(cluster_weight(scene_, at, prim, estimates_, sides));
        out_.cluster_cdf.resize(c.cdf + weights.size() + 1);
        fill_cdf(weights, &out_.cluster_cdf[c.cdf]);
        c.light = static_cast<float>(std::accumulate(weights.begin(), weights.end(), 0.0));
        for (u32 v = 0; v < mesh.vertex_count; ++v) {
            Vec3 p = vertex_at(scene_, mesh, v);
            if (!finite_v(p)) continue;
            c.low = min_v(c.low, p);
            c.high = max_v(c.high, p);
        }
        return c;
    }

    void add_cluster(u32 instance) {
        const InstanceView& at = scene_.instances[instance];
        InstanceLight& light = out_.instances[instance];
        const Cluster& c = cluster_of(at, light.sides);
        if (!(c.light > 0.0f)) return;
        const float* m = at.to_world.m;
        Vec3 middle = transform_point(at.to_world, (c.low + c.high) * 0.5f), half = (c.high - c.low) * 0.5f;
        Vec3 reach = {abs_f(m[0]) * half.x + abs_f(m[1]) * half.y + abs_f(m[2]) * half.z,
                      abs_f(m[4]) * half.x + abs_f(m[5]) * half.y + abs_f(m[6]) * half.z,
                      abs_f(m[8]) * half.x + abs_f(m[9]) * half.y + abs_f(m[10]) * half.z};
        Vec3 x = {m[0], m[4], m[8]}, y = {m[1], m[5], m[9]}, z = {m[2], m[6], m[10]};
        float scale = (length_squared(x) + length_squared(y) + length_squared(z)) / 3.0f;  // of areas
        EmitterBounds b{};
        b.low = middle - reach;
        b.high = middle + reach;
        if (is_moving(at)) follow_cluster(instance, &b);
        b.axis = {0.0f, 0.0f, 1.0f};
        b.normals_rad = PI;
        b.emission_rad = HALF_PI;
        b.omni = true;
        // Of a closed surface a quarter is seen from any side, by its mean cosine.
        b.intensity = clamp_f(0.25f * c.light * scale, 1e-30f, 1e30f);
        if (!finite_v(b.low) || !finite_v(b.high) || !finite_f(scale)) return;
        light.cluster = static_cast<u32>(emitters_.size());
        light.cdf = c.cdf;
        emitters_.push_back({NONE, instance, NONE, NONE});
        bounds_.push_back(b);
    }

    // Every triangle of it, wherever it is on its way.
    void follow_cluster(u32 instance, EmitterBounds* b) {
        for (u32 prim = 0; prim < scene_.meshes[scene_.instances[instance].mesh].triangle_count; ++prim) {
            EmitterBounds own = *b;
            follow_triangle(scene_, instance, prim, &own);
            b->low = min_v(b->low, own.low);
            b->high = max_v(b->high, own.high);
        }
    }

    const SceneView& scene_;
    const std::vector<Color>& estimates_;
    EmissiveArrays& out_;
    std::vector<Emitter>& emitters_;
    std::vector<EmitterBounds>& bounds_;
    std::set<Place> places_;                              // of the triangles that became emitters
    std::map<u32, u32> sides_;                            // by mesh
    std::map<std::pair<u32, u32>, Cluster> clusters_;     // by mesh and first material
};

}  // namespace

void collect_emissive(const SceneView& scene, const std::vector<Color>& estimates, size_t most_triangles,
                      EmissiveArrays* out, std::vector<Emitter>* emitters, std::vector<EmitterBounds>* bounds) {
    Collector(scene, estimates, out, emitters, bounds).collect(most_triangles);
}

}  // namespace luch::cpu
