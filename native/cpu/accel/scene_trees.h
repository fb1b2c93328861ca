// The scene as rays of a device see it (luch/accel/two_level.h): built here, walked here too, uploaded as an image.
// The same hits as cpu/accel/accel.h gives, bit for bit.
#pragma once
#include <memory>
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/device_image.h"

namespace luch::cpu {

struct SceneTreesStats : AccelStats {
    u64 groups = 0, entries = 0;
    u32 depth = 0;  // levels of nodes, top and deepest group together
};

class SceneTrees {
 public:
    // As Accel::build; the eight-wide tree of the CPU (choice.wide) is replaced by the compressed one. Throws Cancelled
    // when the pool is told to give up.
    static std::unique_ptr<SceneTrees> build(const SceneView& scene, const std::vector<std::vector<u8>>& flags,
                                             ThreadPool& pool, const AccelChoice& choice = {},
                                             u64 flatten_triangles = FLATTEN_TRIANGLES);
    virtual ~SceneTrees() = default;

    // A group of many triangles whose tree a device builds itself (AccelChoice::leave_from).
    struct LeftGroup {
        const float* corners;  // nine floats a ref; zeros: not to be traced
        size_t refs;
        const u8* flags;  // PrimitiveFlag by ref; null: none
        // Blocks of append's, counted from the view's, and where in them the structure's view belongs.
        std::vector<std::pair<u32, size_t>> places;
    };
    virtual std::vector<LeftGroup> left_groups() const = 0;

    // Adds the view and everything behind it; returns the view's block: TwoLevelView<the structure>.
    // The image borrows from this object.
    virtual u32 append(DeviceImage& image) const = 0;
    // All is one group in the world: kernels made for that (render/trace_one.cuh) may walk it.
    virtual bool is_one_group() const = 0;
    // One group in the world that rays look for first, beside it (unless it is all) what moves.
    virtual bool has_world_apart() const = 0;
    // Something in them moves: kernels must be compiled for it (plan::MOTION).
    virtual bool moves() const = 0;
    virtual StructureKind kind() const = 0;

    // As Accel's, by the functions that devices run. Groups that are left for the device are not there.
    virtual void closest(const Ray* rays, const u32* ray_kinds, Hit* hits, size_t count,
                         const float* times = nullptr) const = 0;
    virtual void any(const Ray* rays, const u32* ray_kinds, u8* blocked, size_t count,
                     const float* times = nullptr) const = 0;

    virtual SceneTreesStats stats() const = 0;
};

}  // namespace luch::cpu
