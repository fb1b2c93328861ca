#include "cpu/shade/link.h"

#include <stdexcept>

namespace luch::cpu {
namespace {

[[noreturn]] void refuse(const ProgramSource& source, const std::string& fact) {
    throw std::invalid_argument("Shader program of \"" + source.owner + "\": " + fact +
                                ". Export the scene again with this version of Luch.");
}

template <class T>
void append(std::vector<T>& all, const std::vector<T>& part) {
    all.insert(all.end(), part.begin(), part.end());
}

}  // namespace

Program LinkedPrograms::add(const ProgramSource& source) {
    Program program{};
    program.first_instruction = u32(instructions.size());
    program.register_count = source.register_count;
    program.first_constant = u32(constants.size());
    program.constant_count = u32(source.constants.size());
    program.first_table = u32(tables.size());
    program.first_image = u32(images.size());
    program.first_attribute = u32(attributes.size());
    program.first_aov = u32(aovs.size());
    program.flags = source.flags;
    if (source.constants.size() > source.register_count) refuse(source, "it has more constants than registers");
    for (size_t at = 0; at < source.code.size();) {
        if (at + 2 > source.code.size() || source.code[at] >= u32(op_count()))
            refuse(source, "an operation is unknown");
        const u32 op = source.code[at], param_count = source.code[at + 1];
        const OpInfo& info = op_info(int(op));
        const size_t registers = size_t(info.outputs + info.inputs);
        at += 2;
        if (param_count < u32(info.params) || at + registers + param_count > source.code.size()) {
            refuse(source, std::string("operation ") + info.name + " lacks operands");
        }
        instructions.push_back({u16(op), u16(param_count), u32(operands.size())});
        for (size_t k = 0; k < registers + param_count; k++) {
            const u32 word = source.code[at + k];
            if (k < registers && word >= source.register_count) {
                refuse(source, std::string("operation ") + info.name + " names a register that does not exist");
            }
            operands.push_back(word);
        }
        program.instruction_count++;
        if (feeds_light(int(op), source.code.data() + at + registers)) {
            program.light_instruction_count = program.instruction_count;
        }
        at += registers + param_count;
    }
    append(constants, source.constants);
    append(tables, source.tables);
    append(images, source.images);
    append(attributes, source.attributes);
    append(aovs, source.aovs);
    return program;
}

void LinkedPrograms::fill(SceneView& view) const {
    view.instructions = instructions.data();
    view.operands = operands.data();
    view.constants = constants.data();
    view.tables = tables.data();
    view.program_images = images.data();
    view.program_attributes = attributes.data();
    view.program_aovs = aovs.data();
}

void LinkedPrograms::describe(DeviceImage& image, u32 block, const SceneView& view) const {
    image.add_array("instructions", block, view.instructions, instructions.size());
    image.add_array("operands", block, view.operands, operands.size());
    image.add_array("constants", block, view.constants, constants.size());
    image.add_array("tables", block, view.tables, tables.size());
    image.add_array("program_images", block, view.program_images, images.size());
    image.add_array("program_attributes", block, view.program_attributes, attributes.size());
    image.add_array("program_aovs", block, view.program_aovs, aovs.size());
}

}  // namespace luch::cpu
