#include "cpu/accel/choice.h"
#include "cpu/seconds.h"

#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "luch/sampling/hash.h"

namespace luch::cpu {
namespace {

struct Name {
    const char* name;
    bool wide;
    StructureKind kind;
};
constexpr Name NAMES[] = {
    {"BVH", true, StructureKind::BRUTE_FORCE},
    {"BVH2", false, StructureKind::BVH2},
    {"BVH2_STACKLESS", false, StructureKind::BVH2_STACKLESS},
    {"KD_TREE", false, StructureKind::KD_TREE},
    {"HIERARCHICAL_GRID", false, StructureKind::HIERARCHICAL_GRID},
    {"GRID", false, StructureKind::GRID},
    {"CWBVH", false, StructureKind::CWBVH},
    {"BRUTE_FORCE", false, StructureKind::BRUTE_FORCE},
};
constexpr const char* PRECISIONS[] = {"FAST", "WATERTIGHT", "DOUBLE"};

// AUTO tries the eight-wide tree's challengers where they may win and the trial is cheap: brute force in the smallest
// scenes, the kd-tree where building it takes little beside the rays that the render is expected to trace. What is
// small is built in milliseconds and always tried.
constexpr u64 TRY_BRUTE_FORCE_BELOW = 64;    // primitives
constexpr u64 TRY_KD_TREE_BELOW = 20'000;
constexpr double KD_BUILD_US = 2.6;          // a primitive and thread (docs/rays.md)
constexpr double TRIAL_SHARE = 0.01;         // of the expected tracing, for the trial
constexpr u32 TRIAL_RAYS = 2048;
// A challenger must win by this much: trials scatter by a few percent.
constexpr double CLEAR_WIN = 1.1;

Vec3 point_on_scene(const SceneView& scene, u32 number) {
    const InstanceView& instance = scene.instances[hash_u32(number, 0) % scene.instance_count];
    const MeshView& mesh = scene.meshes[instance.mesh];
    if (primitive_count(scene, mesh) == 0) return make_vec3(0.0f);
    u32 prim = hash_u32(number, 1) % primitive_count(scene, mesh);
    if (is_curve(mesh, prim)) {
        Capsule c = piece_capsule(curves_of(scene, mesh), prim - first_piece(mesh));
        return transform_point(instance.to_world, c.a);
    }
    if (is_sphere(mesh, prim)) {
        const float* s = sphere_at(scene, mesh, prim);
        float up = 2.0f * unit_float(hash_u32(number, 2)) - 1.0f;
        Vec3 side = {sqrt_f(1.0f - up * up), 0.0f, up};
        return transform_point(instance.to_world, vec3_of(s) + side * s[3]);
    }
    size_t triangle = mesh.first_triangle + prim;
    float share = 0.5f * unit_float(hash_u32(number, 2));
    const float weight[3] = {share, 0.5f - share, 0.5f};
    Vec3 sum = make_vec3(0.0f);
    for (size_t k = 0; k < 3; ++k) {
        u32 index = scene.triangles[3 * triangle + k];
        if (index >= mesh.vertex_count) return make_vec3(0.0f);
        sum += weight[k] * vec3_of(scene.positions + 3 * (size_t(mesh.first_vertex) + index));
    }
    return transform_point(instance.to_world, sum);
}

// From a point on the scene towards another one, and on: as light bounces about in it.
std::vector<Ray> trial_rays(const SceneView& scene) {
    std::vector<Ray> rays;
    for (u32 i = 0; i < TRIAL_RAYS; ++i) {
        Vec3 from = point_on_scene(scene, 2 * i), to = point_on_scene(scene, 2 * i + 1);
        rays.push_back({from, 1e-4f, to - from, INFINITE_DISTANCE});
    }
    return rays;
}

// Millions of rays a second and thread, closest hits.
double measure(const Accel& accel, const std::vector<Ray>& rays) {
    std::vector<Hit> hits(rays.size());
    double best = INFINITE_DISTANCE;
    for (int round = 0; round < 3; ++round) {  // the first warms the caches
        double start = seconds_now();
        accel.closest(rays.data(), nullptr, hits.data(), rays.size());
        best = std::min(best, seconds_now() - start);
    }
    return double(rays.size()) / std::max(best, 1e-9) * 1e-6;
}

// Counted as often as instances let them stand.
u64 standing_primitives(const SceneView& scene) {
    u64 count = 0;
    for (u32 i = 0; i < scene.instance_count; ++i)
        count += primitive_count(scene, scene.meshes[scene.instances[i].mesh]);
    return count;
}

u64 distinct_primitives(const SceneView& scene) {
    u64 count = 0;
    for (u32 m = 0; m < scene.mesh_count; ++m) count += primitive_count(scene, scene.meshes[m]);
    return count;
}

std::string number(const char* format, double value) {
    char text[64];
    std::snprintf(text, sizeof(text), format, value);
    return text;
}

// The structures that have raced so far: who leads, and what is said of the others.
struct Race {
    const SceneView& scene;
    const std::vector<std::vector<u8>>& flags;
    ThreadPool& pool;
    ChosenAccel& leader;
    std::vector<Ray> rays;
    double rate;  // the leader's, Mrays/s and thread
    std::string others;

    void lost(const AccelChoice& choice, double its_rate) {
        others += (others.empty() ? " " : ", ") + accel_name(choice) + number(" %.2f", its_rate);
    }

    void challenge(StructureKind kind) {
        AccelChoice choice = leader.choice;
        choice.wide = false;
        choice.kind = kind;
        std::unique_ptr<Accel> accel = Accel::build(scene, flags, pool, choice);
        double its_rate = measure(*accel, rays);
        if (its_rate <= CLEAR_WIN * rate) return lost(choice, its_rate);
        lost(leader.choice, rate);
        leader.accel = std::move(accel);
        leader.choice = choice;
        rate = its_rate;
    }

    std::string sentence() const {
        return accel_name(leader.choice) + number(": %.2f million trial rays a second and thread", rate) +
               (others.empty() ? "" : ", against" + others);
    }
};

}  // namespace

AccelRequest accel_request(const std::string& name, const std::string& precision) {
    AccelRequest request;
    auto found = std::find(std::begin(PRECISIONS), std::end(PRECISIONS), precision);
    if (found == std::end(PRECISIONS))
        throw std::invalid_argument("Precision \"" + precision + "\" is not known; take FAST, WATERTIGHT or DOUBLE.");
    request.choice.precision = Precision(found - std::begin(PRECISIONS));
    if (name == "AUTO") return request;
    request.automatic = false;
    std::string known = "AUTO";
    for (const Name& n : NAMES) {
        if (name == n.name) {
            request.choice.wide = n.wide;
            request.choice.kind = n.kind;
            return request;
        }
        known += std::string(", ") + n.name;
    }
    throw std::invalid_argument("Structure \"" + name + "\" is not known; take one of " + known + ".");
}

std::string accel_name(const AccelChoice& choice) {
    for (const Name& n : NAMES)
        if (n.wide == choice.wide && (n.wide || n.kind == choice.kind)) return n.name;
    return "BVH";
}

ChosenAccel build_chosen(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                         const AccelRequest& request) {
    ChosenAccel chosen;
    chosen.choice = request.choice;
    chosen.accel = Accel::build(scene, flags, pool, request.choice);
    u64 standing = standing_primitives(scene), distinct = distinct_primitives(scene);
    chosen.reason = request.automatic ? "nothing to hit" : "chosen by the user";
    if (!request.automatic || standing == 0) return chosen;
    std::vector<Ray> rays = trial_rays(scene);
    double rate = measure(*chosen.accel, rays);
    Race race{scene, flags, pool, chosen, std::move(rays), rate, {}};
    if (standing < TRY_BRUTE_FORCE_BELOW) race.challenge(StructureKind::BRUTE_FORCE);
    double build_s = 1e-6 * KD_BUILD_US * double(distinct);
    double thread_s = 1e-6 * request.expected_rays / rate;  // as build_s: of one thread, shared alike by several
    double trace_s = std::min(thread_s, request.time_limit_s * pool.size());
    bool pays = build_s <= TRIAL_SHARE * trace_s;
    if (standing < TRY_KD_TREE_BELOW || pays) race.challenge(StructureKind::KD_TREE);
    chosen.reason = race.sentence();
    if (standing >= TRY_KD_TREE_BELOW && !pays) {
        chosen.reason += "; KD_TREE untried: building it takes" + number(" %.2g s a thread", build_s) +
                         number(", tracing about %.2g", trace_s);
    }
    return chosen;
}

}  // namespace luch::cpu
