#include "cpu/integrator/casters.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "cpu/accel/world_box.h"
#include "cpu/light/cdf.h"
#include "cpu/shade/interpreter.h"
#include "luch/integrator/caustics.h"

namespace luch::cpu {
namespace {

// A material is looked at on so many of its triangles, spread over all of them. What none of them shows paths find.
constexpr u32 LOOKS = 64;
// From this far off the normal, cosine: at 60 degrees both what faces the light and what grazes it weighs in.
constexpr float LOOK_COSINE = 0.5f;

struct Look {
    u32 instance, prim;
};

// Of each object one instance, which shows its materials; NONE: it has none that casts.
std::vector<u32> examples_of(const SceneView& scene) {
    std::vector<u32> examples(scene.object_count, NONE);
    for (u32 i = 0; i < scene.instance_count; i++) {
        const InstanceView& at = scene.instances[i];
        if ((at.visibility & CASTER_VISIBILITY) == CASTER_VISIBILITY && examples[at.object] == NONE)
            examples[at.object] = i;
    }
    return examples;
}

// visit(instance, triangle, material) for every triangle of the examples.
template <class Visit>
void for_each_triangle(const SceneView& scene, const std::vector<u32>& examples, const Visit& visit) {
    for (u32 i : examples) {
        if (i == NONE) continue;
        const u32 count = scene.meshes[scene.instances[i].mesh].triangle_count;
        for (u32 prim = 0; prim < count; prim++) visit(i, prim, material_at(scene, i, prim));
    }
}

// Up to LOOKS triangles of each material.
std::vector<std::vector<Look>> places_to_look(const SceneView& scene, const std::vector<u32>& examples) {
    std::vector<std::vector<Look>> looks(scene.material_count);
    std::vector<u64> counts(scene.material_count), seen(scene.material_count);
    for_each_triangle(scene, examples, [&](u32, u32, u32 m) { counts[m]++; });
    for_each_triangle(scene, examples, [&](u32 i, u32 prim, u32 m) {
        const u64 stride = std::max<u64>(1, counts[m] / LOOKS);
        if (seen[m]++ % stride == 0 && looks[m].size() < LOOKS) looks[m].push_back({i, prim});
    });
    return looks;
}

// The share of the light that a material's sharp lobes take, over the places looked at; 0: none has any.
float sharp_share(const SceneView& scene, const MaterialView& material, const std::vector<Look>& looks,
                  ShadePoints& points, std::vector<ClosureSet>& sets, Registers& registers) {
    points.count = int(looks.size());
    for (size_t i = 0; i < looks.size(); i++) {
        const InstanceView& at = scene.instances[looks[i].instance];
        Triangle triangle = triangle_at(scene, at, looks[i].prim, SHUTTER_MIDDLE);
        Vec3 normal = world_face_normal(at, triangle), t, b;
        make_frame(normal, &t, &b);
        LaneInputs in{};
        in.point = triangle_point(triangle, 1.0f / 3.0f, 1.0f / 3.0f, at).p;
        in.to_viewer = normal * LOOK_COSINE + t * std::sqrt(1.0f - LOOK_COSINE * LOOK_COSINE);
        in.instance = looks[i].instance, in.prim = looks[i].prim;
        in.u = in.v = 1.0f / 3.0f;
        in.flags = u32(PATH_DIFFUSE) | PATH_DIFFUSE_ANCESTOR | PATH_REFLECT;
        in.depth = 1u | 1u << 8;
        in.time = SHUTTER_MIDDLE;
        setup_surface_lane(scene, in, points, int(i));
    }
    run_program(scene, material.program, points, sets.data(), registers.data());
    double sum = 0.0;
    for (size_t i = 0; i < looks.size(); i++) {
        const ClosureSet& set = sets[i];
        for (int k = 0; k < set.count; k++)
            if (is_sharp(set.lobes[k])) sum += std::clamp(double(set.lobes[k].sample_weight), 0.0, 1e6);
    }
    return looks.empty() ? 0.0f : float(sum / double(looks.size()));
}

// How much larger areas become, about.
double area_scale(const Affine& m) {
    const Vec3 x = transform_direction(m, {1, 0, 0}), y = transform_direction(m, {0, 1, 0});
    const double volume = std::abs(double(dot(cross(x, y), transform_direction(m, {0, 0, 1}))));
    return std::pow(volume, 2.0 / 3.0);
}

// Diagonal of the box around all triangles, metres.
float size_of(const SceneView& scene) {
    std::vector<Box> boxes(scene.mesh_count, empty_box());
    for (u32 m = 0; m < scene.mesh_count; m++) {
        for (u32 prim = 0; prim < scene.meshes[m].triangle_count; prim++)
            for (const Vec3& corner : triangle_at(scene, scene.meshes[m], prim).p)
                if (finite_v(corner)) extend(boxes[m], corner);
    }
    Box all = empty_box();
    for (u32 i = 0; i < scene.instance_count; i++) {
        const Box& own = boxes[scene.instances[i].mesh];
        if (!(own.lo.x <= own.hi.x)) continue;  // it has none
        const Box box = world_box(scene.instances[i].to_world, own);
        if (finite_v(box.lo) && finite_v(box.hi)) extend(all, box);
    }
    return length(all.hi - all.lo);
}

double area_of(const SceneView& scene, const InstanceView& at, u32 prim) {
    Triangle t = triangle_at(scene, scene.meshes[at.mesh], prim);
    double area = 0.5 * double(length(cross(t.p[1] - t.p[0], t.p[2] - t.p[0])));
    return std::isfinite(area) ? area : 0.0;
}

}  // namespace

void CasterStore::build(const SceneView& scene, MaterialView* materials, size_t registers, ThreadPool& pool) {
    const std::vector<u32> examples = examples_of(scene);
    const std::vector<std::vector<Look>> looks = places_to_look(scene, examples);
    std::vector<float> shares(scene.material_count);
    pool.parallel_for(scene.material_count, 1, [&](size_t begin, size_t end, unsigned) {
        Registers own(registers * SHADE_LANES);
        auto points = std::make_unique<ShadePoints>();
        std::vector<ClosureSet> sets(SHADE_LANES);
        for (size_t m = begin; m < end; m++)
            if (!looks[m].empty()) shares[m] = sharp_share(scene, materials[m], looks[m], *points, sets, own);
    });
    for (u32 m = 0; m < scene.material_count; m++) materials[m].casts_caustics = shares[m] > 0.0f;
    const std::vector<double> object_weights = list_triangles(scene, examples, shares);
    list_instances(scene, object_weights);
    float reach = 2.0f * size_of(scene);
    view_ = {instances_.data(),
             instance_cdf_.data(),
             u32(instances_.size()),
             object_first_.data(),
             prims_.data(),
             prim_cdf_.data(),
             finite_f(reach) && reach > 0.0f ? reach : 1.0f};
}

// Each object's, by area in its own space. Returns the objects' weights.
std::vector<double> CasterStore::list_triangles(const SceneView& scene, const std::vector<u32>& examples,
                                                const std::vector<float>& shares) {
    std::vector<double> object_weights(scene.object_count);
    object_first_.assign(scene.object_count + 1, 0);
    for (u32 object = 0; object < scene.object_count; object++) {
        std::vector<double> weights;
        for_each_triangle(scene, {examples[object]}, [&](u32 i, u32 prim, u32 m) {
            const double weight = double(shares[m]) * area_of(scene, scene.instances[i], prim);
            if (!(weight > 0.0)) return;
            weights.push_back(weight);
            prims_.push_back(prim);
            object_weights[object] += weight;
        });
        const size_t from = prim_cdf_.size();
        prim_cdf_.resize(from + weights.size() + 1);
        fill_cdf(weights, &prim_cdf_[from]);
        object_first_[object + 1] = u32(prims_.size());
    }
    return object_weights;
}

void CasterStore::list_instances(const SceneView& scene, const std::vector<double>& object_weights) {
    std::vector<double> weights;
    for (u32 i = 0; i < scene.instance_count; i++) {
        const InstanceView& at = scene.instances[i];
        if ((at.visibility & CASTER_VISIBILITY) != CASTER_VISIBILITY || !(object_weights[at.object] > 0.0)) continue;
        instances_.push_back(i);
        weights.push_back(object_weights[at.object] * area_scale(at.to_world));
    }
    instance_cdf_.resize(weights.size() + 1);
    fill_cdf(weights, instance_cdf_.data());
}

void CasterStore::describe(DeviceImage& image, u32 block, const CastersView& view) const {
    image.add_array("casters", block, view.instances, instances_.size());
    image.add_array("caster shares", block, view.instance_cdf, instance_cdf_.size());
    image.add_array("casters of objects", block, view.object_first, object_first_.size());
    image.add_array("caster triangles", block, view.prims, prims_.size());
    image.add_array("caster triangle shares", block, view.prim_cdf, prim_cdf_.size());
}

size_t CasterStore::bytes() const {
    return 4 * (instances_.size() + object_first_.size() + prims_.size() + instance_cdf_.size() + prim_cdf_.size());
}

}  // namespace luch::cpu
