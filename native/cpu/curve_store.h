// The arrays behind all curves of a SceneView, mesh after mesh.
#pragma once
#include <string>
#include <vector>

#include "cpu/device_image.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

struct CurveInput {
    const float* points = nullptr;  // place and radius, four each
    size_t point_count = 0;
    const u32* first = nullptr;     // of each curve its first point, ascending; it ends where the next begins
    const u16* slots = nullptr;     // of each curve
    size_t curve_count = 0;
    u32 motion_keys = 0;  // 0: they keep their shape
    const float* motion_points = nullptr;  // as points, key by key
};

// Appends points; a radius below 0 is none.
void add_curve_points(std::vector<float>& to, const float* points, size_t count);

class CurveStore {
 public:
    // Tells the mesh where its curves are. Throws std::invalid_argument, naming it, for what does not fit together.
    void add(const std::string& mesh_name, const CurveInput& input, MeshView& mesh);
    void point(SceneView& view) const;
    void describe(DeviceImage& image, u32 block, const SceneView& view) const;
    u16 slot_of_segment(const MeshView& mesh, u32 segment) const {
        return slots_[mesh.first_curve + segment_curves_[mesh.first_segment + segment]];
    }
    size_t bytes() const {
        return 4 * (points_.size() + segments_.size() + segment_curves_.size()) + 2 * slots_.size();
    }

 private:
    std::vector<float> points_;
    std::vector<u32> segments_, segment_curves_;
    std::vector<u16> slots_;
};

}  // namespace luch::cpu
