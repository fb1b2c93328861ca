// One thread's batch of paths and the stages that move it on: generate, traverse, sort by material,
// shade, shadow, accumulate. A batch lives in one core's second-level cache; all its memory is taken once.
#pragma once
#include <memory>
#include <vector>

#include "cpu/accel/accel.h"
#include "cpu/integrator/render_scene.h"
#include "cpu/shade/interpreter.h"
#include "luch/film/film.h"
#include "luch/integrator/path.h"
#include "luch/light/light.h"
#include "luch/shade/surface_setup.h"

namespace luch::cpu {

// 2,048 paths: 64 chunks of lanes to sort by material, and about 600 KiB with their rays.
inline constexpr int BATCH_PATHS = 2048;
// Samples of a pixel whose first random numbers are drawn in one loop.
inline constexpr int CAMERA_LANES = 16;

// A shadow ray on its way, with the light it will bring if nothing blocks it.
struct ShadowRay {
    Color contribution;
    Color pass_diffuse, pass_glossy;
    u32 path;        // whose pixel and flags
    u32 lightgroup;
    u32 bounce;      // of the path when the ray left
    bool for_ao;
    bool casts;      // false: the lamp casts no shadow, the ray counts as free
};

struct BatchCounts {
    u64 paths = 0, rays = 0, shadow_rays = 0, surface_points = 0, bad_samples = 0;
    u64 lens_samples = 0;       // camera rays that chose a point of the aperture
    u64 lamp_searches = 0;      // rays that looked for lamps on their way
    u64 transparent_steps = 0;  // surfaces that shadow rays looked through, one by one
    u64 world_points = 0;       // directions in which the world's program ran for a ray
    u64 light_points = 0;       // points on lights at which a program ran

    void add(const BatchCounts& other);
};

struct PixelBlock {
    int x0, y0, width, height;  // full-frame pixels
    u32 first_sample, sample_count;
};

class Batch {
 public:
    Batch(const RenderScene& scene, const FilmView& film);
    ~Batch();

    // Traces block.width * block.height * block.sample_count <= BATCH_PATHS paths to their ends, into the
    // rows of the block's pixels.
    void trace(const PixelBlock& block);

    BatchCounts counts() const;

 private:
    // batch.cpp: the wavefront
    void generate(const PixelBlock& block);
    void generate_pixel(const PixelSequences& pixel, u32 px, u32 py, u32 first_sample, u32 count);
    void traverse();
    void find_lamps();
    void add_lamp(const PathState& path, const LampHit& hit, const Ray& ray);
    void shade_misses();
    void add_suns(const PathState& path, const Ray& ray);
    void add_world(const u32* queue, int count);
    void sort_hits_by_material();
    bool wants_features() const;
    bool survives(PathState& path, const MaterialView& material);
    static bool looks_for_light_alone(const PathState& path);
    void shade_hits();
    void trace_shadows();
    u32 film_pixel(u32 x, u32 y) const;  // of a pixel of the full frame
    u32 depth_word(const PathState& path) const;

    // shade_surface.cpp: one chunk of points that share a material
    void shade_chunk(u32 material, const u32* queue, int count);
    void setup_chunk(const u32* queue, int count, ShadePoints& points);
    void soften(const PathState& path, ClosureSet& set) const;
    bool apply_holdout(PathState& path, const ShadePoints& points, int lane, ClosureSet& set);
    void add_surface_emission(PathState& path, const Hit& hit, const ShadePoints& points, int lane, Color emission);
    void draw_numbers(const u32* queue, int lit_count);
    void scatter(PathState& path, u32 k, int lane, Vec3 u);
    void pass_through(PathState& path, u32 k, int lane, Color weight);
    void choose_passes(PathState& path, const BsdfSample& s);
    void push_ray(u32 path, Vec3 origin, Vec3 direction);
    static bool set_transmits(const ClosureSet& set);

    // direct_light.cpp
    void sample_lights(const u32* queue, int lit_count);
    void cast_shadow_ray(u32 k, int lane);
    void emission_of_samples(const u32* queue, const int* lanes, int count);
    const ConstantEmission* constant_emission_of(const LightSample& s) const;
    const Program* program_of(const LightSample& s) const;
    void setup_light_lane(u32 k, int lane, ShadePoints& points, int out);
    Color eval_lamp(const PathState& path, const LampHit& hit, const Ray& ray);
    Color walk_transparent(const Ray& shadow, const PathState& path);
    void sample_ao(const PathState& path, u32 path_index, int lane);

    // accumulate.cpp
    bool admit(Color& c, u32 bounce);
    void add_to_light_passes(u32 pixel, Color c, Color diffuse, Color glossy, bool direct);
    void add_emission(const PathState& path, Color radiance, u32 own_pass, u32 lightgroup);
    void add_environment_only(const PathState& path, Color radiance);
    void add_direct(const PathState& path, const ShadowRay& shadow, Color transmittance);
    void add_alpha_hole(const PathState& path, float transparent);
    void write_aovs(const PathState& path, const float* aovs);
    void write_data_passes(PathState& path, const ShadePoints& points, int lane, const ClosureSet& set, u32 material);
    void write_first_sample(u32 pixel, Vec3 p, u32 instance, u32 material);
    void write_crypto(const PathState& path, u32 instance, u32 material, float alpha);
    void write_features(PathState& path, const ClosureSet& set, Vec3 to_viewer);

    const RenderScene& scene_;
    FilmWriter writer_;
    BatchCounts counts_;

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

    struct Scratch;  // chunk-sized work space: points, closures, light samples
    std::unique_ptr<Scratch> scratch_;
    Registers registers_;
    std::vector<float> aovs_;
};

}  // namespace luch::cpu
