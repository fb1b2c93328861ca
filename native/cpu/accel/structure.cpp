#include "cpu/accel/structure.h"

#include <stdexcept>

namespace luch::cpu {

std::unique_ptr<Structure> build_structure(StructureKind kind, const StructureInput& input, ThreadPool& pool) {
    switch (kind) {
        case StructureKind::BRUTE_FORCE:
            return build_brute_force(input, pool);
        case StructureKind::BVH2:
            return build_bvh2(input, pool);
        case StructureKind::BVH2_STACKLESS:
            return build_bvh2_stackless(input, pool);
        case StructureKind::GRID:
            return build_grid(input, pool);
        case StructureKind::HIERARCHICAL_GRID:
            return build_hierarchical_grid(input, pool);
        case StructureKind::KD_TREE:
            return build_kd_tree(input, pool);
        case StructureKind::CWBVH:
            return build_cwbvh(input, pool);
        default:
            throw std::invalid_argument("This structure is not in this build.");
    }
}

}  // namespace luch::cpu
