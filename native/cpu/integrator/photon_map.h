// The photons of one map, and the pilot that tells how far to look for them.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "cpu/thread_pool.h"
#include "luch/integrator/render_view.h"

namespace luch::cpu {

// Starts for each sample of all pixels: as many as pixels, within these.
inline constexpr u32 FEWEST_STARTS = 1u << 13, MOST_STARTS = 1u << 18;
u32 starts_for(u64 pixels);

// Of the pilot: so many times those of a sample, within these.
inline constexpr u32 PILOT_TIMES = 4, FEWEST_PILOTS = 1u << 15, MOST_PILOTS = 1u << 18;
u32 pilot_starts_for(u64 pixels);

// Photons traced before the first map. They tell the levels' radii and, place by place, which level is fine enough.
class PhotonPilot {
 public:
    // photons: of a pilot for a picture of so many pixels; reach: the scene's size, metres, for too few to tell.
    void build(const std::vector<Photon>& photons, u64 pixels, float reach);
    bool has_looked() const { return radius_ > 0.0f; }
    // The map whose first sample that is, of so many starts and photons, but for the arrays that hold these.
    PhotonMap map(u32 sample, u32 starts, u64 photons) const;
    const std::vector<u16>& expected(u32 level) const { return expected_[level]; }

 private:
    float radius_ = 0.0f;  // of the first map's finest level
    u32 enough_ = 0, expected_mask_ = 0;
    std::array<std::vector<u16>, PHOTON_LEVELS> expected_;
};

class PhotonStore {
 public:
    // map: as PhotonPilot has it; photons in their order (photon_order).
    void build(const PhotonMap& map, std::vector<Photon> photons, ThreadPool& pool);
    const PhotonMap& view() const { return view_; }
    std::size_t bytes() const;

 private:
    std::vector<Photon> photons_;
    struct Level {
        std::vector<PhotonPlace> places;
        std::vector<u32> first;
    };
    std::array<Level, PHOTON_LEVELS> levels_;
    PhotonMap view_{};
};

}  // namespace luch::cpu
