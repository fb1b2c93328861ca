// Texture operations over arrays, for tests: one operation, many points, no scene needed.
#include <algorithm>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include "bindings/bind.h"
#include "bindings/images.h"
#include "cpu/shade/interpreter.h"
#include "luch/shade/textures/ops.h"  // not all of shade/ops.h: this file is long to compile

namespace luch::bindings {
namespace {

using FloatRows = py::array_t<float, py::array::c_style | py::array::forcecast>;

struct Call {
    const OpContext* context;
    const u32* params;
    const float* in;  // inputs rows of `count` floats
    float* out;
    py::ssize_t count;
};

// The scalar path, which CUDA uses.
template <class Op>
void run_one_by_one(const Call& call) {
    for (py::ssize_t k = 0; k < call.count; k++) {
        float in[Op::inputs], out[Op::outputs];
        for (int r = 0; r < Op::inputs; r++) in[r] = call.in[r * call.count + k];
        Op::eval(*call.context, call.params, in, out);
        for (int r = 0; r < Op::outputs; r++) call.out[r * call.count + k] = out[r];
    }
}

struct TextureOp {
    const char* name;
    int inputs, outputs, params;
    void (*run_one_by_one)(const Call&);
};

const TextureOp OPS[] = {
#define LUCH_OP(NAME, STRUCT) {#NAME, STRUCT::inputs, STRUCT::outputs, STRUCT::params, run_one_by_one<STRUCT>},
#include "luch/shade/textures/ops.inc"
#undef LUCH_OP
};

const TextureOp& find_op(const std::string& name) {
    for (const TextureOp& op : OPS) {
        if (name == op.name) return op;
    }
    throw std::invalid_argument("Texture operation \"" + name + "\" is not in shade/textures/ops.inc.");
}

// A scene of one program of one instruction: outputs in the first registers, then inputs.
class OneInstruction {
 public:
    OneInstruction(const TextureOp& op, const std::vector<u32>& params) : op_(op) {
        for (int k = 0; k < op.outputs + op.inputs; k++) operands_.push_back(u32(k));
        operands_.insert(operands_.end(), params.begin(), params.end());
        instruction_ = {u16(code_of(op)), u16(params.size()), 0};
        program.instruction_count = 1;
        program.register_count = u32(op.outputs + op.inputs);
        scene.instructions = &instruction_;
        scene.operands = operands_.data();
        registers_.resize(cpu::register_floats(program) + 16);
    }

    static int code_of(const TextureOp& op) {
        int code = 0;
        while (std::strcmp(cpu::op_info(code).name, op.name) != 0) code++;
        return code;
    }

    void run(const Call& call) {
        void* memory = registers_.data();
        size_t space = registers_.size() * sizeof(float);
        float* registers =
            static_cast<float*>(std::align(64, cpu::register_floats(program) * sizeof(float), memory, space));
        const auto points = std::make_unique<ShadePoints>();
        for (py::ssize_t first = 0; first < call.count; first += SHADE_LANES) {
            points->count = int(std::min<py::ssize_t>(SHADE_LANES, call.count - first));
            const size_t bytes = size_t(points->count) * sizeof(float);
            for (int r = 0; r < op_.inputs; r++) {
                std::memcpy(registers + size_t(op_.outputs + r) * SHADE_LANES, call.in + r * call.count + first, bytes);
            }
            cpu::run_values(scene, program, *points, registers);
            for (int r = 0; r < op_.outputs; r++) {
                std::memcpy(call.out + r * call.count + first, registers + size_t(r) * SHADE_LANES, bytes);
            }
        }
    }

    SceneView scene{};
    Program program{};

 private:
    const TextureOp& op_;
    Instruction instruction_{};
    std::vector<u32> operands_;
    std::vector<float> registers_;
};

py::array_t<float> run_texture(const std::string& name, const FloatRows& inputs, const std::vector<u32>& params,
                               const FloatRows& table, const std::vector<py::tuple>& images, bool one_by_one) {
    const TextureOp& op = find_op(name);
    if (inputs.ndim() != 2 || inputs.shape(0) != op.inputs) {
        throw std::invalid_argument(name + " takes inputs of shape (" + std::to_string(op.inputs) + ", N).");
    }
    if (int(params.size()) < op.params) {
        throw std::invalid_argument(name + " takes " + std::to_string(op.params) + " params or more.");
    }
    py::array_t<float> outputs({py::ssize_t(op.outputs), inputs.shape(1)});
    OneInstruction run(op, params);
    run.scene.tables = table.data();
    std::vector<ImageView> views;
    std::vector<u32> slots;
    for (const py::tuple& image : images) {
        slots.push_back(u32(views.size()));
        views.push_back(view_image(image));
    }
    run.scene.images = views.data();
    run.scene.program_images = slots.data();
    const OpContext context{&run.scene, &run.program, nullptr, 0, nullptr, nullptr};
    const Call call{&context, params.data(), inputs.data(), outputs.mutable_data(), inputs.shape(1)};
    if (one_by_one) {
        op.run_one_by_one(call);
    } else {
        run.run(call);
    }
    return outputs;
}

}  // namespace

void bind_textures(py::module_& m) {
    auto textures = m.def_submodule("textures", "Texture operations over float32 arrays.");
    textures.def("run", &run_texture, py::arg("name"), py::arg("inputs"), py::arg("params") = std::vector<u32>{},
                 py::arg("table") = FloatRows(0), py::arg("images") = std::vector<py::tuple>{},
                 py::arg("one_by_one") = false,
                 "Runs one operation of shade/textures/ops.inc. inputs: float32 (inputs, N). Returns float32\n"
                 "(outputs, N). table: what the program's tables hold. images: tuples (pixels (H, W, 1..4) uint8,\n"
                 "float16 or float32, bottom row first; is sRGB; ImageAlpha). one_by_one: the scalar path that\n"
                 "CUDA uses instead of the interpreter's chunks.");
    textures.def(
        "operations",
        [] {
            py::dict all;
            for (const TextureOp& op : OPS) all[op.name] = py::make_tuple(op.inputs, op.outputs, op.params);
            return all;
        },
        "Name -> (inputs, outputs, params) of every texture operation.");
}

}  // namespace luch::bindings
