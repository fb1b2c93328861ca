// Triangles that cast caustics: where photons start.
#pragma once
#include <vector>

#include "cpu/device_image.h"
#include "cpu/thread_pool.h"
#include "luch/integrator/render_view.h"

namespace luch::cpu {

class CasterStore {
 public:
    // Looks which materials have sharp lobes, tells them so in `materials` (those behind scene.materials), and lists
    // their triangles. registers: of the largest program.
    void build(const SceneView& scene, MaterialView* materials, size_t registers, ThreadPool& pool);
    const CastersView& view() const { return view_; }
    // Of `view`, a copy of view() inside the image's block `block`.
    void describe(DeviceImage& image, u32 block, const CastersView& view) const;
    size_t bytes() const;

 private:
    std::vector<double> list_triangles(const SceneView& scene, const std::vector<u32>& examples,
                                       const std::vector<float>& shares);
    void list_instances(const SceneView& scene, const std::vector<double>& object_weights);

    std::vector<u32> instances_, object_first_, prims_;
    std::vector<float> instance_cdf_, prim_cdf_;
    CastersView view_{};
};

}  // namespace luch::cpu
