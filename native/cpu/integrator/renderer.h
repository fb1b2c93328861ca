// Renders a prepared scene, step by step: a step is a range of samples for every pixel of the frame.
#pragma once
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "cpu/accel/choice.h"
#include "cpu/accel/local_trees.h"
#include "cpu/accel/scene_trees.h"
#include "cpu/device_image.h"
#include "cpu/film.h"
#include "cpu/integrator/batch.h"
#include "cpu/integrator/render_scene.h"
#include "cpu/lights.h"
#include "cpu/motion/keys.h"
#include "cpu/scene_store.h"
#include "cpu/sky/world_sun.h"
#include "cpu/thread_pool.h"
#include "cpu/volume/media.h"
#include "luch/integrator/wavefront.h"

namespace luch::cpu {

// What is done though the scene does not call for it: to see what it would cost. No bit of the picture changes.
struct ForcedWork {
    bool lens = false;          // every path chooses a point of the aperture
    bool lamps = false;         // every ray looks for lamps, and every last bounce is followed
    bool transparency = false;  // every surface may let shadow rays through: its program decides
    bool world = false;         // the world's program runs for every ray that leaves
    bool emission = false;      // every surface may shine: its program decides
};

// What luch.scene says of the shutter and of a camera that moves.
struct MotionInput {
    bool shutter = false;               // it is open for a time; else all is still
    std::vector<float> curve;           // how far open at evenly spaced times; none: alike
    float rolling = -1.0f;              // as ShutterView's
    std::vector<TransformKey> camera;
    bool zooms = false;
    CameraView camera_ends[2]{};        // when it opens and when it closes, for the field of view
};

// From where and how a scene is looked at: all that may change while what is built stays.
struct ViewInput {
    CameraView camera{};
    u32 frame_width = 0, frame_height = 0;  // pixels of the full frame
    PixelFilter filter{};
    PathLimits limits{};
    FilmSpec film;
    u32 seed = 0, samples = 1;
    SamplerFamily sampler = SamplerFamily::SOBOL;
    u32 first_sample = 0, samples_in_all = 0;  // as luch.scene.Settings has them
    float mist_start = 0.0f, mist_depth = 25.0f, mist_exponent = 2.0f;
    double origin[3] = {0.0, 0.0, 0.0};
    MotionInput motion;
};

// What the renderer is made from, beside the SceneStore.
struct RenderInput : ViewInput {
    std::vector<LampInput> lamps;
    WorldInput world;
    MediaStore media;
    int world_map_width = 0;  // of the importance map, 0: no map
    std::vector<Color> material_emission_estimate;
    bool light_tree = true;
    bool photon_maps = false;  // caustics by photons
    AccelRequest accel;
    bool for_device = false;  // another device traces: no structures of this processor, no batches
    u64 device_builds_from = ~u64(0);  // triangles of a group whose tree that device builds itself
    unsigned threads = 0;
    ForcedWork forced;
};

// Tiles of 16 x 16 pixels with 8 samples each fill a batch; neighbouring rays meet the same nodes. luch/adaptive.py
// counts in the same tiles.
inline constexpr int TILE_SIZE = 16;

struct RenderStats {
    BatchCounts counts;
    AccelStats accel;
    std::string accel_name, accel_reason;
    u32 accel_builds = 0;  // for this picture: 0 where another's structures served
    double accel_seconds = 0.0, lights_seconds = 0.0, trace_seconds = 0.0, photon_seconds = 0.0;
    u64 photon_maps = 0;
    u64 photon_map_bytes = 0;    // of the last map
    float photon_radius = 0.0f;  // of its finest level, metres
    u64 scene_bytes = 0;
    u64 local_tree_bytes = 0;  // trees of what scatters under its surface
    u64 film_pixel_bytes = 0;  // what the film keeps of one pixel
};

// What rays are traced through, and what it was built of beside geometry.
struct Structures {
    std::unique_ptr<Accel> accel;
    std::string name, reason;
    std::vector<std::vector<u8>> transparency;  // SceneStore::transparency_flags
};

class Renderer {
 public:
    Renderer(std::unique_ptr<SceneStore> store, const RenderInput& input);
    ~Renderer();

    // Before prepare(): another renderer's structures are to be taken instead of building the same ones. The caller
    // vouches for the origin, the settings, meshes, instances and objects; materials may differ.
    void take_structures(const Renderer& other) { structures_ = other.structures_; }

    // Builds structures and lights, once, before the first render(). Returns false when cancelled.
    bool prepare();

    // After prepare(), while nothing else runs: the same scene looked at anew. Film, counts and seconds begin again, and
    // an earlier cancel is forgotten; nothing is built but, where the world's program reads the camera, lights. The
    // view's origin must be the one of before. Throws as the constructor, and nothing has changed then.
    void set_view(const ViewInput& view);
    // Whether set_view() builds lights.
    bool world_reads_camera() const { return world_reads_camera_; }

    // Rays through pixels all over the film, and how far from the origin the camera's place may be for a picture that
    // is as right as one with the origin there, metres (bounds.h); of what each ray meets, the distance along it and
    // the instance.
    std::vector<CameraRay> probe_rays() const;
    double origin_reach(const std::vector<CameraRay>& rays, const float* distances, const u32* instances) const;
    double origin_reach() const;  // as this processor traces them

    // Traces samples [first, first + count) of every pixel into the film. Returns false when cancelled; the
    // film then holds what was traced, pixel by pixel with its own sample count.
    bool render(u32 first, u32 count);

    // The same for halves of tiles, each with samples [begins[r], ends[r]) of its own: half r % 2 (PixelBlock) of tile
    // r / 2, tiles of TILE_SIZE^2 pixels from the bottom left corner on, row by row.
    bool render_regions(const std::vector<u32>& begins, const std::vector<u32>& ends);
    size_t tile_count() const;

    // From any thread, until set_view(): render() returns within a round of a batch, prepare() within one step of building.
    void cancel() {
        cancelled_.store(true, std::memory_order_relaxed);
        pool_.cancel();
    }
    // Share of the running step that is done, 0..1.
    double step_progress() const;
    RenderStats stats() const;
    const Film& film() const { return *film_; }
    const std::shared_ptr<Film>& shared_film() const { return film_; }  // set_view() takes another
    const RenderView& scene() const { return scene_; }
    // For another device, after prepare(): the RenderTask (block 0) and the scene's arrays behind it. The film's sums
    // and the wavefront are left to the device. The image borrows from the renderer.
    DeviceImage device_image();
    const SceneTrees& trees() const { return *trees_; }

 private:
    struct Samples {
        u32 first, count;
    };
    template <class SamplesOf>
    bool trace_tiles(int halves, const SamplesOf& samples_of);
    void build_all();
    void build_accel();
    void build_local_trees();
    void build_device_trees();
    // view.cpp: what changes with the camera
    void look();
    bool reads_camera_in_world() const;
    void build_shutter();
    void place_media();
    void make_batches();
    void find_constants();
    void build_lights();
    // render_photons.cpp
    void find_casters();
    std::vector<Photon> trace_photons(u32 map, u32 starts);
    void build_photon_map(u32 map);
    bool make_photon_map(u32 sample);
    void mark_in_world();
    WorldSun find_sun(WorldInput& world);  // and tells the world of it
    std::vector<float> world_map(int width, int height, const WorldSun& sun);

    RenderInput input_;
    std::unique_ptr<SceneStore> store_;
    ThreadPool pool_;
    std::shared_ptr<const Structures> structures_;
    std::unique_ptr<LocalTrees> local_trees_;
    std::unique_ptr<SceneTrees> trees_;  // instead of structures_, for another device
    LightStore lights_;
    RenderScene scene_;
    std::shared_ptr<Film> film_;
    bool world_reads_camera_ = false;  // and has a map that light is sampled by
    RenderTask task_{};
    std::vector<std::unique_ptr<Batch>> batches_;
    std::atomic<bool> cancelled_{false};
    std::atomic<u64> tiles_done_{0};
    u64 tiles_total_ = 1;
    u32 map_sample_ = NONE;      // the first of those that the photons at hand serve
    RenderStats stats_;
};

}  // namespace luch::cpu
