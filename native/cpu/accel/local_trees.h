// Trees of single meshes, for rays that see one instance alone: what walks under the surface trace. Apart from the
// scene's own trees, which may hold many meshes together; only instances that ask for one have one.
#pragma once
#include <memory>
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/accel/group.h"

namespace luch::cpu {

class LocalTrees {
 public:
    // wanted: per instance. precision as the scene's. The triangles of the mesh alone, not its spheres.
    LocalTrees(const SceneView& scene, const std::vector<u8>& wanted, Precision precision, ThreadPool& pool);

    // The nearest hit in the instance, as Accel::closest gives it; t of a miss is infinite.
    Hit closest(u32 instance, const Ray& ray) const;

    u64 bytes() const { return bytes_; }

 private:
    struct Entry {
        Affine to_object;
        u32 group;  // NONE: nothing to hit
    };
    std::vector<Group> groups_;
    std::vector<Entry> entries_;  // per instance
    u64 bytes_ = 0;
};

}  // namespace luch::cpu
