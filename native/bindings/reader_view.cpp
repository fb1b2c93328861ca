#include "bindings/reader.h"

#include <algorithm>
#include <iterator>

#include "bindings/camera.h"
#include "bindings/film.h"
#include "bindings/forced.h"
#include "cpu/filter.h"

namespace luch::bindings {
namespace {

// In the order of luch/samplers.py.
constexpr const char* SAMPLER_NAMES[] = {"SOBOL", "INDEPENDENT", "LATTICE"};
static_assert(std::size(SAMPLER_NAMES) == size_t(SamplerFamily::COUNT));

SamplerFamily named_sampler(const std::string& name) {
    const auto* found = std::find(std::begin(SAMPLER_NAMES), std::end(SAMPLER_NAMES), name);
    if (found == std::end(SAMPLER_NAMES)) {
        throw std::invalid_argument("Settings: the sampler is '" + name +
                                    "'; it can be SOBOL, INDEPENDENT or LATTICE.");
    }
    return SamplerFamily(found - std::begin(SAMPLER_NAMES));
}

}  // namespace

void Reader::read_camera_motion(const py::object& motion, cpu::CameraSpec spec, const cpu::FrameSpec& frame) {
    if (still() || motion.is_none()) return;
    auto matrix = py::cast<Array<double>>(motion.attr("matrix"));
    if (matrix.size() % 12 != 0) throw std::invalid_argument("Camera: the matrices of its motion must be (K, 3, 4).");
    std::vector<cpu::Matrix> places;
    for (py::ssize_t at = 0; at < matrix.size(); at += 12) {
        std::copy(matrix.data() + at, matrix.data() + at + 12, spec.matrix);
        CameraView view = cpu::make_camera_view(spec, frame, input.origin);
        std::copy(std::begin(view.to_world.m), std::end(view.to_world.m), places.emplace_back().begin());
    }
    bool moves = std::any_of(places.begin(), places.end(), [&](const cpu::Matrix& m) { return m != places[0]; });
    if (moves) input.motion.camera = cpu::make_keys(places);
    if (motion.attr("lens_mm").is_none() || spec.kind != "PERSP") return;
    auto lens = py::cast<std::array<double, 2>>(motion.attr("lens_mm"));
    input.motion.zooms = lens[0] != spec.lens_mm || lens[1] != spec.lens_mm;
    for (size_t end = 0; end < 2; end++) {
        spec.lens_mm = lens[end];
        input.motion.camera_ends[end] = cpu::make_camera_view(spec, frame, input.origin);
    }
}

void Reader::read_shutter(const py::object& shutter) {
    if (shutter.is_none()) return;
    input.motion.shutter = true;
    py::object curve = shutter.attr("curve");
    if (!curve.is_none()) {
        auto open = py::cast<Array<float>>(curve);
        input.motion.curve.assign(open.data(), open.data() + open.size());
    }
    if (!shutter.attr("rolling").is_none()) input.motion.rolling = py::cast<float>(shutter.attr("rolling"));
}

void Reader::read_camera(const py::object& camera, const py::object& film) {
    cpu::CameraSpec spec = bindings::read_camera(camera);
    cpu::FrameSpec frame = read_frame(film);
    input.camera = cpu::make_camera_view(spec, frame, input.origin);
    read_camera_motion(camera.attr("motion"), spec, frame);
    input.frame_width = u32(frame.width);
    input.frame_height = u32(frame.height);
}

void Reader::read_film(const py::object& film) {
    input.filter =
        cpu::make_pixel_filter(py::cast<std::string>(film.attr("filter")), py::cast<double>(film.attr("filter_width")));
    cpu::FilmSpec& spec = input.film;
    spec.width = py::cast<u32>(film.attr("width"));
    spec.height = py::cast<u32>(film.attr("height"));
    if (!film.attr("border").is_none()) {
        auto border = py::cast<std::array<u32, 4>>(film.attr("border"));
        spec.x0 = border[0], spec.y0 = border[1];
        spec.width = border[2] - border[0], spec.height = border[3] - border[1];
    }
    std::copy(input.origin, input.origin + 3, spec.origin);
    spec.exposure = py::cast<float>(film.attr("exposure"));
    spec.passes = py::cast<std::vector<std::string>>(film.attr("passes"));
    spec.cryptomatte_depth = py::cast<u32>(film.attr("cryptomatte_depth"));
    spec.lightgroups = lightgroups;
    for (auto aov : py::cast<py::list>(film.attr("aovs"))) {
        auto pair = py::cast<py::tuple>(aov);
        spec.aovs.push_back({py::cast<std::string>(pair[0]), py::cast<std::string>(pair[1]) == "COLOR"});
    }
    auto mist = py::cast<py::tuple>(film.attr("mist"));
    input.mist_start = py::cast<float>(mist[0]);
    input.mist_depth = py::cast<float>(mist[1]);
    std::string falloff = py::cast<std::string>(mist[2]);
    input.mist_exponent = falloff == "LINEAR" ? 1.0f : falloff == "INVERSE_QUADRATIC" ? 0.5f : 2.0f;
    input.limits.film_transparent = py::cast<bool>(film.attr("transparent"));
    input.limits.film_transparent_glass = py::cast<bool>(film.attr("transparent_glass"));
    input.limits.film_transparent_roughness = py::cast<float>(film.attr("transparent_roughness"));
    input.limits.alpha_threshold = py::cast<float>(film.attr("alpha_threshold"));
}

void Reader::read_names() {
    py::object film = scene.attr("film");
    lightgroups = py::cast<std::vector<std::string>>(film.attr("lightgroups"));
    for (auto aov : py::cast<py::list>(film.attr("aovs")))
        aovs.push_back(py::cast<std::string>(py::cast<py::tuple>(aov)[0]));
    auto origin = py::cast<std::array<double, 3>>(scene.attr("origin"));
    std::copy(origin.begin(), origin.end(), input.origin);
}

void Reader::read_view() {
    py::object film = scene.attr("film");
    named("Film", [&] { read_film(film); });
    named("Settings", [&] { read_settings(scene.attr("settings")); });
    named("Camera", [&] { read_camera(scene.attr("camera"), film); });
    named("Shutter", [&] { read_shutter(scene.attr("shutter")); });
}

void Reader::read_curve_settings(const py::object& settings) {
    constexpr std::pair<const char*, CurveShape> SHAPES[] = {
        {"RIBBON", CurveShape::RIBBON}, {"THICK", CurveShape::THICK}, {"THICK_LINEAR", CurveShape::THICK_LINEAR}};
    auto name = py::cast<std::string>(settings.attr("curve_shape"));
    auto found = std::find_if(std::begin(SHAPES), std::end(SHAPES), [&](auto& s) { return name == s.first; });
    if (found == std::end(SHAPES))
        throw std::invalid_argument("Curve shape \"" + name + "\" is not known; take RIBBON, THICK or THICK_LINEAR.");
    store.view().curve_shape = found->second;
    store.view().log2_pieces = log2_pieces_of(found->second, py::cast<u32>(settings.attr("curve_subdivisions")));
}

void Reader::read_settings(const py::object& settings) {
    auto count = [&](const char* name) { return py::cast<u32>(settings.attr(name)); };
    auto number = [&](const char* name) { return py::cast<float>(settings.attr(name)); };
    auto bounces = [&](const char* kind) { return py::cast<u32>(settings.attr("bounces")(kind)); };
    PathLimits& limits = input.limits;
    // As in Cycles 0 bounces still mean direct light, so limits count one more; of transparency 0 means none.
    limits.bounces = count("max_bounces") + 1;
    limits.diffuse = bounces("diffuse") + 1;
    limits.glossy = bounces("glossy") + 1;
    limits.transmission = bounces("transmission") + 1;
    limits.volume = bounces("volume") + 1;
    limits.transparent = bounces("transparent");
    limits.min_bounces = count("min_light_bounces") + 1;
    limits.min_transparent = count("min_transparent_bounces") + 1;
    limits.clamp_direct = number("clamp_direct");
    limits.clamp_indirect = number("clamp_indirect");
    limits.filter_glossy = number("filter_glossy");
    limits.caustics_reflective = py::cast<bool>(settings.attr("caustics_reflective"));
    limits.caustics_refractive = py::cast<bool>(settings.attr("caustics_refractive"));
    limits.ao_distance = number("ao_distance");
    input.photon_maps = py::cast<bool>(settings.attr("photon_maps"));
    input.light_tree = py::cast<bool>(settings.attr("light_tree"));
    read_curve_settings(settings);
    input.seed = count("seed");
    input.sampler = named_sampler(py::cast<std::string>(settings.attr("sampler")));
    input.samples = count("samples");
    input.first_sample = count("first_sample");
    input.samples_in_all = count("samples_in_all");
    input.threads = count("threads");
    input.film.marks = py::cast<bool>(settings.attr("estimate_error"));
    input.accel = cpu::accel_request(py::cast<std::string>(settings.attr("accelerator")),
                                     py::cast<std::string>(settings.attr("precision")));
    for (const auto& name : py::cast<std::vector<std::string>>(settings.attr("force_effects")))
        force(input.forced, name);
    double time_limit_s = py::cast<double>(settings.attr("time_limit"));
    if (time_limit_s > 0.0) input.accel.time_limit_s = time_limit_s;
}

}  // namespace luch::bindings
