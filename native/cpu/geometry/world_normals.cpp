#include "cpu/geometry/world_normals.h"

#include <cmath>

#include "luch/math/bounds.h"
#include "luch/math/fn.h"

namespace luch::cpu {
namespace {

bool is_uneven(const Affine& a) {
    Vec3 columns[3];
    for (int i = 0; i < 3; i++) columns[i] = {a.m[i], a.m[4 + i], a.m[8 + i]};
    float size = length_squared(columns[0]);
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        if (std::abs(length_squared(columns[i]) - size) > EVEN_SCALE * size) return true;
        if (std::abs(dot(columns[i], columns[j])) > EVEN_SCALE * size) return true;
    }
    return false;
}

}  // namespace

void blend_normals_in_world(const std::vector<MeshView>& meshes, std::vector<InstanceView>& instances,
                            std::vector<float>& normals) {
    std::vector<u32> users(meshes.size(), 0u);
    for (const InstanceView& instance : instances) users[instance.mesh]++;
    for (InstanceView& instance : instances) {
        const MeshView& mesh = meshes[instance.mesh];
        if (instance.flags & (INSTANCE_MOVES | INSTANCE_DEFORMS)) continue;  // as in Cycles, which leaves them apart
        if (mesh.normals_domain == Domain::NONE_ || users[instance.mesh] != 1u || !is_uneven(instance.to_world))
            continue;
        size_t rows = mesh.normals_domain == Domain::POINT ? mesh.vertex_count : size_t(mesh.triangle_count) * 3;
        float* row = normals.data() + size_t(mesh.first_normal) * 3;
        for (size_t i = 0; i < rows; i++, row += 3) {
            Vec3 n = {row[0], row[1], row[2]};
            Vec3 world = normalize_or(transform_direction_transposed(instance.to_object, n), make_vec3(0.0f));
            Vec3 kept = transform_direction_transposed(instance.to_world, world);
            row[0] = kept.x, row[1] = kept.y, row[2] = kept.z;
        }
        instance.flags |= INSTANCE_WORLD_NORMALS;
    }
}

}  // namespace luch::cpu
