#include "cpu/scene_store.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cpu/geometry/world_normals.h"

namespace luch::cpu {
namespace {

// Names that stand for "the active one" of each mesh; SceneView carries their ids.
constexpr const char* UV_ACTIVE = "\x01uv";
constexpr const char* COLOR_ACTIVE = "\x01color";
constexpr const char* GENERATED = "generated";
constexpr const char* TANGENT_ACTIVE = "tangent";

size_t rows_of(Domain domain, const MeshInput& mesh) {
    switch (domain) {
        case Domain::POINT:
            return mesh.vertex_count;
        case Domain::CORNER:
            return mesh.triangle_count * 3;
        case Domain::FACE:
            return mesh.triangle_count;
        case Domain::MESH:
            return 1;
        case Domain::SPHERE:
            return mesh.sphere_count;
        case Domain::CURVE:
            return mesh.curves.curve_count;
        case Domain::CURVE_POINT:
            return mesh.curves.point_count;
        case Domain::NONE_:
            return 0;
    }
    return 0;
}

void check_mesh(const MeshInput& mesh) {
    for (size_t i = 0; i < mesh.triangle_count * 3; i++) {
        if (mesh.triangles[i] >= mesh.vertex_count) {
            throw std::invalid_argument("Mesh \"" + mesh.name + "\": triangle " + std::to_string(i / 3) +
                                        " names vertex " + std::to_string(mesh.triangles[i]) + " of " +
                                        std::to_string(mesh.vertex_count) + ". Export the mesh again.");
        }
    }
    for (size_t i = 0; i < mesh.sphere_count; i++) {
        const float* s = mesh.spheres + 4 * i;
        if (std::isfinite(s[0]) && std::isfinite(s[1]) && std::isfinite(s[2]) && std::isfinite(s[3]) && s[3] >= 0.0f)
            continue;
        throw std::invalid_argument("Mesh \"" + mesh.name + "\": sphere " + std::to_string(i) +
                                    " needs a finite centre and a finite radius, not below 0. Export the mesh again.");
    }
    for (const AttributeInput& attribute : mesh.attributes) {
        if (attribute.rows != rows_of(attribute.domain, mesh) || attribute.channels < 1 || attribute.channels > 4) {
            throw std::invalid_argument("Mesh \"" + mesh.name + "\": attribute \"" + attribute.name + "\" has " +
                                        std::to_string(attribute.rows) + " rows of " +
                                        std::to_string(attribute.channels) + ", which does not fit its domain.");
        }
    }
}

// Inverse of an affine matrix in double. False when the linear part is singular or not finite.
bool invert_affine(const double* m, double* inverse) {
    double c00 = m[5] * m[10] - m[6] * m[9], c01 = m[6] * m[8] - m[4] * m[10], c02 = m[4] * m[9] - m[5] * m[8];
    double determinant = m[0] * c00 + m[1] * c01 + m[2] * c02;
    if (!std::isfinite(determinant) || determinant == 0.0) return false;
    double s = 1.0 / determinant;
    inverse[0] = c00 * s;
    inverse[1] = (m[2] * m[9] - m[1] * m[10]) * s;
    inverse[2] = (m[1] * m[6] - m[2] * m[5]) * s;
    inverse[4] = c01 * s;
    inverse[5] = (m[0] * m[10] - m[2] * m[8]) * s;
    inverse[6] = (m[2] * m[4] - m[0] * m[6]) * s;
    inverse[8] = c02 * s;
    inverse[9] = (m[1] * m[8] - m[0] * m[9]) * s;
    inverse[10] = (m[0] * m[5] - m[1] * m[4]) * s;
    for (int row = 0; row < 3; row++) {
        inverse[row * 4 + 3] = -(inverse[row * 4] * m[3] + inverse[row * 4 + 1] * m[7] + inverse[row * 4 + 2] * m[11]);
    }
    for (int i = 0; i < 12; i++) {
        if (!std::isfinite(inverse[i]) || !std::isfinite(float(inverse[i])) || !std::isfinite(float(m[i])))
            return false;
    }
    return true;
}

// Of the three cross products of rows (step 4, next 1) or columns (step 1, next 4), the longest, made unit.
std::array<double, 3> longest_cross(const double* m, int next, int step) {
    std::array<double, 3> best{};
    double longest = 0.0;
    for (int i = 0; i < 3; i++) {
        const double *a = m + i * step, *b = m + (i + 1) % 3 * step;
        std::array<double, 3> c = {a[next] * b[2 * next] - a[2 * next] * b[next],
                                   a[2 * next] * b[0] - a[0] * b[2 * next], a[0] * b[next] - a[next] * b[0]};
        double length = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
        if (!(length > longest)) continue;
        longest = length;
        best = {c[0] / length, c[1] / length, c[2] / length};
    }
    return best;
}

// Adds a scale along the one direction that the matrix loses, to the normal of the plane that it leaves.
void thicken(double* m) {
    double size = 0.0;
    for (int i = 0; i < 12; i++) size = i % 4 == 3 ? size : std::max(size, std::abs(m[i]));
    std::array<double, 3> lost = longest_cross(m, 1, 4), normal = longest_cross(m, 4, 1);
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            m[row * 4 + column] += double(FLAT_THICKNESS) * size * normal[row] * lost[column];
}

// instances.h: C.
double condition(const double* m, const double* inverse) {
    double largest[2] = {};
    for (int row = 0; row < 3; row++) {
        for (int k = 0; k < 2; k++) {
            const double* r = (k == 0 ? m : inverse) + row * 4;
            largest[k] = std::max(largest[k], std::abs(r[0]) + std::abs(r[1]) + std::abs(r[2]));
        }
    }
    return largest[0] * largest[1];
}

Affine to_affine(const double* m) {
    Affine a;
    for (int i = 0; i < 12; i++) a.m[i] = float(m[i]);
    return a;
}

}  // namespace

SceneStore::SceneStore() {
    view_.uv_attribute = attribute_id(UV_ACTIVE);
    view_.color_attribute = attribute_id(COLOR_ACTIVE);
    view_.generated_attribute = attribute_id(GENERATED);
    view_.tangent_attribute = attribute_id(TANGENT_ACTIVE);
}

u32 SceneStore::attribute_id(const std::string& name) {
    return attribute_ids_.try_emplace(name, u32(attribute_ids_.size())).first->second;
}

void SceneStore::add_mesh(const MeshInput& input) {
    check_mesh(input);
    MeshView mesh{};
    mesh.first_vertex = u32(positions_.size() / 3);
    mesh.vertex_count = u32(input.vertex_count);
    mesh.first_triangle = u32(triangles_.size() / 3);
    mesh.triangle_count = u32(input.triangle_count);
    mesh.first_sphere = u32(spheres_.size() / 4);
    mesh.sphere_count = u32(input.sphere_count);
    if (input.curves.curve_count > 0) curves_.add(input.name, input.curves, mesh);
    mesh.first_normal = u32(normals_.size() / 3);
    mesh.normals_domain = input.normals ? input.normals_domain : Domain::NONE_;
    mesh.texture_location = input.texture_location;
    mesh.texture_size = input.texture_size;
    positions_.insert(positions_.end(), input.positions, input.positions + input.vertex_count * 3);
    triangles_.insert(triangles_.end(), input.triangles, input.triangles + input.triangle_count * 3);
    material_slots_.insert(material_slots_.end(), input.material_slots, input.material_slots + input.triangle_count);
    for (size_t i = 0; i < input.sphere_count; i++) {
        const float* s = input.spheres + 4 * i;
        spheres_.insert(spheres_.end(), {s[0], s[1], s[2], -s[3]});  // below zero: only its outside is there
    }
    if (input.normals) {
        normals_.insert(normals_.end(), input.normals, input.normals + rows_of(input.normals_domain, input) * 3);
    }
    u32 index = u32(meshes_.size());
    for (const AttributeInput& attribute : input.attributes) {
        AttributeView view{u32(attribute_data_.size()), u8(attribute.channels), attribute.domain};
        attribute_data_.insert(attribute_data_.end(), attribute.data,
                               attribute.data + attribute.rows * attribute.channels);
        named_attributes_.push_back({index, attribute_id(attribute.name), view});
        if (attribute.name == input.uv_active) named_attributes_.push_back({index, view_.uv_attribute, view});
        if (attribute.name == input.color_active) named_attributes_.push_back({index, view_.color_attribute, view});
    }
    meshes_.push_back(mesh);
    if (input.curves.motion_keys > 1 && mesh.segment_count > 0)
        motion_.add_curves(index, u32(input.curves.point_count), input.curves.motion_keys, input.curves.motion_points);
    if (input.motion_keys > 1)
        motion_.add_mesh(index, mesh.vertex_count, u32(input.normals ? rows_of(input.normals_domain, input) : 0),
                         input.motion_keys, input.motion_positions, input.normals ? input.motion_normals : nullptr);
}

u32 SceneStore::add_object(const ObjectInput& input) {
    ObjectView object{};
    object.pass_index = input.pass_index;
    for (int i = 0; i < 4; i++) object.color[i] = input.color[i];
    object.lightgroup = input.lightgroup;
    object.crypto_object = input.crypto_object;
    object.crypto_asset = input.crypto_asset;
    object.shadow_terminator = input.shadow_terminator;
    object.first_attribute = NONE;
    for (const auto& [name, value] : input.values) {
        const AttributeView view{u32(attribute_data_.size()), 4, Domain::MESH};
        attribute_data_.insert(attribute_data_.end(), value.begin(), value.end());
        object_attributes_.push_back({u32(objects_.size()), attribute_id(name), view});
    }
    objects_.push_back(object);
    object_inputs_.push_back(input);
    object_first_material_.push_back(u32(material_table_.size()));
    material_table_.insert(material_table_.end(), input.materials.begin(), input.materials.end());
    return u32(objects_.size() - 1);
}

bool SceneStore::add_instance(const InstanceInput& input) {
    double inverse[12] = {}, m[12];
    std::copy(input.matrix, input.matrix + 12, m);
    if (!invert_affine(m, inverse) || condition(m, inverse) > double(INSTANCE_CONDITION_FLAT)) {
        thicken(m);
        if (!invert_affine(m, inverse)) return false;
    }
    const ObjectInput& object = object_inputs_.at(input.object);
    InstanceView instance{};
    instance.to_world = to_affine(m);
    instance.to_object = to_affine(inverse);
    instance.mesh = object.mesh;
    instance.object = input.object;
    instance.first_material = object_first_material_[input.object];
    instance.material_count = u32(object.materials.size());
    instance.visibility = object.visibility;
    double determinant =
        m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
    instance.flags = (object.holdout ? INSTANCE_HOLDOUT : 0u) | (object.shadow_catcher ? INSTANCE_SHADOW_CATCHER : 0u) |
                     (determinant < 0 ? INSTANCE_MIRRORED : 0u);
    instance.random = input.random;
    instance.generated = input.generated;
    instance.uv = input.uv;
    objects_[input.object].location = {float(m[3]), float(m[7]), float(m[11])};
    motion_.add_instance(u32(instances_.size()), input.motion);
    instances_.push_back(instance);
    return true;
}

u32 SceneStore::add_material(const MaterialView& material) {
    materials_.push_back(material);
    return u32(materials_.size() - 1);
}

void SceneStore::add_image(const ImageView& image, std::vector<u8> pixels) {
    pixels_.push_back(std::move(pixels));
    images_.push_back(image);
    images_.back().pixels = pixels_.back().data();
}

void SceneStore::resolve_attributes() {
    size_t count = attribute_ids_.size();
    attributes_.assign(meshes_.size() * count, AttributeView{0, 0, Domain::NONE_});
    for (size_t i = 0; i < meshes_.size(); i++) meshes_[i].first_attribute = u32(i * count);
    for (const NamedAttribute& named : named_attributes_) attributes_[named.mesh * count + named.id] = named.view;
    // An object with values of its own has a row too.
    for (const NamedAttribute& named : object_attributes_) {
        u32& first = objects_[named.mesh].first_attribute;
        if (first == NONE) {
            first = u32(attributes_.size());
            attributes_.resize(attributes_.size() + count, AttributeView{0, 0, Domain::NONE_});
        }
        attributes_[first + named.id] = named.view;
    }
}

const SceneView& SceneStore::finish() {
    resolve_attributes();
    view_.motion = motion_.finish(meshes_.size(), instances_);
    blend_normals_in_world(meshes_, instances_, normals_);
    view_.positions = positions_.data();
    view_.triangles = triangles_.data();
    view_.material_slots = material_slots_.data();
    view_.spheres = spheres_.data();
    curves_.point(view_);
    view_.normals = normals_.data();
    view_.attribute_data = attribute_data_.data();
    view_.attributes = attributes_.data();
    view_.meshes = meshes_.data();
    view_.instances = instances_.data();
    view_.objects = objects_.data();
    view_.material_table = material_table_.data();
    view_.materials = materials_.data();
    view_.images = images_.data();
    programs_.fill(view_);
    view_.mesh_count = u32(meshes_.size());
    view_.instance_count = u32(instances_.size());
    view_.object_count = u32(objects_.size());
    view_.material_count = u32(materials_.size());
    view_.image_count = u32(images_.size());
    return view_;
}

void SceneStore::mark_in_world(const std::vector<u8>& in_world) {
    for (size_t i = 0; i < instances_.size(); i++)
        if (in_world[i]) instances_[i].flags |= INSTANCE_IN_WORLD;
}

std::vector<std::vector<u8>> SceneStore::transparency_flags(bool all) const {
    std::vector<std::vector<u8>> flags(meshes_.size());
    for (size_t o = 0; o < objects_.size(); o++) {
        const ObjectInput& object = object_inputs_[o];
        std::vector<u8> transparent(object.materials.size());
        bool any = false;
        for (size_t slot = 0; slot < object.materials.size(); slot++) {
            const MaterialView& material = materials_.at(object.materials[slot]);
            transparent[slot] = all || ((material.program.flags & PROGRAM_TRANSPARENT) && material.transparent_shadows);
            any = any || transparent[slot];
        }
        if (!any) continue;
        const MeshView& mesh = meshes_[object.mesh];
        std::vector<u8>& out = flags[object.mesh];
        out.resize(primitive_count(view_, mesh));
        for (u32 s = mesh.triangle_count; s < first_piece(mesh); s++) out[s] |= transparent[0];
        for (u32 p = first_piece(mesh); p < out.size(); p++) {
            u16 slot = curves_.slot_of_segment(mesh, segment_of_prim(view_, mesh, p));
            out[p] |= transparent[slot < transparent.size() ? slot : transparent.size() - 1];
        }
        for (u32 t = 0; t < mesh.triangle_count; t++) {
            u16 slot = material_slots_[mesh.first_triangle + t];
            out[t] |= transparent[slot < transparent.size() ? slot : transparent.size() - 1];
        }
    }
    return flags;
}

void SceneStore::describe(DeviceImage& image, u32 block, const SceneView& view) const {
    image.add_array("positions", block, view.positions, positions_.size());
    image.add_array("triangles", block, view.triangles, triangles_.size());
    image.add_array("spheres", block, view.spheres, spheres_.size());
    curves_.describe(image, block, view);
    image.add_array("material_slots", block, view.material_slots, material_slots_.size());
    image.add_array("normals", block, view.normals, normals_.size());
    image.add_array("attribute_data", block, view.attribute_data, attribute_data_.size());
    image.add_array("attributes", block, view.attributes, attributes_.size());
    image.add_array("meshes", block, view.meshes, meshes_.size());
    image.add_array("instances", block, view.instances, instances_.size());
    image.add_array("objects", block, view.objects, objects_.size());
    image.add_array("material_table", block, view.material_table, material_table_.size());
    image.add_array("materials", block, view.materials, materials_.size());
    u32 images = image.add_array("images", block, view.images, images_.size());
    for (size_t i = 0; i < images_.size(); ++i) {
        u32 pixels = image.add("pixels", pixels_[i].data(), pixels_[i].size());
        image.link(images, &images_[i].pixels, pixels);
    }
    programs_.describe(image, block, view);
    motion_.describe(image, block, view);
}

size_t SceneStore::bytes() const {
    size_t sum =
        (positions_.size() + spheres_.size() + normals_.size() + attribute_data_.size() + triangles_.size()) * 4 +
        material_slots_.size() * 2 + instances_.size() * sizeof(InstanceView) + curves_.bytes();
    for (const std::vector<u8>& pixels : pixels_) sum += pixels.size();
    sum += motion_.bytes();
    return sum;
}

}  // namespace luch::cpu
