// What reads luch.scene's dataclasses: one method for each kind of thing, in reader_shapes.cpp (what stands in the scene),
// reader_looks.cpp (what it looks like) and reader_view.cpp (how it is seen).
#pragma once
#include <pybind11/stl.h>

#include <array>
#include <stdexcept>

#include "bindings/bind.h"
#include "cpu/camera.h"
#include "cpu/integrator/renderer.h"

namespace luch::bindings {

template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;

// Arrays that the inputs point into live as long as the reading does.
struct Keep {
    std::vector<py::object> objects;
    template <class T>
    Array<T> array(const py::object& source) {
        Array<T> result = py::cast<Array<T>>(source);
        objects.push_back(result);
        return result;
    }
};

inline Color read_color(const py::handle& value) {
    auto t = py::cast<std::array<float, 3>>(value);
    return {t[0], t[1], t[2]};
}

// Of a name among the light groups, counted from 1; 0: none.
u32 lightgroup_index(const std::vector<std::string>& groups, const std::string& name);

// (3, 4), row by row; `owner` is named where it is not.
Array<double> read_matrix(const py::object& source, const std::string& owner);

// Reads what `owner` names; what Python cannot turn into the number, the text or the array that is wanted, is told so.
template <class Read>
void named(const std::string& owner, Read&& read) {
    const char* remedy = " Export the scene again.";
    try {
        read();
    } catch (const py::cast_error&) {
        throw std::invalid_argument(owner + " holds a number out of its range, or of another kind." + remedy);
    } catch (py::error_already_set& error) {
        if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError)) throw;
        throw std::invalid_argument(owner + " holds what cannot be read (" + error.what() + ")." + remedy);
    }
}

struct Reader {
    py::object scene;
    cpu::SceneStore& store;
    cpu::RenderInput& input;
    std::vector<std::string> lightgroups, aovs, warnings{};

    Program read_program(const py::object& program, const std::string& owner);
    cpu::CurveInput read_curves(const std::string& name, const py::object& curves, Keep& keep);
    void read_mesh(const py::object& mesh);
    // Its number among the scene's media; NONE where there is none.
    u32 read_medium(const py::object& medium);
    bool still() const { return scene.attr("shutter").is_none(); }
    // Whether every key is the shape itself, bit for bit: then it stands still, and is traced as what stands still.
    static bool all_alike(const Array<float>& keys, const float* shape);
    void read_mesh_motion(const py::object& mesh, Keep& keep, cpu::MeshInput& in);
    void read_material(const py::object& material);
    float crypto_id(const std::string& name);
    void read_object(const py::object& object);
    cpu::Matrix relative_to_origin(const double* matrix) const;
    // By instance, as InstanceInput::motion; none: nothing moves.
    std::vector<std::vector<cpu::Matrix>> read_instance_motion(const py::object& motion, size_t instance_count);
    std::vector<u32> read_instances(const py::object& instances);
    // One texel that is not finite would spread to all that is interpolated with it and to every table that sums over it.
    void blacken_broken_texels(const std::string& name, const ImageView& view, std::vector<u8>& bytes);
    void read_image(const py::object& image);
    void read_lamp(const py::object& light);
    // The importance map is as fine as the widest image that the world shows, within bounds: coarser misses
    // suns, finer than 4,096 costs 100 MB and finds no more.
    int automatic_map_width(const py::object& program) const;
    void read_world(const py::object& world);
    void read_camera_motion(const py::object& motion, cpu::CameraSpec spec, const cpu::FrameSpec& frame);
    void read_shutter(const py::object& shutter);
    void read_camera(const py::object& camera, const py::object& film);
    void read_film(const py::object& film);
    // What everything else is read with.
    void read_names();
    void read_view();
    void read_curve_settings(const py::object& settings);
    void read_settings(const py::object& settings);
};

}  // namespace luch::bindings
