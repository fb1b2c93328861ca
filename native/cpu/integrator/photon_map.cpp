#include "cpu/integrator/photon_map.h"

#include <algorithm>
#include <cmath>

#include "luch/integrator/photon_map.h"
#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

// Photons of the first map that a point gathers: enough for a mean, few enough for sharp edges. Later maps have more
// photons and shorter radii, and the picture is the mean of all.
constexpr u32 NEAR_PHOTONS = 1;
// The cells around a ball hold so many times what it holds, of photons on a plane: 16 to pi.
constexpr double CELLS_TO_DISC = 5.0;
// Pilot's photons whose neighbours are counted, and the part of them that lies closer than the finest radius asks for.
constexpr size_t ASKED = 512;
constexpr double CLOSEST_PART = 0.1;
// What a bucket of the pilot counts to: far above what is enough.
constexpr u16 MOST_EXPECTED = 0xffff;
// Below, their places tell nothing.
constexpr size_t FEWEST_TO_TELL = 64;

// The power of two above, less one.
u32 bucket_mask(u64 photons) {
    u32 buckets = 1u;
    while (buckets < photons && buckets < MOST_BUCKETS) buckets *= 2u;
    return buckets - 1u;
}

// Distance of the nth neighbour that a tenth of the photons have within, or of all.
float close_distance(const std::vector<Photon>& photons, size_t nth) {
    std::vector<float> distances(photons.size()), radii;
    const size_t stride = std::max<size_t>(1, photons.size() / ASKED);
    for (size_t i = 0; i < photons.size(); i += stride) {
        for (size_t k = 0; k < photons.size(); k++) distances[k] = length_squared(photons[k].point - photons[i].point);
        std::nth_element(distances.begin(), distances.begin() + std::ptrdiff_t(nth), distances.end());
        radii.push_back(std::sqrt(distances[nth]));
    }
    const std::ptrdiff_t at = std::ptrdiff_t(double(radii.size()) * CLOSEST_PART);
    std::nth_element(radii.begin(), radii.begin() + at, radii.end());
    return radii[size_t(at)];
}

}  // namespace

u32 starts_for(u64 pixels) { return u32(std::clamp(pixels, u64(FEWEST_STARTS), u64(MOST_STARTS))); }

u32 pilot_starts_for(u64 pixels) { return std::clamp(PILOT_TIMES * starts_for(pixels), FEWEST_PILOTS, MOST_PILOTS); }

void PhotonPilot::build(const std::vector<Photon>& photons, u64 pixels, float reach) {
    const u32 starts = starts_for(pixels);
    const double wanted = double(NEAR_PHOTONS) * double(pilot_starts_for(pixels)) / double(starts);
    enough_ = u32(std::ceil(wanted * CELLS_TO_DISC));
    radius_ = 0.0f;
    if (photons.size() >= FEWEST_TO_TELL) {
        const size_t nth = std::min(size_t(std::ceil(wanted)), photons.size() - 1);
        radius_ = close_distance(photons, nth) * float(std::sqrt(wanted / double(nth)));
    }
    if (!(radius_ > 0.0f && finite_f(radius_))) radius_ = UNTOLD_RADIUS * reach;
    expected_mask_ = bucket_mask(2 * photons.size());
    const PhotonMap first = map(0, starts, photons.size());
    for (u32 l = 0; l < PHOTON_LEVELS; l++) {
        const PhotonLevel& level = first.levels[l];
        expected_[l].assign(size_t(level.expected_mask) + 1, 0);
        for (const Photon& photon : photons) {
            u16& count = expected_[l][bucket_of(cell_of(photon.point, level.expected_inverse_cell), expected_mask_)];
            if (count < MOST_EXPECTED) count++;
        }
    }
}

PhotonMap PhotonPilot::map(u32 sample, u32 starts, u64 photons) const {
    PhotonMap map{};
    map.count = u32(photons);
    map.enough = enough_;
    const float shrunk = std::pow(float(sample) + 1.0f, RADIUS_EXPONENT);
    for (u32 l = 0; l < PHOTON_LEVELS; l++) {
        PhotonLevel& level = map.levels[l];
        const float first = radius_ * float(1u << l);
        level.mask = bucket_mask(photons);
        level.expected_mask = expected_mask_;
        level.expected = expected_[l].data();
        level.expected_inverse_cell = 0.5f / first;
        level.radius = first * shrunk;
        level.inverse_cell = 0.5f / level.radius;
        level.scale = float(1.0 / (double(starts) * double(PI) * double(level.radius) * double(level.radius)));
    }
    return map;
}

void PhotonStore::build(const PhotonMap& map, std::vector<Photon> photons, ThreadPool& pool) {
    view_ = map;
    photons_ = std::move(photons);
    view_.photons = photons_.data();
    pool.parallel_for(PHOTON_LEVELS, 1, [&](size_t begin, size_t end, unsigned) {
        std::vector<u32> buckets(photons_.size());
        for (size_t l = begin; l < end; l++) {
            PhotonLevel& level = view_.levels[l];
            Level& own = levels_[l];
            own.places.resize(photons_.size());
            own.first.assign(size_t(level.mask) + 2, 0);
            for (size_t i = 0; i < photons_.size(); i++) {
                buckets[i] = bucket_of(cell_of(photons_[i].point, level.inverse_cell), level.mask);
                own.first[size_t(buckets[i]) + 1]++;
            }
            for (size_t b = 1; b < own.first.size(); b++) own.first[b] += own.first[b - 1];
            std::vector<u32> next(own.first.begin(), own.first.end() - 1);
            for (size_t i = 0; i < photons_.size(); i++) own.places[next[buckets[i]]++] = {photons_[i].point, u32(i)};
            level.places = own.places.data();
            level.first = own.first.data();
        }
    });
}

std::size_t PhotonStore::bytes() const {
    std::size_t sum = photons_.size() * sizeof(Photon);
    for (const Level& level : levels_)
        sum += level.places.size() * sizeof(PhotonPlace) + level.first.size() * sizeof(u32);
    return sum;
}

}  // namespace luch::cpu
