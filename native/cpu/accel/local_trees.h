// Trees of single meshes, for rays that see one instance alone: what walks under the surface trace. Apart from the
// scene's own trees, which may hold many meshes together; only instances that ask for one have one.
#pragma once
#include <memory>
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/accel/build_moving.h"
#include "cpu/accel/group.h"
#include "cpu/device_image.h"
#include "luch/accel/local_trees.h"

namespace luch::cpu {

class LocalTrees {
 public:
    // wanted: per instance. precision as the scene's. The triangles of the mesh alone, not its spheres.
    // for_device: compressed wide trees, to be uploaded. Throws std::length_error where one is too deep for devices.
    LocalTrees(const SceneView& scene, const std::vector<u8>& wanted, Precision precision, bool for_device,
               ThreadPool& pool);

    // The nearest hit in the instance as it is at that time, as Accel::closest gives it; t of a miss is infinite. Not of
    // trees for a device.
    Hit closest(u32 instance, const Ray& ray, float time = SHUTTER_MIDDLE) const;

    // The view of trees for a device, and everything behind it as the image's; `block` holds the pointer to it.
    const LocalTreesView* view() const { return &view_; }
    void describe(DeviceImage& image, u32 block, const LocalTreesView* const& pointer) const;

    u64 bytes() const { return bytes_; }

 private:
    void keep_views();

    std::vector<Group> groups_;
    std::vector<LocalTreeEntry> entries_;  // per instance
    std::vector<Cwbvh> trees_;             // of groups, for a device
    SceneMotion motion_;
    LocalTreesView view_ = {};
    u64 bytes_ = 0;
};

}  // namespace luch::cpu
