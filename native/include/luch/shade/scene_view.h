// The scene as kernels see it: plain pointers, filled once by cpu/scene_store (and its CUDA twin).
#pragma once
#include "luch/geometry/curve.h"
#include "luch/geometry/motion.h"
#include "luch/geometry/ray.h"
#include "luch/math/vec.h"
#include "luch/plan.h"
#include "luch/shade/op.h"

namespace luch {

enum class Domain : u8 { NONE_, POINT, CORNER, FACE, MESH, SPHERE, CURVE, CURVE_POINT };

struct AttributeView {
    u32 offset;   // into SceneView::attribute_data, floats
    u8 channels;  // 0: this mesh has no such attribute
    Domain domain;
};

struct MeshView {
    u32 first_vertex, vertex_count;      // into positions
    u32 first_triangle, triangle_count;  // into triangles, material_slots
    u32 first_normal;                    // into normals; by normals_domain
    Domain normals_domain;               // NONE_: flat
    u32 first_attribute;                 // attributes[first_attribute + attribute id]
    Vec3 texture_location, texture_size;
    u32 first_sphere, sphere_count;      // into spheres; sphere k is primitive triangle_count + k
    u32 first_curve_point;               // into curve_points
    u32 first_segment, segment_count;    // into curve_segments; their pieces are the primitives after the spheres
    u32 first_curve, curve_count;        // into curve_slots
};

enum InstanceFlag : u32 {
    INSTANCE_HOLDOUT = 1u,
    INSTANCE_SHADOW_CATCHER = 2u,
    INSTANCE_MIRRORED = 4u,
    INSTANCE_WORLD_NORMALS = 8u,  // its mesh's normals become unit in the world, not before
    INSTANCE_MOVES = 16u,          // to_world and to_object are those of the shutter's middle: see instance_at_time
    INSTANCE_DEFORMS = 32u,        // so are its mesh's positions and normals
    INSTANCE_HAIR_DEFORMS = 64u,   // so are its mesh's curves
    INSTANCE_IN_WORLD = 128u,  // all its rays are traced with corners that were taken to the world, never with its own
};

struct InstanceView {
    Affine to_world, to_object;
    u32 mesh, object;
    u32 first_material;  // materials = material_table[first_material + slot]
    u32 material_count;
    u32 visibility;  // RayKind bits
    u32 flags;  // InstanceFlag
    float random;
    Vec3 generated;  // of the instancer
    Vec2 uv;
};

struct ObjectView {
    u32 first_attribute;  // attributes[first_attribute + attribute id], 4 channels; NONE: no values of its own
    float pass_index;
    float color[4];
    Vec3 location;  // world
    u32 lightgroup;  // bit index + 1, 0: none
    float crypto_object, crypto_asset;
    float shadow_terminator;  // cosine from which on shadow rays leave the curved surface; 0: never
};

struct MaterialView {
    Program program;
    float pass_index;
    float crypto;
    u32 emission_sampling;  // 0 none, 1 front, 2 back, 3 both
    u32 transparent_shadows;
    u32 medium;  // what fills the space behind it; NONE: nothing
    u32 only_volume;  // 1: there is no surface, only the border of its medium
    u32 casts_caustics;  // 1: photons bring the light of its sharp lobes (integrator/caustics.h)
};

enum class PixelFormat : u8 { U8, F16, F32 };

inline constexpr u32 IMAGE_TILE = 8;  // texels along a side of those that lie together on a GPU

struct ImageView {
    const void* pixels;  // rows bottom first; of tiles, if tiles_across is not 0
    u32 width, height;
    u8 channels;  // 1..4
    PixelFormat format;
    u8 srgb;  // decode on lookup
    u8 alpha;  // 0 straight, 1 premultiplied, 2 channel packed, 3 none
    u32 tiles_across;  // 0: the texels lie row by row; else by tiles of IMAGE_TILE x IMAGE_TILE, each row by row
};

struct LightsView;  // light/light.h
struct CameraView;  // camera/camera.h

enum SceneFlag : u32 { SCENE_NO_REFLECTIVE_CAUSTICS = 1u, SCENE_NO_REFRACTIVE_CAUSTICS = 2u };

struct SceneView {
    const float* positions;  // 3 per vertex, object space
    const u32* triangles;  // 3 per triangle, local vertex indices
    const u16* material_slots;  // per triangle; spheres show the first slot
    const float* spheres;  // 4 per sphere: centre, radius (see Sphere), object space
    const float* curve_points;  // 4 per point of curves: place, radius, object space
    const u32* curve_segments;  // as CurveSet's, points counted within the mesh
    const u32* segment_curves;  // per segment: its curve, counted within the mesh
    const u16* curve_slots;  // per curve
    const float* normals;
    const float* attribute_data;
    const AttributeView* attributes;
    const MeshView* meshes;
    const InstanceView* instances;
    const ObjectView* objects;
    const u32* material_table;
    const MaterialView* materials;
    const ImageView* images;
    const Instruction* instructions;
    const u32* operands;  // outputs, inputs, params of every instruction
    const float* constants;
    const float* tables;
    const u32* program_images;  // image slot of a program -> image index
    const u32* program_attributes;  // attribute slot of a program -> attribute id
    const u32* program_aovs;  // AOV slot of a program -> AOV index of the film, NONE: not kept
    const LightsView* lights;
    u32 mesh_count, instance_count, object_count, material_count, image_count, light_count;
    u32 uv_attribute, color_attribute, generated_attribute, tangent_attribute;  // ids of the defaults
    Program world_program;
    u32 flags;  // SceneFlag
    const CameraView* camera;  // Texture Coordinate > Camera/Window, Camera Data; null: they give 0
    Vec2 frame_size;  // pixels of the full frame: Texture Coordinate > Window
    Vec3 origin;  // Scene.origin: added to a position it gives Blender's world
    CurveShape curve_shape;  // of all curves
    u32 log2_pieces;  // of every segment: see CurveSet
    const MotionView* motion;  // null: nothing moves
};

// Row `row` of an array of vectors.
LUCH_FN Vec3 vec3_row(const float* data, u64 row) { return {data[3 * row], data[3 * row + 1], data[3 * row + 2]}; }

// Vertex `index` of the mesh, object space.
LUCH_FN Vec3 vertex_at(const SceneView& scene, const MeshView& mesh, u32 index) {
    return vec3_row(scene.positions, u64(mesh.first_vertex) + index);
}

// The triangle's three vertices, counted within its mesh.
LUCH_FN const u32* corners_of(const SceneView& scene, const MeshView& mesh, u32 prim) {
    return scene.triangles + 3 * (u64(mesh.first_triangle) + prim);
}

// Without the pieces of curves.
LUCH_FN u32 first_piece(const MeshView& mesh) { return mesh.triangle_count + mesh.sphere_count; }
LUCH_FN u32 primitive_count(const SceneView& scene, const MeshView& mesh) {
    return first_piece(mesh) + (mesh.segment_count << scene.log2_pieces);
}
LUCH_FN bool is_triangle(const MeshView& mesh, u32 prim) {
    return !(plan::SPHERES || plan::CURVES) || prim < mesh.triangle_count;
}
LUCH_FN bool is_curve(const MeshView& mesh, u32 prim) { return plan::CURVES && prim >= first_piece(mesh); }
LUCH_FN bool is_sphere(const MeshView& mesh, u32 prim) {
    return plan::SPHERES && !is_triangle(mesh, prim) && !is_curve(mesh, prim);
}
// Centre and radius of a primitive that is a sphere.
LUCH_FN const float* sphere_at(const SceneView& scene, const MeshView& mesh, u32 prim) {
    return scene.spheres + 4 * (u64(mesh.first_sphere) + (prim - mesh.triangle_count));
}

// The mesh's curves, where its primitives are numbered within them.
LUCH_FN CurveSet curves_of(const SceneView& scene, const MeshView& mesh) {
    return {scene.curve_points + 4 * u64(mesh.first_curve_point),
            scene.curve_segments + mesh.first_segment,
            mesh.segment_count,
            scene.log2_pieces,
            scene.curve_shape,
            0};
}
// Of a primitive that is a curve's piece: its segment and its curve, counted within the mesh.
LUCH_FN u32 segment_of_prim(const SceneView& scene, const MeshView& mesh, u32 prim) {
    return (prim - first_piece(mesh)) >> scene.log2_pieces;
}
LUCH_FN u32 curve_of_prim(const SceneView& scene, const MeshView& mesh, u32 prim) {
    return scene.segment_curves[mesh.first_segment + segment_of_prim(scene, mesh, prim)];
}

struct Triangle {
    Vec3 p[3];  // object space
};
LUCH_FN Triangle triangle_at(const SceneView& scene, const MeshView& mesh, u32 prim) {
    const u32* v = corners_of(scene, mesh, prim);
    return {{vertex_at(scene, mesh, v[0]), vertex_at(scene, mesh, v[1]), vertex_at(scene, mesh, v[2])}};
}

// An instance as it stands at a time; *moved: room for one that moves.
LUCH_FN_SLOW void move_instance(const SceneView& scene, u32 index, float time, InstanceView* moved) {
    const MotionView& motion = *scene.motion;
    *moved = scene.instances[index];
    moved->to_world = to_world_at(motion.keys, motion.slides, motion.instances[index], time);
    moved->to_object = to_object_at(motion.keys, motion.slides, motion.instances[index], time);
}
LUCH_FN const InstanceView& instance_at_time(const SceneView& scene, u32 index, float time, InstanceView* moved) {
    const InstanceView& still = scene.instances[index];
    if (!plan::MOTION || !(still.flags & INSTANCE_MOVES)) return still;
    move_instance(scene, index, time, moved);
    return *moved;
}

LUCH_FN_SLOW Triangle deformed_triangle(const SceneView& scene, u32 mesh_index, u32 prim, float time) {
    const MeshView& mesh = scene.meshes[mesh_index];
    const MeshMotion& motion = scene.motion->meshes[mesh_index];
    MotionPiece piece = motion_piece(motion.key_count, time);
    const float* rows = scene.motion->positions + 3 * (u64(motion.first_position) + u64(piece.key) * mesh.vertex_count);
    const u32* v = corners_of(scene, mesh, prim);
    Triangle t;
    for (int k = 0; k < 3; ++k)
        t.p[k] = between(vec3_row(rows, v[k]), vec3_row(rows, u64(mesh.vertex_count) + v[k]), piece.share);
    return t;
}
// Of an instance's mesh, in its object space, at a time.
LUCH_FN Triangle triangle_at(const SceneView& scene, const InstanceView& instance, u32 prim, float time) {
    if (plan::MOTION && (instance.flags & INSTANCE_DEFORMS)) return deformed_triangle(scene, instance.mesh, prim, time);
    return triangle_at(scene, scene.meshes[instance.mesh], prim);
}

LUCH_FN_SLOW CurveSegment deformed_segment(const SceneView& scene, u32 mesh_index, u32 prim, float time) {
    const MeshView& mesh = scene.meshes[mesh_index];
    const MeshMotion& motion = scene.motion->meshes[mesh_index];
    MotionPiece piece = motion_piece(motion.curve_key_count, time);
    CurveSet curves = curves_of(scene, mesh);
    u64 rows = motion.first_curve_point + u64(piece.key) * motion.curve_point_count;
    curves.points = scene.motion->curve_points + 4 * rows;
    return segment_between(curves, curves.points + 4 * u64(motion.curve_point_count), prim - first_piece(mesh),
                           piece.share);
}
// The segment that a primitive of an instance's curves is of, in its object space, at a time.
LUCH_FN CurveSegment segment_at(const SceneView& scene, const InstanceView& instance, u32 prim, float time) {
    if (plan::MOTION && (instance.flags & INSTANCE_HAIR_DEFORMS))
        return deformed_segment(scene, instance.mesh, prim, time);
    const MeshView& mesh = scene.meshes[instance.mesh];
    return segment_of_piece(curves_of(scene, mesh), prim - first_piece(mesh));
}

// The normals of a triangle's corners, object space; row: each one's within the mesh.
LUCH_FN_SLOW Vec3 deformed_normal(const SceneView& scene, u32 mesh_index, u32 row, float time) {
    const MeshView& mesh = scene.meshes[mesh_index];
    const MeshMotion& motion = scene.motion->meshes[mesh_index];
    MotionPiece piece = motion_piece(motion.key_count, time);
    u64 rows = mesh.normals_domain == Domain::POINT ? mesh.vertex_count : 3 * u64(mesh.triangle_count);
    u64 first = motion.first_normal + piece.key * rows + row;
    Vec3 a = vec3_row(scene.motion->normals, first), b = vec3_row(scene.motion->normals, first + rows);
    return normalize_or(between(a, b, piece.share), a);
}
LUCH_FN Vec3 normal_at_time(const SceneView& scene, const InstanceView& instance, u32 row, float time) {
    if (plan::MOTION && (instance.flags & INSTANCE_DEFORMS)) return deformed_normal(scene, instance.mesh, row, time);
    return vec3_row(scene.normals, u64(scene.meshes[instance.mesh].first_normal) + row);
}

// Material of a slot; a slot beyond the last one shows the last, as in Blender.
LUCH_FN u32 material_of_slot(const SceneView& scene, const InstanceView& instance, u32 slot) {
    u32 last = instance.material_count > 0u ? instance.material_count - 1u : 0u;
    return scene.material_table[instance.first_material + (slot < last ? slot : last)];
}
LUCH_FN u32 material_at(const SceneView& scene, u32 instance_index, u32 prim) {
    const InstanceView& instance = scene.instances[instance_index];
    const MeshView& mesh = scene.meshes[instance.mesh];
    u32 slot = 0;
    if (is_triangle(mesh, prim)) {
        slot = scene.material_slots[mesh.first_triangle + prim];
    } else if (is_curve(mesh, prim)) {
        slot = scene.curve_slots[mesh.first_curve + curve_of_prim(scene, mesh, prim)];
    }
    return material_of_slot(scene, instance, slot);
}

LUCH_FN const float* table_of(const OpContext& c, u32 offset) {
    return c.scene->tables + c.program->first_table + offset;
}
LUCH_FN const ImageView& image_of(const OpContext& c, u32 slot) {
    return c.scene->images[c.scene->program_images[c.program->first_image + slot]];
}
LUCH_FN u32 attribute_of(const OpContext& c, u32 slot) {
    if (slot >= ATTRIBUTE_UV) {
        return slot == ATTRIBUTE_UV          ? c.scene->uv_attribute
               : slot == ATTRIBUTE_COLOR     ? c.scene->color_attribute
               : slot == ATTRIBUTE_GENERATED ? c.scene->generated_attribute
                                             : c.scene->tangent_attribute;
    }
    return c.scene->program_attributes[c.program->first_attribute + slot];
}
LUCH_FN u32 aov_of(const OpContext& c, u32 slot) { return c.scene->program_aovs[c.program->first_aov + slot]; }

}  // namespace luch
