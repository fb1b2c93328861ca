#include "bindings/array_scene.h"

#include <algorithm>

namespace luch::bindings {

ArrayScene::ArrayScene(const FloatArray& positions, const IndexArray& triangles, const ByteArray& flags,
                       const IndexArray& mesh_rows, const IndexArray& instance_meshes, const FloatArray& to_world,
                       const FloatArray& to_object, const IndexArray& visibility, const FloatArray& spheres)
    : meshes(size_t(mesh_rows.shape(0)), MeshView{}), instances(size_t(instance_meshes.shape(0)), InstanceView{}) {
    for (size_t m = 0; m < meshes.size(); ++m) {
        const u32* row = mesh_rows.data(py::ssize_t(m), 0);
        meshes[m].first_vertex = row[0];
        meshes[m].vertex_count = row[1];
        meshes[m].first_triangle = row[2];
        meshes[m].triangle_count = row[3];
        if (mesh_rows.shape(1) == 6) {
            meshes[m].first_sphere = row[4];
            meshes[m].sphere_count = row[5];
        }
        if (flags.size() == 0) continue;
        mesh_flags.emplace_back(flags.data() + row[2], flags.data() + row[2] + row[3]);
        mesh_flags.back().resize(first_piece(meshes[m]));
        const py::ssize_t first = triangles.shape(0) + py::ssize_t(meshes[m].first_sphere);
        if (flags.size() >= first + py::ssize_t(meshes[m].sphere_count))
            std::copy_n(flags.data() + first, meshes[m].sphere_count, mesh_flags.back().data() + row[3]);
    }
    for (size_t i = 0; i < instances.size(); ++i) {
        instances[i].mesh = instance_meshes.data()[i];
        instances[i].visibility = visibility.data()[i];
        std::copy_n(to_world.data() + 12 * i, 12, instances[i].to_world.m);
        std::copy_n(to_object.data() + 12 * i, 12, instances[i].to_object.m);
    }
    view.positions = positions.data();
    view.triangles = triangles.data();
    view.spheres = spheres.data();
    view.meshes = meshes.data();
    view.mesh_count = u32(meshes.size());
    view.instances = instances.data();
    view.instance_count = u32(instances.size());
}

cpu::AccelChoice accel_choice(int kind, u32 quality, u32 precision) {
    cpu::AccelChoice choice;
    choice.wide = kind < 0;
    if (!choice.wide) choice.kind = cpu::StructureKind(kind);
    choice.quality = cpu::BuildQuality(quality);
    choice.precision = Precision(precision);
    return choice;
}

}  // namespace luch::bindings
