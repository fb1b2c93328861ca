#include "cpu/volume/media.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cpu/volume/camera_media.h"
#include "cpu/volume/phase_tables.h"
#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

float coefficient(float x) { return x >= THINNEST_MEDIUM ? std::min(x, DENSEST_MEDIUM) : 0.0f; }  // NaN: 0
Color coefficient(Color c) { return {coefficient(c.x), coefficient(c.y), coefficient(c.z)}; }

Color radiance(Color c) {
    auto part = [](float x) { return std::isfinite(x) ? x : 0.0f; };
    return {part(c.x), part(c.y), part(c.z)};
}

}  // namespace

u32 MediaStore::add(const MediumInput& input) {
    MediumView medium{};
    medium.absorption = coefficient(input.absorption);
    medium.emission = radiance(input.emission);
    medium.first_lobe = u32(lobes_.size());
    for (const PhaseInput& phase : input.scattering) {
        PhaseLobe lobe{PhaseKind::TABLE, 0.0f, u32(tables_.size()), coefficient(phase.scattering)};
        if (is_zero(lobe.sigma_s)) continue;
        if (phase.kind == "HENYEY_GREENSTEIN") {
            lobe.kind = PhaseKind::HENYEY_GREENSTEIN;
            lobe.g = std::clamp(phase.a, -SHARPEST_PHASE, SHARPEST_PHASE);
        } else if (phase.kind == "DRAINE" || phase.kind == "FOURNIER_FORAND") {
            bool draine = phase.kind == "DRAINE";
            if (draine) lobe.g = std::clamp(phase.a, -SHARPEST_PHASE, SHARPEST_PHASE);
            auto table = draine ? draine_table(lobe.g, phase.b) : fournier_forand_table(phase.a, phase.b);
            tables_.insert(tables_.end(), table.begin(), table.end());
        } else {
            throw std::invalid_argument("Volume: the phase function \"" + phase.kind + "\" is not known.");
        }
        medium.scattering += lobe.sigma_s;
        lobes_.push_back(lobe);
    }
    medium.lobe_count = u32(lobes_.size()) - medium.first_lobe;
    if (is_zero(medium.absorption) && is_zero(medium.emission) && is_zero(medium.scattering)) return NONE;
    media_.push_back(medium);
    return u32(media_.size() - 1);
}

bool MediaStore::shown(const SceneView& scene) const { return world_ != NONE || any_medium(scene); }

MediaView MediaStore::view(const SceneView& scene, const CameraView& camera, float frame_width,
                           float frame_height) const {
    MediaView view{};
    view.media = media_.data();
    view.lobes = lobes_.data();
    view.phase_tables = tables_.data();
    view.count = u32(media_.size());
    view.world = world_;
    place_camera(scene, camera, frame_width, frame_height, &view);
    return view;
}

void MediaStore::describe(DeviceImage& image, u32 block, const MediaView& view) const {
    image.add_array("media", block, view.media, media_.size());
    image.add_array("phase_lobes", block, view.lobes, lobes_.size());
    image.add_array("phase_tables", block, view.phase_tables, tables_.size());
}

}  // namespace luch::cpu
