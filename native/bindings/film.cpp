// The film in Python: what luch.render returns, and a hand-fed one for tests.
#include "bindings/film.h"

#include <pybind11/stl.h>

#include "bindings/bind.h"
#include "cpu/error_sums.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

// Feeds one pixel the rows of `values` as successive samples of one pass; returns how many rows were
// not finite. channels 1: a value, 3: a colour, 4: a colour and transparency (Combined).
u64 add_samples(cpu::Film& film, u32 pixel, u32 channel, const Floats& values) {
    if (values.ndim() != 2) throw py::value_error("values must have shape (N, channels)");
    u64 refused[REFUSALS] = {};
    FilmWriter writer{film.view(), refused};
    py::ssize_t channels = values.shape(1);
    for (py::ssize_t i = 0; i < values.shape(0); ++i) {
        const float* v = values.data(i, 0);
        if (channels == 1) film_add(writer, pixel, channel, v[0]);
        if (channels >= 3) film_add(writer, pixel, channel, Color{v[0], v[1], v[2]});
        if (channels == 4) film_add(writer, pixel, channel + 3, v[3]);
    }
    return refused[REFUSED_DATA];
}

// Of a picture: all processors, or one where it has fewer pixels than are worth more.
unsigned threads_for(u64 pixels, u64 worth_more) { return pixels < worth_more ? 1 : 0; }
constexpr u64 WORTH_READING = 65536, WORTH_ESTIMATING = 16384;

}  // namespace

cpu::FilmSpec read_film(const py::handle& film, const py::handle& origin) {
    cpu::FilmSpec spec;
    spec.width = film.attr("width").cast<u32>();
    spec.height = film.attr("height").cast<u32>();
    if (py::object border = film.attr("border"); !border.is_none()) {
        auto [x0, y0, x1, y1] = border.cast<std::tuple<u32, u32, u32, u32>>();
        if (!(x0 < x1 && y0 < y1 && x1 <= spec.width && y1 <= spec.height))
            throw py::value_error("Film: border must be x0 < x1 <= width, y0 < y1 <= height");
        spec.x0 = x0, spec.y0 = y0, spec.width = x1 - x0, spec.height = y1 - y0;
    }
    py::sequence place = py::reinterpret_borrow<py::sequence>(origin);
    for (int k = 0; k < 3; ++k) spec.origin[k] = place[k].cast<double>();
    spec.exposure = film.attr("exposure").cast<float>();
    spec.passes = film.attr("passes").cast<std::vector<std::string>>();
    spec.cryptomatte_depth = film.attr("cryptomatte_depth").cast<u32>();
    spec.lightgroups = film.attr("lightgroups").cast<std::vector<std::string>>();
    for (const auto& [name, kind] : film.attr("aovs").cast<std::vector<std::pair<std::string, std::string>>>())
        spec.aovs.push_back({name, kind == "COLOR"});
    return spec;
}

py::dict resolve_film(const cpu::Film& film) {
    py::dict passes;
    std::vector<float*> out;
    for (const cpu::Pass& pass : film.passes()) {
        Floats pixels({py::ssize_t{film.height()}, py::ssize_t{film.width()}, py::ssize_t{pass.from.channels}});
        out.push_back(pixels.mutable_data());
        passes[py::str(pass.name)] = pixels;
    }
    py::gil_scoped_release release;
    // Threads of its own: a renderer's may be busy with the next step. Small films are not worth any.
    cpu::ThreadPool pool(threads_for(u64{film.width()} * film.height(), WORTH_READING));
    film.resolve(out, pool);
    return passes;
}

py::tuple film_deviations(const cpu::Film& film) {
    py::ssize_t height = film.height(), width = film.width();
    Floats mean({height, width, py::ssize_t{3}}), deviation({height, width, py::ssize_t{3}});
    double before = 0.0;
    float *to_mean = mean.mutable_data(), *to_deviation = deviation.mutable_data();
    {
        py::gil_scoped_release release;
        cpu::ThreadPool pool(threads_for(u64{film.width()} * film.height(), WORTH_READING));
        before = film.deviations(to_mean, to_deviation, pool);
    }
    return py::make_tuple(mean, deviation, before);
}

py::tuple film_arrays(cpu::Film& film, const py::object& owner) {
    FilmView view = film.view();
    py::ssize_t pixels = py::ssize_t(view.width) * py::ssize_t(view.height), stride = py::ssize_t(view.layout.stride);
    py::array_t<double> rows({pixels, stride}, {stride * 8, py::ssize_t{8}}, view.rows, owner);
    py::array_t<u32> counts({pixels}, {py::ssize_t{4}}, view.sample_counts, owner);
    return py::make_tuple(rows, counts);
}

namespace {

cpu::ErrorRules error_rules(const py::dict& named) {
    auto whole = [&](const char* name) { return named[name].cast<i64>(); };
    return {named["dark"].cast<double>(),
            whole("pool_radius"),
            whole("near"),
            whole("guide_radius"),
            named["sure"].cast<float>(),
            named["edge_gap"].cast<float>(),
            named["gap_variances"].cast<float>(),
            whole("tile"),
            named["fireflies"].cast<double>()};
}

cpu::NoisyPicture noisy_picture(const Floats& mean, const Floats& deviation, double share) {
    for (const Floats& image : {mean, deviation})
        if (image.ndim() != 3 || image.shape(2) != 3 || image.shape(0) != mean.shape(0) ||
            image.shape(1) != mean.shape(1))
            throw py::value_error("mean and deviation must have one shape (H, W, 3)");
    return {mean.shape(0), mean.shape(1), mean.data(), deviation.data(), share};
}

// threads 0: as many as the picture is worth.
unsigned threads_for(const cpu::NoisyPicture& picture, unsigned threads) {
    return threads ? threads : threads_for(u64(picture.height * picture.width), WORTH_ESTIMATING);
}

// Of each guess at the truth, the nearest first: float64 (H, W).
py::list relative_squares(const Floats& mean, const Floats& deviation, double share, const py::dict& named,
                          unsigned threads) {
    const cpu::NoisyPicture picture = noisy_picture(mean, deviation, share);
    const cpu::ErrorRules rules = error_rules(named);
    py::list squares;
    std::vector<double*> out;
    for (i64 guess = 0; guess < rules.guide_radius; ++guess) {
        py::array_t<double> plane({mean.shape(0), mean.shape(1)});
        out.push_back(plane.mutable_data());
        squares.append(plane);
    }
    py::gil_scoped_release release;
    cpu::ThreadPool pool(threads_for(picture, threads));
    cpu::relative_squares(picture, rules, out.data(), pool);
    return squares;
}

py::dict error_sums(const Floats& mean, const Floats& deviation, double share, const py::dict& named,
                    unsigned threads) {
    const cpu::NoisyPicture picture = noisy_picture(mean, deviation, share);
    const cpu::ErrorRules rules = error_rules(named);
    cpu::ErrorSums sums;
    {
        py::gil_scoped_release release;
        cpu::ThreadPool pool(threads_for(picture, threads));
        sums = cpu::error_sums(picture, rules, pool);
    }
    py::array_t<double> tiles({py::ssize_t(sums.tile_rows), py::ssize_t(sums.tile_columns)});
    std::copy(sums.tiles.begin(), sums.tiles.end(), tiles.mutable_data());
    py::dict told;
    told["pixels"] = sums.pixels;
    told["squares"] = sums.squares;
    told["pooled"] = sums.pooled;
    told["largest"] = sums.largest;
    told["brightness"] = sums.brightness;
    told["tiles"] = tiles;
    return told;
}

}  // namespace

void bind_film(py::module_& m) {
    auto film = m.def_submodule("film", "Sums of samples, and render passes read from them.");
    film.def("relative_squares", &relative_squares, py::arg("mean"), py::arg("deviation"), py::arg("share"),
             py::arg("rules"), py::arg("threads") = 0);
    film.def("error_sums", &error_sums, py::arg("mean"), py::arg("deviation"), py::arg("share"), py::arg("rules"),
             py::arg("threads") = 0);
    py::class_<cpu::Film>(film, "Film")
        .def(py::init([](const py::handle& settings, const py::handle& origin, bool marks) {
                 cpu::FilmSpec spec = read_film(settings, origin);
                 spec.marks = marks;
                 return std::make_unique<cpu::Film>(spec);
             }),
             py::arg("film"), py::arg("origin") = py::make_tuple(0.0, 0.0, 0.0), py::arg("marks") = false)
        .def("channel",
             [](const cpu::Film& self, const std::string& name) {
                 for (const cpu::Pass& pass : self.passes())
                     if (pass.name == name) return pass.from.channel;
                 throw py::key_error(name);
             })
        .def("stride", [](cpu::Film& self) { return self.view().layout.stride; })
        .def("add_samples", &add_samples, py::arg("pixel"), py::arg("channel"), py::arg("values"))
        .def("add_crypto",
             [](cpu::Film& self, u32 pixel, u32 channel, float id, float weight) {
                 FilmWriter writer{self.view(), nullptr};
                 film_add_crypto(writer, pixel, channel, id, weight);
             })
        .def("set_first",
             [](cpu::Film& self, u32 pixel, float depth, const std::array<float, 3>& position) {
                 FilmWriter writer{self.view(), nullptr};
                 film_set(writer, pixel, writer.film.layout.depth, depth);
                 film_set_position(writer, pixel, {position[0], position[1], position[2]});
             })
        .def("set_background",
             [](cpu::Film& self, u32 pixel) {
                 FilmWriter writer{self.view(), nullptr};
                 film_set_background(writer, pixel);
             })
        .def(
            "count_samples",
            [](cpu::Film& self, u32 pixel, u32 samples) {
                FilmWriter writer{self.view(), nullptr};
                film_count_samples(writer, pixel, samples);
            },
            py::arg("pixel"), py::arg("samples"))
        .def("mark",
             [](cpu::Film& self, u32 pixel, u32 sample) {
                 FilmWriter writer{self.view(), nullptr};
                 film_mark(writer, pixel, sample);
             })
        .def("marks", [](cpu::Film& self) { return self.view().layout.marks; })
        .def(
            "arrays", [](const py::object& self) { return film_arrays(self.cast<cpu::Film&>(), self); },
            "The sums (pixels, channels) float64 and sample counts (pixels,) uint32, to be read and written.")
        .def("merge", &cpu::Film::merge)
        .def("resolve", &resolve_film)
        .def("deviations", &film_deviations);
}

}  // namespace luch::bindings
