#include "cpu/curve_store.h"

#include <stdexcept>

namespace luch::cpu {
namespace {

constexpr size_t MOST_POINTS = size_t(1) << 30;  // of a mesh: a segment's word holds its first one in 30 bits

void check(const std::string& name, const CurveInput& in) {
    auto refuse = [&](const std::string& fact) {
        throw std::invalid_argument("Mesh \"" + name + "\": " + fact + ". Export the mesh again.");
    };
    if (in.point_count >= MOST_POINTS) refuse("its curves have more than a billion points");
    if (in.curve_count == 0 ? in.point_count != 0 : in.first[0] != 0) refuse("its curves leave points out");
    for (size_t c = 0; c < in.curve_count; ++c) {
        size_t end = c + 1 < in.curve_count ? in.first[c + 1] : in.point_count;
        if (in.first[c] > end || end > in.point_count) refuse("curve " + std::to_string(c) + " ends before it begins");
    }
}

}  // namespace

void add_curve_points(std::vector<float>& to, const float* points, size_t count) {
    size_t first = to.size();
    to.insert(to.end(), points, points + 4 * count);
    for (size_t i = first + 3; i < to.size(); i += 4)
        if (to[i] < 0.0f) to[i] = 0.0f;  // what is not finite stays: builders leave it out
}

void CurveStore::add(const std::string& mesh_name, const CurveInput& in, MeshView& mesh) {
    check(mesh_name, in);
    mesh.first_curve_point = u32(points_.size() / 4);
    mesh.first_segment = u32(segments_.size());
    mesh.first_curve = u32(slots_.size());
    mesh.curve_count = u32(in.curve_count);
    add_curve_points(points_, in.points, in.point_count);
    slots_.insert(slots_.end(), in.slots, in.slots + in.curve_count);
    for (u32 c = 0; c < in.curve_count; ++c) {
        u32 first = in.first[c], end = c + 1 < in.curve_count ? in.first[c + 1] : u32(in.point_count);
        for (u32 k = first; k + 1 < end; ++k) {
            u32 flags = (k > first ? u32(SEGMENT_HAS_BEFORE) : 0u) | (k + 2 < end ? u32(SEGMENT_HAS_AFTER) : 0u);
            segments_.push_back(k << 2 | flags);
            segment_curves_.push_back(c);
        }
    }
    mesh.segment_count = u32(segments_.size()) - mesh.first_segment;
}

void CurveStore::point(SceneView& view) const {
    view.curve_points = points_.data();
    view.curve_segments = segments_.data();
    view.segment_curves = segment_curves_.data();
    view.curve_slots = slots_.data();
}

void CurveStore::describe(DeviceImage& image, u32 block, const SceneView& view) const {
    if (segments_.empty()) return;  // nobody reads the pointers
    image.add_array("curve_points", block, view.curve_points, points_.size());
    image.add_array("curve_segments", block, view.curve_segments, segments_.size());
    image.add_array("segment_curves", block, view.segment_curves, segment_curves_.size());
    image.add_array("curve_slots", block, view.curve_slots, slots_.size());
}

}  // namespace luch::cpu
