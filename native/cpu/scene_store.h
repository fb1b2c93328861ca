// Owns the arrays behind a SceneView. Filled mesh by mesh, program by program; then `finish`.
#pragma once
#include <array>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cpu/curve_store.h"
#include "cpu/device_image.h"
#include "cpu/motion/motion_store.h"
#include "cpu/shade/link.h"
#include "luch/shade/scene_view.h"

namespace luch::cpu {

struct AttributeInput {
    std::string name;
    const float* data;
    size_t rows;
    u32 channels;
    Domain domain;
};

struct MeshInput {
    std::string name;
    const float* positions;
    size_t vertex_count;
    const u32* triangles;
    const u16* material_slots;
    size_t triangle_count;
    const float* spheres;  // centre and radius, four each
    size_t sphere_count;
    CurveInput curves;
    const float* normals;  // null: flat
    Domain normals_domain;
    std::vector<AttributeInput> attributes;
    std::string uv_active, color_active;
    Vec3 texture_location, texture_size;
    u32 motion_keys;              // 0: keeps its shape
    const float* motion_positions;  // as positions and normals, key by key
    const float* motion_normals;
};

struct ObjectInput {
    u32 mesh;
    std::vector<u32> materials;
    float pass_index;
    float color[4];
    u32 visibility;
    bool holdout, shadow_catcher;
    u32 lightgroup;
    float crypto_object, crypto_asset;
    float shadow_terminator;
    std::vector<std::pair<std::string, std::array<float, 4>>> values;  // attributes of the object itself
};

struct InstanceInput {
    u32 object;
    double matrix[12];  // already relative to the scene's origin
    float random;
    Vec3 generated;
    Vec2 uv;
    std::vector<Matrix> motion;  // as matrix, at evenly spaced times; none: stands still
};

class SceneStore {
 public:
    SceneStore();

    // Throws std::invalid_argument, naming the mesh, for an index out of range or sizes that do not agree.
    void add_mesh(const MeshInput& input);
    u32 add_object(const ObjectInput& input);
    // A matrix that flattens to a plane gets a little thickness. False when it is not finite or leaves only a line or
    // a point: such an instance is not drawn.
    bool add_instance(const InstanceInput& input);
    // The source's maps must already hold the scene's numbers (attribute_id for attributes).
    Program add_program(const ProgramSource& source) { return programs_.add(source); }
    u32 add_material(const MaterialView& material);
    void add_image(const ImageView& image, std::vector<u8> pixels);
    void set_world_program(const Program& program) { view_.world_program = program; }

    // After finish(): the instances, by number, get INSTANCE_IN_WORLD.
    void mark_in_world(const std::vector<u8>& in_world);

    // Points the view at the arrays; call after the last add_.
    const SceneView& finish();
    SceneView& view() { return view_; }
    MaterialView* materials() { return materials_.data(); }
    const SceneView& view() const { return view_; }

    // Per mesh, per primitive: bit 0 set when some object that uses the mesh has a material there that may be
    // transparent for shadow rays. An empty inner vector: no primitive of that mesh.
    std::vector<std::vector<u8>> transparency_flags(bool all = false) const;

    // Adds the arrays behind `view`, a copy of view() inside the image's block `block`.
    void describe(DeviceImage& image, u32 block, const SceneView& view) const;

    size_t bytes() const;
    u32 attribute_id(const std::string& name);

 private:
    void resolve_attributes();

    struct NamedAttribute {
        u32 mesh, id;
        AttributeView view;
    };
    SceneView view_{};
    LinkedPrograms programs_;
    MotionStore motion_;
    CurveStore curves_;
    std::vector<float> positions_, spheres_, normals_, attribute_data_;
    std::vector<u32> triangles_, material_table_;
    std::vector<u16> material_slots_;
    std::vector<AttributeView> attributes_;
    std::vector<NamedAttribute> named_attributes_;
    std::vector<NamedAttribute> object_attributes_;  // mesh: the object
    std::vector<MeshView> meshes_;
    std::vector<ObjectView> objects_;
    std::vector<ObjectInput> object_inputs_;
    std::vector<u32> object_first_material_;
    std::vector<InstanceView> instances_;
    std::vector<MaterialView> materials_;
    std::vector<ImageView> images_;
    std::vector<std::vector<u8>> pixels_;
    std::unordered_map<std::string, u32> attribute_ids_;
};

}  // namespace luch::cpu
