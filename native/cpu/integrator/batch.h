// One thread's batch of paths and the stages that move it on: generate, traverse, sort by material,
// shade, shadow, accumulate. A batch lives in one core's second-level cache; all its memory is taken once.
#pragma once
#include <atomic>
#include <memory>
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/integrator/pixel_clock.h"
#include "cpu/integrator/render_scene.h"
#include "cpu/shade/interpreter.h"
#include "luch/integrator/subsurface.h"
#include "luch/integrator/volume.h"
#include "luch/shade/surface_setup.h"

namespace luch::cpu {

// 2,048 paths: 64 chunks of lanes to sort by material, and about 600 KiB with their rays.
inline constexpr int BATCH_PATHS = 2048;
// Samples of a pixel whose first random numbers are drawn in one loop.
inline constexpr int CAMERA_LANES = 16;

struct BatchCounts {
    u64 paths = 0, rays = 0, shadow_rays = 0, surface_points = 0;
    u64 refused[REFUSALS] = {};  // by cause
    u64 clamped = 0, cut = 0;   // as FilmWriter has them
    u64 lens_samples = 0;       // camera rays that chose a point of the aperture
    u64 time_samples = 0;       // and a time, where something moves
    u64 lamp_searches = 0;      // rays that looked for lamps on their way
    u64 transparent_steps = 0;  // surfaces that shadow rays looked through, one by one
    u64 world_points = 0;       // directions in which the world's program ran for a ray
    u64 light_points = 0;       // points on lights at which a program ran
    u64 subsurface_walks = 0, subsurface_steps = 0;
    u64 flights = 0;            // ways of rays through media
    u64 photons = 0, photons_landed = 0;  // started; records that they left

    void add(const BatchCounts& other);
};

struct PixelBlock {
    int x0, y0, width, height;  // full-frame pixels
    u32 first_sample, sample_count;
    int half;  // of a chessboard, counted from the corner: 0 its white fields, 1 its black ones; WHOLE: both
    static constexpr int WHOLE = -1;

    bool holds(int x, int y) const { return half == WHOLE || ((x + y) & 1) == half; }
};

class Batch {
 public:
    // stop: set from any thread, for good.
    Batch(const RenderScene& scene, const FilmView& film, const std::atomic<bool>& stop);
    ~Batch();

    // Traces block.width * block.height * block.sample_count <= BATCH_PATHS paths to their ends, into the
    // rows of the block's pixels. Told to stop, leaves them as they were: a batch may take seconds.
    void trace(const PixelBlock& block);

    // Starts photons [first, first + count), count <= BATCH_PATHS, of a map (its first sample), and appends the records
    // that they leave, in no order.
    void trace_photons(u32 map, u32 first, u32 count, std::vector<Photon>* landed);

    BatchCounts counts() const;

 private:
    // batch.cpp: the wavefront
    bool stops() const { return stop_.load(std::memory_order_relaxed); }
    void next_generation();
    void keep_pixel(u32 pixel);
    void undo(u32 sample_count);
    void generate(const PixelBlock& block);
    void generate_pixel(const PixelSampler& pixel, u32 px, u32 py, u32 first_sample, u32 count);
    void traverse();
    void meet_lamps();
    void shade_misses();
    void shade_world(const u32* queue, int count);
    void sort_hits_by_material();
    void shade_hits();
    void trace_shadows();

    // cross_media.cpp: what lies between surfaces, where the scene has media
    void cross_media();
    void cross_media(int k);
    void go_on(u32 path_index, u32 k);
    void pass_borders(u32 begin, u32 end);

    // shade_surface.cpp: one chunk of points that share a material
    void shade_chunk(u32 material, const u32* queue, int count);
    void send_next(const ShadePoints& points, int lane);
    void setup_chunk(const u32* queue, int count, ShadePoints& points);
    void draw_numbers(const u32* queue, int lit_count);

    // subsurface.cpp
    bool enters_subsurface(u32 k, int lane, const ClosureSet& set, const SurfacePoint& spawn, Vec3 u);
    void walk_subsurface();
    void shade_exits(u32 material, const u32* queue, int count);

    // photons.cpp
    void shade_photons(u32 material, const u32* queue, int count, std::vector<Photon>* landed);
    void gather(const u32* queue, int lit_count);

    // direct_light.cpp
    void sample_lights(const u32* queue, int lit_count);
    int choose_lights(const u32* queue, int lit_count, int* wanted);
    void emission_of_samples(const u32* queue, const int* lanes, int count);
    void push_shadow(bool made, u32 k);

    // The time since the last call goes to those who used it; nothing happens unless the Render Time pass is asked for.
    bool timed() const { return writer_.film.layout.time != NONE; }
    void charge_pixel(u32 pixel) {
        if (timed()) clock_.charge(writer_, 1, [&](int) { return pixel; });
    }
    void charge_rays(int begin, int end) {
        if (timed()) clock_.charge(writer_, end - begin, [&](int i) { return pixel_of(u32(begin + i)); });
    }
    void charge_queue(const u32* queue, int count) {
        if (timed()) clock_.charge(writer_, count, [&](int i) { return pixel_of(queue[i]); });
    }
    void charge_shadows(int begin, int end) {
        if (timed()) clock_.charge(writer_, end - begin, [&](int i) { return paths_[shadows_[begin + i].path].pixel; });
    }
    u32 pixel_of(u32 k) const { return paths_[ray_path_[k]].pixel; }

    // What the shared headers ask of a device: a light's or a transparent surface's program at one point, and a ray.
    struct OnePoint;

    const RenderScene& scene_;
    FilmWriter writer_;
    const std::atomic<bool>& stop_;
    BatchCounts counts_;
    PixelClock clock_;

    // The film before this batch.
    struct Before {
        std::vector<u32> pixels;
        std::vector<FilmSum> rows;
        BatchCounts counts;
        u64 clamped, cut;
    } before_;

    std::vector<PathState> paths_;
    // Rays under way, compact: entry k belongs to path ray_path_[k]. `next_` is the following generation.
    int ray_count_ = 0, next_count_ = 0;
    std::vector<Ray> rays_, next_rays_;
    std::vector<u32> ray_path_, next_path_, ray_kind_;
    std::vector<Hit> hits_;
    std::vector<u32> sorted_;            // ray entries that hit something, grouped by material
    std::vector<u32> material_first_;    // counting sort
    std::vector<u32> hit_material_;
    int shadow_count_ = 0;
    std::vector<Ray> shadow_rays_;
    std::vector<ShadowRay> shadows_;
    std::vector<u32> shadow_kind_;
    std::vector<u8> blocked_;
    std::vector<MediumStack> media_, shadow_media_;  // by path, by shadow ray; empty without media
    std::vector<float> ray_time_, next_time_, shadow_time_;  // of rays_, next_rays_, shadow_rays_; none: nothing moves
    float time_of(u32 k) const { return ray_time_.empty() ? SHUTTER_MIDDLE : ray_time_[k]; }

    int walk_count_ = 0;
    std::vector<SubsurfaceWalk> walks_;  // of this generation; none where nothing scatters under its surface

    struct Scratch;  // chunk-sized work space: points, closures, light samples
    std::unique_ptr<Scratch> scratch_;
    Registers registers_;
    std::vector<float> aovs_;
};

}  // namespace luch::cpu
