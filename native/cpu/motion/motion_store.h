// Owns the arrays behind a MotionView. Holds nothing, and gives no view, where nothing moves.
#pragma once
#include <vector>

#include "cpu/device_image.h"
#include "cpu/motion/keys.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

class MotionStore {
 public:
    // positions: 3 floats a vertex, normals: 3 a row, key by key; normals null where the mesh is flat.
    void add_mesh(u32 mesh, u32 vertex_count, u32 normal_rows, u32 key_count, const float* positions,
                  const float* normals);
    // points: place and radius, key by key.
    void add_curves(u32 mesh, u32 point_count, u32 key_count, const float* points);
    // False where the keys say nothing: not finite, flat, or all alike.
    bool add_instance(u32 instance, const std::vector<Matrix>& matrices);

    // Marks what moves; call after the last add_. Null: nothing does.
    const MotionView* finish(size_t mesh_count, std::vector<InstanceView>& instances);
    void describe(DeviceImage& image, u32 block, const SceneView& view) const;
    size_t bytes() const;

 private:
    MotionView view_{};
    std::vector<InstanceMotion> instances_;
    std::vector<TransformKey> keys_;
    std::vector<Slide> slides_;
    std::vector<MeshMotion> meshes_;
    std::vector<float> positions_, normals_, curve_points_;
};

}  // namespace luch::cpu
