// Maps of photons, for a device that traces them itself.
#include "luch/integrator/photon_map.h"

#include <cstddef>
#include <cstring>

#include "bindings/bind.h"
#include "cpu/integrator/photon_map.h"

namespace luch::bindings {
namespace {

// PhotonPilot, for photons that a device has traced.
class PyPhotonPilot {
 public:
    PyPhotonPilot(const py::array_t<u8, py::array::c_style>& photons, u64 pixels, float reach) {
        if (size_t(photons.size()) % sizeof(Photon) != 0) throw py::value_error("photons: whole records are needed");
        std::vector<Photon> read(size_t(photons.size()) / sizeof(Photon));
        if (!read.empty()) std::memcpy(static_cast<void*>(read.data()), photons.data(), size_t(photons.size()));
        pilot_.build(read, pixels, reach);
    }
    // luch::PhotonMap, whose pointers the device sets.
    py::bytes map(u32 sample, u32 starts, u64 photons) const {
        const PhotonMap map = pilot_.map(sample, starts, photons);
        char bytes[sizeof(map)];
        std::memcpy(bytes, &map, sizeof(map));
        return py::bytes(bytes, sizeof(bytes));
    }
    // uint16, level by level.
    py::list expected() const {
        py::list levels;
        for (u32 l = 0; l < PHOTON_LEVELS; ++l)
            levels.append(py::array_t<u16>(py::ssize_t(pilot_.expected(l).size()), pilot_.expected(l).data()));
        return levels;
    }

 private:
    cpu::PhotonPilot pilot_;
};

// Where luch/cuda/photons.py finds what it sets in a luch::PhotonMap, and what it needs to know of its levels.
py::dict map_layout() {
    py::dict layout;
    layout["photons"] = offsetof(PhotonMap, photons);
    layout["levels"] = offsetof(PhotonMap, levels);
    layout["level_size"] = sizeof(PhotonLevel);
    layout["places"] = offsetof(PhotonLevel, places);
    layout["first"] = offsetof(PhotonLevel, first);
    layout["expected"] = offsetof(PhotonLevel, expected);
    layout["mask"] = offsetof(PhotonLevel, mask);
    layout["radius"] = offsetof(PhotonLevel, radius);
    layout["inverse_cell"] = offsetof(PhotonLevel, inverse_cell);
    layout["level_count"] = PHOTON_LEVELS;
    layout["pilot_map"] = PILOT_MAP;
    layout["start_word"] = offsetof(Photon, start) / sizeof(u32);
    layout["bounce_word"] = offsetof(Photon, bounce) / sizeof(u32);
    return layout;
}

}  // namespace

void bind_photons(py::module_& m) {
    auto photons = m.def_submodule("photons", "Maps of photons, as luch.cuda.photons makes them.");
    py::class_<PyPhotonPilot>(photons, "PhotonPilot")
        .def(py::init<const py::array_t<u8, py::array::c_style>&, u64, float>(), py::arg("photons"), py::arg("pixels"),
             py::arg("reach"),
             "photons: uint8, records of luch::Photon in their order, of pilot_starts(pixels) starts; reach: metres.")
        .def("map", &PyPhotonPilot::map, py::arg("sample"), py::arg("starts"), py::arg("photons"))
        .def("expected", &PyPhotonPilot::expected);
    photons.def("layout", &map_layout);
    photons.def("starts", &cpu::starts_for, py::arg("pixels"), "Photons that start for each sample of all pixels.");
    photons.def("pilot_starts", &cpu::pilot_starts_for, py::arg("pixels"), "And before the first.");
    photons.def("first_of_map", &first_of_map, py::arg("sample"), "The first sample of the map that serves this one.");
    photons.def("samples_of_map", &samples_of_map, py::arg("sample"), py::arg("count"),
                "How many samples from this one on, at most count, the same map serves.");
    photons.attr("MOST_SAMPLES_OF_MAP") = MOST_SAMPLES_OF_MAP;
}

}  // namespace luch::bindings
