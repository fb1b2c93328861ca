#include "cpu/accel/choice.h"

#include <algorithm>
#include <chrono>
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

// AUTO tries a structure only where building it is cheap beside any render: the wide tree won every race over larger
// scenes (docs/rays.md), so there the attempt would cost more than it could bring.
constexpr u64 TRY_BRUTE_FORCE_BELOW = 64;    // primitives
constexpr u64 TRY_KD_TREE_BELOW = 20'000;
constexpr const char* UNTRIED =
    "BVH without a trial on this scene: from 20000 primitives on it won every race (docs/rays.md)";
constexpr u32 TRIAL_RAYS = 2048;
// A challenger must win by this much: trials scatter by a few percent.
constexpr double CLEAR_WIN = 1.1;

double seconds_now() {
    using namespace std::chrono;
    return duration<double>(steady_clock::now().time_since_epoch()).count();
}

Vec3 point_on_scene(const SceneView& scene, u32 number) {
    const InstanceView& instance = scene.instances[hash_u32(number, 0) % scene.instance_count];
    const MeshView& mesh = scene.meshes[instance.mesh];
    if (primitive_count(mesh) == 0) return make_vec3(0.0f);
    u32 prim = hash_u32(number, 1) % primitive_count(mesh);
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

u64 primitives_of(const SceneView& scene) {
    u64 count = 0;
    for (u32 i = 0; i < scene.instance_count; ++i) count += primitive_count(scene.meshes[scene.instances[i].mesh]);
    return count;
}

std::string sentence(const std::string& won, double rate, const std::string& others) {
    char text[96];
    std::snprintf(text, sizeof(text), "%s: %.2f million trial rays a second and thread", won.c_str(), rate);
    return text + (others.empty() ? std::string() : ", against" + others);
}

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
    if (!request.automatic) {
        chosen.reason = "chosen by the user";
        return chosen;
    }
    u64 primitives = primitives_of(scene);
    std::vector<StructureKind> challengers;
    if (primitives < TRY_BRUTE_FORCE_BELOW) challengers.push_back(StructureKind::BRUTE_FORCE);
    if (primitives < TRY_KD_TREE_BELOW) challengers.push_back(StructureKind::KD_TREE);
    if (challengers.empty() || primitives == 0) {
        chosen.reason = primitives ? UNTRIED : "nothing to hit";
        return chosen;
    }
    std::vector<Ray> rays = trial_rays(scene);
    double best = measure(*chosen.accel, rays);
    std::string others;
    auto lost = [&](const AccelChoice& choice, double rate) {
        char text[64];
        std::snprintf(text, sizeof(text), "%s %s %.2f", others.empty() ? "" : ",", accel_name(choice).c_str(), rate);
        others += text;
    };
    for (StructureKind kind : challengers) {
        AccelChoice choice = request.choice;
        choice.wide = false;
        choice.kind = kind;
        std::unique_ptr<Accel> accel = Accel::build(scene, flags, pool, choice);
        double rate = measure(*accel, rays);
        if (rate > CLEAR_WIN * best) {
            lost(chosen.choice, best);
            chosen.accel = std::move(accel);
            chosen.choice = choice;
            best = rate;
        } else {
            lost(choice, rate);
        }
    }
    chosen.reason = sentence(accel_name(chosen.choice), best, others);
    return chosen;
}

}  // namespace luch::cpu
