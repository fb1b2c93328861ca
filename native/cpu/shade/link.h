// Brings programs, each with its own numbering of tables, images, attributes and AOVs, into one
// scene's arrays.
#pragma once
#include <string>
#include <vector>

#include "cpu/device_image.h"
#include "cpu/shade/interpreter.h"

namespace luch::cpu {

// luch.scene.Program as plain arrays. The maps go from the program's slots to the scene's numbers.
struct ProgramSource {
    std::string owner;      // material, world or lamp, for error messages
    std::vector<u32> code;  // per instruction: op, param count, outputs, inputs, params
    std::vector<float> constants, tables;
    u32 register_count = 0, flags = 0;
    std::vector<u32> images, attributes, aovs;
};

// The arrays behind SceneView::instructions, operands, constants, tables and program_*.
struct LinkedPrograms {
    std::vector<Instruction> instructions;
    std::vector<u32> operands;
    std::vector<float> constants, tables;
    std::vector<u32> images, attributes, aovs;

    // Checks the program, appends it, and returns where it lies. Throws std::invalid_argument.
    Program add(const ProgramSource& source);
    void fill(SceneView& view) const;
    // The same arrays for a device: `view` lies inside the image's block `block`.
    void describe(DeviceImage& image, u32 block, const SceneView& view) const;
};

}  // namespace luch::cpu
