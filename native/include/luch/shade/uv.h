// The active UV map at a shaded point, for the UV pass.
#pragma once
#include "luch/shade/surface_setup.h"

namespace luch {

LUCH_FN Vec3 surface_uv(const SceneView& scene, const ShadePoints& points, int lane) {
    const MeshView& mesh = scene.meshes[scene.instances[points.instance[lane]].mesh];
    const AttributeView& map = scene.attributes[mesh.first_attribute + scene.uv_attribute];
    u32 prim = points.prim[lane];
    if (map.channels < 2 || !is_triangle(mesh, prim)) return {0.0f, 0.0f, 0.0f};
    u32 row[3] = {prim * 3, prim * 3 + 1, prim * 3 + 2};
    if (map.domain == Domain::POINT) {
        const u32* t = corners_of(scene, mesh, prim);
        for (int i = 0; i < 3; i++) row[i] = t[i];
    }
    const float weight[3] = {1.0f - points.u[lane] - points.v[lane], points.u[lane], points.v[lane]};
    Vec3 uv = {0.0f, 0.0f, 1.0f};
    for (int i = 0; i < 3; i++) {
        const float* value = scene.attribute_data + map.offset + u64(row[i]) * map.channels;
        uv.x += value[0] * weight[i];
        uv.y += value[1] * weight[i];
    }
    return uv;
}

}  // namespace luch
