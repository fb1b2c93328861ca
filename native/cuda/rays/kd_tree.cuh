// The kd-tree as threads of a GPU walk it: with the last eight nodes that wait, and again from the root where these were
// not enough, which costs 0.6 % more nodes at most (docs/rays.md); room for all that can wait is 720 bytes of local
// memory a thread.
#pragma once
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
