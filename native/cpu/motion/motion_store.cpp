#include "cpu/motion/motion_store.h"

#include <algorithm>

#include "cpu/curve_store.h"

namespace luch::cpu {
namespace {

template <size_t N>
bool same(const float (&a)[N], const float (&b)[N]) {
    return std::equal(a, a + N, b);
}

// Of keys that differ in their place alone.
Slide slide_of(const std::vector<TransformKey>& keys) {
    const Affine to_world = transform_between(keys[0], keys[1], 0.0f);
    Slide slide{};
    invert_linear(to_world, slide.inverse);
    for (int row = 0; row < 3; ++row) std::copy_n(to_world.m + 4 * row, 3, slide.linear + 3 * row);
    return slide;
}

}  // namespace

void MotionStore::add_mesh(u32 mesh, u32 vertex_count, u32 normal_rows, u32 key_count, const float* positions,
                           const float* normals) {
    if (meshes_.size() <= mesh) meshes_.resize(mesh + 1);
    MeshMotion& motion = meshes_[mesh];
    motion.first_position = u32(positions_.size() / 3);
    motion.first_normal = u32(normals_.size() / 3);
    motion.key_count = key_count;
    positions_.insert(positions_.end(), positions, positions + size_t(key_count) * vertex_count * 3);
    if (normals) normals_.insert(normals_.end(), normals, normals + size_t(key_count) * normal_rows * 3);
}

void MotionStore::add_curves(u32 mesh, u32 point_count, u32 key_count, const float* points) {
    if (meshes_.size() <= mesh) meshes_.resize(mesh + 1);
    MeshMotion& motion = meshes_[mesh];
    motion.first_curve_point = u32(curve_points_.size() / 4);
    motion.curve_point_count = point_count;
    motion.curve_key_count = key_count;
    add_curve_points(curve_points_, points, size_t(key_count) * point_count);
}

bool MotionStore::add_instance(u32 instance, const std::vector<Matrix>& matrices) {
    bool moves = std::any_of(matrices.begin(), matrices.end(), [&](const Matrix& m) { return m != matrices.front(); });
    std::vector<TransformKey> keys;
    if (moves) keys = make_keys(matrices);
    if (keys.size() < 2) return false;
    if (instances_.size() <= instance) instances_.resize(instance + 1);
    const bool slides = std::all_of(keys.begin(), keys.end(), [&](const TransformKey& key) {
        return same(key.rotation, keys[0].rotation) && same(key.stretch, keys[0].stretch);
    });
    if (slides) slides_.push_back(slide_of(keys));
    instances_[instance] = {u32(keys_.size()), u32(keys.size()), slides ? u32(slides_.size()) : 0u};
    keys_.insert(keys_.end(), keys.begin(), keys.end());
    return true;
}

const MotionView* MotionStore::finish(size_t mesh_count, std::vector<InstanceView>& instances) {
    if (instances_.empty() && meshes_.empty()) return nullptr;
    instances_.resize(instances.size());
    meshes_.resize(mesh_count);
    for (size_t i = 0; i < instances.size(); ++i) {
        if (instances_[i].key_count) instances[i].flags |= INSTANCE_MOVES;
        if (meshes_[instances[i].mesh].key_count) instances[i].flags |= INSTANCE_DEFORMS;
        if (meshes_[instances[i].mesh].curve_key_count) instances[i].flags |= INSTANCE_HAIR_DEFORMS;
    }
    view_ = {instances_.data(), keys_.data(),    slides_.data(),      meshes_.data(),
             positions_.data(), normals_.data(), curve_points_.data()};
    return &view_;
}

void MotionStore::describe(DeviceImage& image, u32 block, const SceneView& view) const {
    if (!view.motion) return;
    u32 motion = image.add_array("motion", block, view.motion, 1);
    image.add_array("moving instances", motion, view_.instances, instances_.size());
    image.add_array("motion keys", motion, view_.keys, keys_.size());
    image.add_array("slides", motion, view_.slides, slides_.size());
    image.add_array("moving meshes", motion, view_.meshes, meshes_.size());
    image.add_array("moving positions", motion, view_.positions, positions_.size());
    image.add_array("moving normals", motion, view_.normals, normals_.size());
    image.add_array("moving curve points", motion, view_.curve_points, curve_points_.size());
}

size_t MotionStore::bytes() const {
    return instances_.size() * sizeof(InstanceMotion) + keys_.size() * sizeof(TransformKey) +
           slides_.size() * sizeof(Slide) + meshes_.size() * sizeof(MeshMotion) +
           (positions_.size() + normals_.size() + curve_points_.size()) * sizeof(float);
}

}  // namespace luch::cpu
