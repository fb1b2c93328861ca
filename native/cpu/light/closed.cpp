// Is a mesh a closed surface? Then one of its sides is hidden from everywhere outside.
#include <algorithm>
#include <vector>

#include "cpu/light/build.h"
#include "luch/light/triangle.h"

namespace luch::cpu {
namespace {

u64 edge_key(u32 from, u32 to) { return static_cast<u64>(from) << 32 | to; }

// Every directed edge once, and its opposite once.
bool is_closed(const u32* triangles, u32 count) {
    std::vector<u64> there, back;
    there.reserve(static_cast<size_t>(count) * 3);
    back.reserve(static_cast<size_t>(count) * 3);
    for (u32 t = 0; t < count; ++t) {
        for (u32 i = 0; i < 3; ++i) {
            u32 from = triangles[3 * static_cast<size_t>(t) + i],
                to = triangles[3 * static_cast<size_t>(t) + (i + 1) % 3];
            if (from == to) return false;
            there.push_back(edge_key(from, to));
            back.push_back(edge_key(to, from));
        }
    }
    std::sort(there.begin(), there.end());
    std::sort(back.begin(), back.end());
    return there == back && std::adjacent_find(there.begin(), there.end()) == there.end();
}

double six_volumes(const SceneView& scene, const MeshView& mesh, const u32* triangles) {
    Vec3 origin = vertex_at(scene, mesh, triangles[0]);
    double sum = 0.0;
    for (u32 t = 0; t < mesh.triangle_count; ++t) {
        const u32* index = triangles + 3 * static_cast<size_t>(t);
        Vec3 a = vertex_at(scene, mesh, index[0]) - origin;
        Vec3 b = vertex_at(scene, mesh, index[1]) - origin;
        Vec3 c = vertex_at(scene, mesh, index[2]) - origin;
        sum += dot(a, cross(b, c));
    }
    return sum;
}

}  // namespace

u8 outer_sides(const SceneView& scene, const MeshView& mesh) {
    const u32* triangles = scene.triangles + static_cast<size_t>(mesh.first_triangle) * 3;
    if (mesh.triangle_count < 4 || !is_closed(triangles, mesh.triangle_count)) return 3;
    double volume = six_volumes(scene, mesh, triangles);
    return volume > 0.0 ? 1 : (volume < 0.0 ? 2 : 3);
}

}  // namespace luch::cpu
