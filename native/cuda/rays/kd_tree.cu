// A thread keeps the last eight nodes that wait and starts again at the root where these were not enough, which costs
// 0.6 % more nodes at most (docs/rays.md); room for all that can wait is 720 bytes of local memory. `closest_full` has
// it, for the race.
#include "luch/accel/kd_tree.h"

namespace luch {

struct ShortStackKdTree : KdTree {};
using KdStackOfThread = KdShortStack<8>;

template <Precision P, class Count>
__device__ __forceinline__ void closest_hit(const ShortStackKdTree& tree, const Primitives& all, const Ray& ray,
                                            RefHit* best, Count& count) {
    closest_hit<P, KdStackOfThread>(static_cast<const KdTree&>(tree), all, ray, best, count);
}
template <Precision P, class Count>
__device__ __forceinline__ u8 any_hit(const ShortStackKdTree& tree, const Primitives& all, const Ray& ray,
                                      Count& count) {
    return any_hit<P, KdStackOfThread>(static_cast<const KdTree&>(tree), all, ray, count);
}

}  // namespace luch

#define LUCH_RESIDENT_BLOCKS 8  // 64 registers a thread
#define LUCH_VIEW luch::ShortStackKdTree
#include "rays/generic.cuh"

LUCH_KERNEL(closest_full)(LUCH_ARGUMENTS) {
    luch::trace_closest<luch::KdTree, luch::Precision::LUCH_PRECISION, luch::NoCounters>(view, all, batch);
}
