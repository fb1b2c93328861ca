// Triangles to a compressed wide tree: mark, box, key; sort (by the caller); leaves, clusters; collapse level by level.
#include "build/clusters.cuh"
#include "build/collapse.cuh"

namespace luch {

__device__ __forceinline__ u32 build_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

// Every third bit: x's 21 lowest.
__device__ __forceinline__ u64 spread_bits(u64 x) {
    x = (x | x << 32) & 0x1f00000000ffffull;
    x = (x | x << 16) & 0x1f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
}

__device__ __forceinline__ u64 cell_of(const BuildTask& task, float lo, float hi, int axis) {
    float x = ((lo * 0.5f + hi * 0.5f) - task.lo[axis]) * task.scale;
    return u64(clamp_f(x, 0.0f, 2097151.0f));  // NaN: 0
}

}  // namespace luch

LUCH_BUILD_KERNEL(mark_usable)(const luch::BuildTask task) {
    luch::u32 i = luch::build_index();
    if (i >= task.count) return;
    const float* p = task.corners + 9 * luch::u64(i);
    task.usable[i] = luch::triangle_can_be_traced(luch::vec3_of(p), luch::vec3_of(p + 3), luch::vec3_of(p + 6));
}

LUCH_BUILD_KERNEL(make_boxes)(const luch::BuildTask task) {
    luch::u32 i = luch::build_index();
    if (i >= task.count) return;
    const float* p = task.corners + 9 * luch::u64(task.refs[i]);
    luch::Box box = luch::triangle_box(luch::vec3_of(p), luch::vec3_of(p + 3), luch::vec3_of(p + 6));
    for (int axis = 0; axis < 3; ++axis) {
        task.boxes[6 * luch::u64(i) + axis] = box.lo[axis];
        task.boxes[6 * luch::u64(i) + 3 + axis] = box.hi[axis];
    }
}

LUCH_BUILD_KERNEL(make_keys)(const luch::BuildTask task) {
    luch::u32 i = luch::build_index();
    if (i >= task.count) return;
    const float* box = task.boxes + 6 * luch::u64(i);
    luch::u64 key = 0;
    for (int axis = 0; axis < 3; ++axis)
        key |= luch::spread_bits(luch::cell_of(task, box[axis], box[3 + axis], axis)) << axis;
    task.keys[i] = key;
}

LUCH_BUILD_KERNEL(make_leaves)(const luch::BuildTask task) {
    luch::u32 i = luch::build_index();
    if (i >= task.count) return;
    const float* box = task.boxes + 6 * luch::u64(i);
    task.nodes[i] = {{box[0], box[1], box[2]}, task.refs[i], {box[3], box[4], box[5]}, luch::NONE};
    task.sizes[i] = 1;
    task.clusters[i] = i;
    task.arrived[i] = luch::NONE;
}

LUCH_BUILD_KERNEL(merge)(const luch::BuildTask task) { luch::merge_clusters(task); }

LUCH_BUILD_KERNEL(collapse)(const luch::BuildTask task) { luch::collapse(task); }
