#include "cpu/geometry/islands.h"

#include <numeric>
#include <utility>

#include "luch/shade/textures/hash.h"

namespace luch::cpu {
namespace {

// Union-find by rank; the root of a set is its number.
class Sets {
 public:
    explicit Sets(size_t count) : parent_(count), rank_(count, 0) { std::iota(parent_.begin(), parent_.end(), 0u); }

    u32 find(u32 x) {
        u32 root = x;
        while (parent_[root] != root) root = parent_[root];
        while (parent_[x] != root) x = std::exchange(parent_[x], root);
        return root;
    }
    void join(u32 x, u32 y) {
        u32 a = find(x), b = find(y);
        if (a == b) return;
        if (rank_[a] < rank_[b]) std::swap(a, b);
        parent_[b] = a;
        if (rank_[a] == rank_[b]) rank_[a]++;
    }

 private:
    std::vector<u32> parent_;
    std::vector<u8> rank_;  // at most 32
};

}  // namespace

std::vector<float> island_random(size_t vertex_count, const u32* edges, size_t edge_count, const u32* triangles,
                                 size_t triangle_count) {
    Sets sets(vertex_count);
    for (size_t k = 0; k < edge_count; k++) sets.join(edges[2 * k], edges[2 * k + 1]);
    std::vector<float> result(triangle_count);
    for (size_t k = 0; k < triangle_count; k++) {
        result[k] = float(hash_words(sets.find(triangles[3 * k]))) * (1.0f / 4294967295.0f);
    }
    return result;
}

}  // namespace luch::cpu
