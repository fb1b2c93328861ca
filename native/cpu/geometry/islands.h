// Connected parts of a mesh, for Geometry > Random Per Island.
#pragma once
#include <cstddef>
#include <vector>

#include "luch/platform.h"

namespace luch::cpu {

// One number in 0..1 per triangle, the same for all that edges connect. edges: pairs of vertices, in
// the mesh's own order, which decides the number, as in Cycles. Vertices must be below vertex_count.
std::vector<float> island_random(size_t vertex_count, const u32* edges, size_t edge_count, const u32* triangles,
                                 size_t triangle_count);

}  // namespace luch::cpu
