// The contract of shader operations. An operation is a struct with static facts and one scalar
// function; the CPU interpreter loops it over a chunk of lanes, CUDA calls it in straight-line code.
//
//   struct OpMathAdd {
//       static constexpr int inputs = 2, outputs = 1;             // float registers
//       LUCH_FN static void eval(const OpContext&, const u32* params, const float* in, float* out) {
//           out[0] = in[0] + in[1];
//       }
//   };
//
// A Vec3 socket is three registers in a row. `params` are the instruction's static words (enum
// variants, table offsets, image slots; floats through bits_float). Value operations are pure and
// branch-light (a ternary, not an if) so that the loop vectorises. Closure operations have
// outputs = 0 and append to context.closures; `in[0..2]` is always the closure's weight.
// An operation is one line in the closed list shade/ops.inc: LUCH_OP(NAME, struct).
//
// Optional facts, as static constexpr members: `params` (how many static words, default 0) and
// `reads_point = true`: the result depends on more than inputs, params and tables (images, attributes,
// the point), else the program builder folds the operation when its inputs are constant.
//
// An operation whose loops differ in length from lane to lane (fractal noise) cannot vectorise so. It
// may add `static void eval_lanes(context, params, in, out, count)` over arrays of lanes: see textures/lane_op.h.
#pragma once
#include "luch/bsdf/closure.h"
#include "luch/math/fn.h"
#include "luch/shade/point.h"

namespace luch {

struct SceneView;  // shade/scene_view.h: plain pointers to the scene's arrays

struct Instruction {
    u16 op;            // index into the closed list
    u16 param_count;
    u32 operands;      // offset into the operand pool: outputs, then inputs, then params
};

struct Program {
    u32 first_instruction, instruction_count;  // into SceneView::instructions
    u32 light_instruction_count;               // the first so many give emission, transparency, holdout
    u32 register_count;
    u32 first_constant, constant_count;        // SceneView::constants: registers [0, constant_count) hold them
    // A program's own slots (params) are relative to these; see table_of, image_of, attribute_of, aov_of.
    u32 first_table;      // SceneView::tables, floats
    u32 first_image;      // SceneView::program_images
    u32 first_attribute;  // SceneView::program_attributes
    u32 first_aov;        // SceneView::program_aovs
    u32 flags;                                 // ProgramFlag
};

struct OpContext {
    const SceneView* scene;
    const Program* program;
    const ShadePoints* points;
    int lane;              // which of points
    ClosureSet* closures;  // of this lane; null when only values are wanted
    float* aovs;           // of this lane: 4 floats per AOV of the film; null when not wanted
};

// Attribute slots that mean a default of the mesh.
enum AttributeSlot : u32 {
    ATTRIBUTE_UV = 0xfffffff0u,    // the active UV map
    ATTRIBUTE_COLOR = 0xfffffff1u, // the active colour attribute
    ATTRIBUTE_GENERATED = 0xfffffff2u,
    ATTRIBUTE_TANGENT = 0xfffffff3u,
};

enum ProgramFlag : u32 {
    PROGRAM_EMISSION = 1u,          // may emit
    PROGRAM_TRANSPARENT = 2u,       // may let shadow rays pass
    PROGRAM_SURFACE = 4u,           // has at least one lobe
    PROGRAM_CONSTANT_EMISSION = 8u, // emission is the same everywhere (and in every direction)
    PROGRAM_LIGHT_PATH = 16u,       // asks the Light Path node
    PROGRAM_HOLDOUT = 32u,
    PROGRAM_EMISSION_FRONT = 64u,   // emits only where the front face is seen
    PROGRAM_EMISSION_BACK = 128u,
    PROGRAM_SUBSURFACE = 256u,      // may scatter light under the surface
    PROGRAM_EMISSION_BY_SIDE = 4096u,  // emission is the same everywhere on a side
    PROGRAM_SUBSURFACE_BUMP = 512u, // whose normal is not the interpolated one
};

}  // namespace luch
