// Settings.force_effects: names of luch.effects -> what the core does for them though the scene does not call for it.
#pragma once
#include <string>

#include "bindings/bind.h"
#include "cpu/integrator/renderer.h"

namespace luch::bindings {

struct Forcible {
    const char* name;
    bool cpu::ForcedWork::* work;
};
inline constexpr Forcible FORCIBLE[] = {
    {"depth of field", &cpu::ForcedWork::lens},
    {"visible lamps", &cpu::ForcedWork::lamps},
    {"transparent shadows", &cpu::ForcedWork::transparency},
    {"procedural world", &cpu::ForcedWork::world},
    {"emissive meshes", &cpu::ForcedWork::emission},
};

// Names that luch.effects.removal knows and this table does not are a matter of compiled code alone.
inline void force(cpu::ForcedWork& forced, const std::string& name) {
    for (const Forcible& effect : FORCIBLE)
        if (name == "ALL" || name == effect.name) forced.*effect.work = true;
}

inline py::list forcible_effects() {
    py::list names;
    for (const Forcible& effect : FORCIBLE) names.append(effect.name);
    return names;
}

}  // namespace luch::bindings
