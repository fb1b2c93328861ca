#include "luch/accel/brute_force.h"

#include "cpu/accel/structure.h"

namespace luch::cpu {
namespace {

class BruteForceList final : public StructureOf<BruteForce> {
 public:
    explicit BruteForceList(const StructureInput& input)
        : StructureOf(input.primitives), refs_(input.refs, input.refs + input.count) {
        view_ = {refs_.data(), input.count};
    }
    StructureStats stats() const override { return {0, refs_.size(), refs_.size() * sizeof(u32), 0}; }
    std::vector<StructureArray> arrays() const override {
        return {{"refs", offsetof(BruteForce, refs), refs_.data(), refs_.size() * sizeof(u32)}};
    }

 private:
    std::vector<u32> refs_;
};

}  // namespace

std::unique_ptr<Structure> build_brute_force(const StructureInput& input, ThreadPool&) {
    return std::make_unique<BruteForceList>(input);
}

}  // namespace luch::cpu
