// Long thin triangles askew to the axes: their boxes are all but empty, and where they lie side by side no tree of boxes
// can part them, so that each ray tests them by the thousand. They are cut before a tree is built: k pieces of a sliver
// lie in boxes of a k-th of its box's area together, for k places in the tree ("early split clipping", Ernst, Greiner
// 2007). Meshes of which a ray meets few boxes are left as they are.
#pragma once
#include "cpu/accel/build_bvh8.h"
#include "cpu/accel/structure.h"
#include "cpu/thread_pool.h"

namespace luch::cpu {

// Boxes of primitives that a line through the box of all is expected to meet, by their areas (Cauchy, Crofton). A bound
// on what slivers can cost, at the price of one look at the boxes.
double boxes_met(const PrimBox* boxes, size_t count, ThreadPool& pool);

// From so many on it is asked which of the boxes are needless: those that their triangles hardly fill.
constexpr double MANY_BOXES = 256.0;

// Into how many pieces slivers are worth cutting, on the mean over those of them that gain: 1 where few boxes are
// needless, and no more than memory allows.
double sliver_pieces(const StructureInput& input, ThreadPool& pool);

// The boxes of primitives, in order of refs.
HugeArray<PrimBox> boxes_of(const StructureInput& input, ThreadPool& pool);

// The boxes with those of slivers in pieces, each with the id of the whole; *count: how many there are, then how many
// come out. The same array where nothing is worth cutting.
HugeArray<PrimBox> cut_slivers(const Primitives& all, HugeArray<PrimBox> boxes, size_t* count, ThreadPool& pool);

}  // namespace luch::cpu
