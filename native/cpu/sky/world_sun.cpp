#include "cpu/sky/world_sun.h"

#include <cmath>
#include <cstring>

#include "cpu/shade/interpreter.h"
#include "luch/shade/textures/sky.h"

namespace luch::cpu {

WorldSun find_world_sun(const SceneView& scene) {
    const Program& program = scene.world_program;
    WorldSun sun;
    for (u32 k = 0; k < program.instruction_count; k++) {
        const Instruction& instruction = scene.instructions[program.first_instruction + k];
        const OpInfo& info = op_info(instruction.op);
        if (std::strcmp(info.name, "SKY_ATMOSPHERE") != 0) continue;
        const u32* params = scene.operands + instruction.operands + info.outputs + info.inputs;
        const float* table = scene.tables + program.first_table + params[0];
        const auto& sky = *reinterpret_cast<const SkyAtmosphere*>(table);
        if (sky.sun_diameter <= sun.angle) continue;
        sun.present = true;
        sun.direction = {sky.sun_direction[0], sky.sun_direction[1], sky.sun_direction[2]};
        sun.angle = sky.sun_diameter;
    }
    return sun;
}

Vec3 beside_sun(const WorldSun& sun, Vec3 d) {
    const float radius = 0.501f * sun.angle;  // a little more than half
    if (!sun.present || length(d - sun.direction) > 2.0f * std::sin(0.5f * radius)) return d;
    Vec3 t, b;
    make_frame(sun.direction, &t, &b);
    const Vec3 across = normalize_or(d - sun.direction * dot(d, sun.direction), t);
    return sun.direction * std::cos(radius) + across * std::sin(radius);
}

}  // namespace luch::cpu
