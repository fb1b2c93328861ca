#include "cpu/shade/interpreter.h"

#include "luch/shade/ops.h"

namespace luch::cpu {
namespace {

struct Run {
    const SceneView* scene;
    const Program* program;
    const ShadePoints* points;
    ClosureSet* closures;
    float* registers;
    float* aovs;
    size_t aov_stride;
};

template <class Op>
constexpr bool is_closure = Op::outputs == 0;

template <class Op>
void run_op(const Run& run, const u32* operands) {
    constexpr int outputs = Op::outputs, inputs = Op::inputs;
    float* written[outputs > 0 ? outputs : 1];
    const float* read[inputs > 0 ? inputs : 1];
    for (int k = 0; k < outputs; k++) written[k] = run.registers + size_t(operands[k]) * SHADE_LANES;
    for (int k = 0; k < inputs; k++) read[k] = run.registers + size_t(operands[outputs + k]) * SHADE_LANES;
    const u32* params = operands + outputs + inputs;
    const int count = run.points->count;
    // Operations written over packs of lanes (textures/lane_op.h) loop for themselves.
    if constexpr (requires { &Op::eval_lanes; }) {
        const OpContext context{run.scene, run.program, run.points, 0, nullptr, nullptr};
        Op::eval_lanes(context, params, read, written, count);
        return;
    }
    // Lanes are independent: an output may share its register with an input of the same lane only.
#pragma GCC ivdep
    for (int lane = 0; lane < count; lane++) {
        OpContext context{run.scene, run.program, run.points, lane, nullptr, nullptr};
        if constexpr (is_closure<Op>) {
            context.closures = run.closures + lane;
            if (run.aovs) context.aovs = run.aovs + size_t(lane) * run.aov_stride;
        }
        float in[inputs > 0 ? inputs : 1], out[outputs > 0 ? outputs : 1];
        for (int k = 0; k < inputs; k++) in[k] = read[k][lane];
        Op::eval(context, params, in, out);
        for (int k = 0; k < outputs; k++) written[k][lane] = out[k];
    }
}

template <class Op>
constexpr OpInfo describe(const char* name) {
    OpInfo info{name, Op::inputs, Op::outputs, 0, is_closure<Op>, !is_closure<Op>};
    if constexpr (requires { Op::params; }) info.params = Op::params;
    if constexpr (requires { Op::reads_point; }) info.constant = !Op::reads_point;
    return info;
}

using RunFunction = void (*)(const Run&, const u32*);

constexpr RunFunction RUN[] = {
#define LUCH_OP(NAME, STRUCT) run_op<STRUCT>,
#include "luch/shade/ops.inc"
#undef LUCH_OP
};

constexpr OpInfo INFO[] = {
#define LUCH_OP(NAME, STRUCT) describe<STRUCT>(#NAME),
#include "luch/shade/ops.inc"
#undef LUCH_OP
};

void load_constants(const Run& run, const Program& program) {
    const float* constants = run.scene->constants + program.first_constant;
    const int count = run.points->count;
    for (u32 k = 0; k < program.constant_count; k++) {
        float* row = run.registers + size_t(k) * SHADE_LANES;
        for (int lane = 0; lane < count; lane++) row[lane] = constants[k];
    }
}

}  // namespace

int op_count() { return int(OpCode::COUNT); }

const OpInfo& op_info(int op) { return INFO[op]; }

bool feeds_light(int op, const u32* params) {
    switch (OpCode(op)) {
        case OpCode::CLOSURE_EMISSION:
        case OpCode::CLOSURE_TRANSPARENT:
        case OpCode::CLOSURE_HOLDOUT:
            return true;
        case OpCode::CLOSURE_PRINCIPLED:
        case OpCode::CLOSURE_PRINCIPLED_SUBSURFACE:
            return params[2] != 0 || params[3] != 0;
        default:
            return false;
    }
}

void run_program(const SceneView& scene, const Program& program, const ShadePoints& points, ClosureSet* closures,
                 float* registers, float* aovs, size_t aov_stride, Wanted wanted) {
    const Run run{&scene, &program, &points, closures, registers, aovs, aov_stride};
    load_constants(run, program);
    for (int lane = 0; lane < points.count; lane++) clear_closures(closures[lane]);
    const Instruction* instruction = scene.instructions + program.first_instruction;
    const u32 count = wanted == Wanted::LIGHT ? program.light_instruction_count : program.instruction_count;
    for (u32 k = 0; k < count; k++, instruction++) {
        RUN[instruction->op](run, scene.operands + instruction->operands);
    }
}

void run_values(const SceneView& scene, const Program& program, const ShadePoints& points, float* registers) {
    const Run run{&scene, &program, &points, nullptr, registers, nullptr, 0};
    load_constants(run, program);
    const Instruction* instruction = scene.instructions + program.first_instruction;
    for (u32 k = 0; k < program.instruction_count; k++, instruction++) {
        if (!INFO[instruction->op].closure) RUN[instruction->op](run, scene.operands + instruction->operands);
    }
}

}  // namespace luch::cpu
