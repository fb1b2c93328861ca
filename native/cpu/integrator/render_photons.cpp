// The part of a renderer that makes photon maps.
#include <algorithm>

#include "cpu/integrator/renderer.h"
#include "cpu/seconds.h"
#include "luch/integrator/photon_map.h"

namespace luch::cpu {

// Volumes scatter photons on their way, which nobody follows there: scenes with them stay with paths.
void Renderer::find_casters() {
    if (!input_.photon_maps || scene_.has_media || !scene_.has_lights) return;
    scene_.casters_store.build(scene_.view, store_->materials(), scene_.max_registers, pool_);
    scene_.casters = scene_.casters_store.view();
    stats_.scene_bytes += scene_.casters_store.bytes();
    scene_.photon_maps = scene_.casters.count > 0;
}

// The photons of so many starts, in their order. Throws Cancelled.
std::vector<Photon> Renderer::trace_photons(u32 map, u32 starts) {
    std::vector<std::vector<Photon>> pieces((starts + BATCH_PATHS - 1) / BATCH_PATHS);
    pool_.parallel_for(pieces.size(), 1, [&](size_t begin, size_t end, unsigned worker) {
        for (size_t i = begin; i < end && !cancelled_.load(std::memory_order_relaxed); i++) {
            const u32 first = u32(i) * u32(BATCH_PATHS);
            batches_[worker]->trace_photons(map, first, std::min(u32(BATCH_PATHS), starts - first), &pieces[i]);
            std::sort(pieces[i].begin(), pieces[i].end(),
                      [](const Photon& a, const Photon& b) { return photon_order(a) < photon_order(b); });
        }
    });
    if (cancelled_.load()) throw Cancelled();
    std::vector<Photon> landed;
    for (const std::vector<Photon>& piece : pieces) landed.insert(landed.end(), piece.begin(), piece.end());
    return landed;
}

// The map of which that is the first sample. Throws Cancelled, and then there is none.
void Renderer::build_photon_map(u32 map) {
    const double start = seconds_now();
    const u64 pixels = u64(film_->view().width) * film_->view().height;
    map_sample_ = NONE;
    if (!scene_.photon_pilot.has_looked())
        scene_.photon_pilot.build(trace_photons(PILOT_MAP, pilot_starts_for(pixels)), pixels, scene_.casters.reach);
    const u32 starts = starts_for(pixels) * samples_of_map(map, MOST_SAMPLES_OF_MAP);
    std::vector<Photon> landed = trace_photons(map, starts);
    const PhotonMap described = scene_.photon_pilot.map(map, starts, landed.size());
    scene_.photon_store.build(described, std::move(landed), pool_);
    scene_.photons = scene_.photon_store.view();
    map_sample_ = map;
    stats_.photon_maps++;
    stats_.photon_radius = scene_.photons.levels[0].radius;
    stats_.photon_map_bytes = scene_.photon_store.bytes();
    stats_.photon_seconds += seconds_now() - start;
}

// The map that serves a sample, unless it is at hand. False when cancelled.
bool Renderer::make_photon_map(u32 sample) {
    const u32 map = first_of_map(sample);
    try {
        if (map != map_sample_) build_photon_map(map);
    } catch (const Cancelled&) {
        return false;
    }
    return true;
}

}  // namespace luch::cpu
