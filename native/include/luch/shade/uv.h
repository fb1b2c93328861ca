// The active UV map at a shaded point, for the UV pass.
#pragma once
#include "luch/shade/nodes/attribute.h"

namespace luch {

LUCH_FN Vec3 surface_uv(const SceneView& scene, const ShadePoints& points, int lane) {
    const MeshView& mesh = scene.meshes[scene.instances[points.instance[lane]].mesh];
    if (!is_triangle(mesh, points.prim[lane])) return {0.0f, 0.0f, 0.0f};
    const u32 in_place[2] = {0u, 0u};  // no corner of the bump stencil
    const OpContext at = {&scene, nullptr, &points, lane, nullptr, nullptr};
    AttributeValue map = read_attribute(at, scene.uv_attribute, in_place);
    if (map.channels < 2) return {0.0f, 0.0f, 0.0f};
    return {map.value[0], map.value[1], 1.0f};
}

}  // namespace luch
