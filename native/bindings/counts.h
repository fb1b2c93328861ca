// The counters of rays as Python sees them.
#pragma once
#include <pybind11/pybind11.h>

#include "luch/accel/primitives.h"

namespace luch::bindings {

inline pybind11::dict counts(const Counters& total) {
    pybind11::dict out;
    out["nodes"] = total.nodes;
    out["boxes"] = total.boxes;
    out["primitives"] = total.primitives;
    out["bytes"] = total.bytes;
    return out;
}

}  // namespace luch::bindings
