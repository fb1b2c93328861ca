// Runs a shader program over a chunk of points: one operation at a time, each a loop over the lanes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "luch/shade/scene_view.h"

namespace luch::cpu {

// What the world outside may know about an operation.
struct OpInfo {
    const char* name;
    int inputs, outputs, params;  // float registers read and written; static words
    bool closure;                 // outputs = 0: it appends to the closures (or stores an AOV)
    bool constant;                // foldable: depends on its inputs and params alone
};

int op_count();
const OpInfo& op_info(int op);
// Whether the operation adds to emission, transparency or holdout.
bool feeds_light(int op, const u32* params);

// LIGHT: emission, transparency and holdout alone (shadow rays, light sampling): no lobes.
enum class Wanted { ALL, LIGHT };

// Floats that a program's registers need.
inline size_t register_floats(const Program& program) { return size_t(program.register_count) * SHADE_LANES; }

// Scratch for registers, aligned as the interpreter's loops want it.
class Registers {
 public:
    explicit Registers(size_t floats) : memory_(floats + ALIGNMENT / sizeof(float)) {}
    explicit Registers(const Program& program) : Registers(register_floats(program)) {}
    float* data() {
        auto start = reinterpret_cast<uintptr_t>(memory_.data());
        return reinterpret_cast<float*>((start + ALIGNMENT - 1) & ~uintptr_t(ALIGNMENT - 1));
    }

 private:
    static constexpr size_t ALIGNMENT = 64;  // bytes: a cache line, an AVX-512 register
    std::vector<float> memory_;
};

// Runs the program for points[0, points.count). closures[points.count] are started empty and filled.
// registers: scratch of register_floats(program) floats, 64-byte aligned. aovs: null, or
// points.count rows of aov_stride floats that AOV Output nodes write to. With Wanted::LIGHT the points'
// flags must say PATH_EMISSION_ONLY or PATH_TRANSPARENT_ONLY too.
void run_program(const SceneView& scene, const Program& program, const ShadePoints& points, ClosureSet* closures,
                 float* registers, float* aovs = nullptr, size_t aov_stride = 0, Wanted wanted = Wanted::ALL);

// Computes values only: closure operations are passed over; results stay in their registers.
void run_values(const SceneView& scene, const Program& program, const ShadePoints& points, float* registers);

}  // namespace luch::cpu
