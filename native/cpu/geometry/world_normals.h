// Normals of meshes that are drawn once, under an uneven scale.
#pragma once
#include <vector>

#include "luch/shade/scene_view.h"

namespace luch::cpu {

// Between corners, normals may be blended in the object's space or in the world's: under an uneven scale that differs.
// As in Cycles it is the world's for a mesh with one instance. Its normals are replaced by vectors, not unit, that give
// unit normals in the world; the instance is marked INSTANCE_WORLD_NORMALS.
void blend_normals_in_world(const std::vector<MeshView>& meshes, std::vector<InstanceView>& instances,
                            std::vector<float>& normals);

}  // namespace luch::cpu
