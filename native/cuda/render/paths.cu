// The stages that run no shader program: beginning paths, sorting hits by material, passing on to the next round, reading
// passes out of the film.
#define LUCH_PLAN_CURVES 1  // which material a hit has
#include "luch/film/read.h"
#include "luch/integrator/camera_path.h"
#include "luch/integrator/photon_map.h"
#include "luch/integrator/wavefront.h"
#include "render/launch.cuh"

namespace luch {
inline constexpr u32 COUNTED_IN_BLOCK = 1024;  // materials whose counts a block keeps in shared memory

__device__ __forceinline__ u32 material_of(const RenderTask& task, u32 k) {
    const Hit& hit = task.wave.hits[k];
    return hit.instance == NONE ? NONE : material_at(task.scene.view, hit.instance, hit.prim);
}
}  // namespace luch

using luch::u32;

extern "C" __global__ void begin_paths(const __grid_constant__ luch::RenderTask task, const luch::WaveRange range) {
    using namespace luch;
    u32 i = stage_index(), count = range.pixel_count * range.sample_count;
    if (i == 0) task.wave.counters[WAVE_RAYS] = count;
    if (i >= count) return;
    u32 layer = i / range.pixel_count, within = i % range.pixel_count, pixel = range.first_pixel + within;
    if (range.pixels) pixel = range.pixels[pixel];
    u32 slot = layer * task.wave.layer_pixels + within, sample = range.first_sample + layer;
    u32 px = task.film.x0 + pixel % task.film.width, py = task.film.y0 + pixel / task.film.width;
    FilmWriter writer = film_of_slot(task, slot);
    film_count_samples(writer, pixel, 1u);
    u32 camera = first_dimension(task.scene.sampler);
    SamplerFamily family = family_of(camera);
    PixelSampler own = make_pixel_sampler(px, py, task.scene.seed, task.scene.log2_samples, family);
    Sampler sampler = make_sampler(own, sample);
    Vec2 lens_u = task.scene.has_lens ? sample_2d(sampler, camera + DIM_LENS) : Vec2{0.5f, 0.5f};
    float time = SHUTTER_MIDDLE;
    if (has_motion(task.scene)) task.wave.ray_time[i] = time = path_time(task.scene, sampler, py);
    PathState path;
    Vec2 filter_u = sample_2d(sampler, camera + DIM_PIXEL);
    task.wave.rays[i] = begin_path(task.scene, task.film, px, py, sample, sampler, filter_u, lens_u, time, path);
    task.wave.ray_slot[i] = slot;
    task.wave.ray_kind[i] = path.visibility;
    store_path(task.wave, slot, path);
}

// How many hits each material has.
extern "C" __global__ void count_materials(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    __shared__ u32 counts[COUNTED_IN_BLOCK];
    const Wavefront& wave = task.wave;
    u32 materials = task.scene.view.material_count, k = stage_index();
    bool in_block = materials <= COUNTED_IN_BLOCK;
    for (u32 m = threadIdx.x; in_block && m < materials; m += blockDim.x) counts[m] = 0;
    __syncthreads();
    u32 m = k < wave.counters[WAVE_RAYS] ? material_of(task, k) : NONE;
    if (m != NONE) atomicAdd(in_block ? counts + m : wave.material_first + m, 1u);
    __syncthreads();
    for (u32 i = threadIdx.x; in_block && i < materials; i += blockDim.x)
        if (counts[i] != 0) atomicAdd(wave.material_first + i, counts[i]);
}

// Counts become beginnings. One block.
extern "C" __global__ void place_materials(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    __shared__ u32 sums[STAGE_BLOCK];
    const Wavefront& wave = task.wave;
    u32 materials = task.scene.view.material_count, before = 0;
    for (u32 first = 0; first < materials; first += STAGE_BLOCK) {
        u32 m = first + threadIdx.x, own = m < materials ? wave.material_first[m] : 0u;
        sums[threadIdx.x] = own;
        __syncthreads();
        for (u32 step = 1; step < STAGE_BLOCK; step *= 2) {
            u32 left = threadIdx.x >= step ? sums[threadIdx.x - step] : 0u;
            __syncthreads();
            sums[threadIdx.x] += left;
            __syncthreads();
        }
        if (m < materials) wave.material_first[m] = before + sums[threadIdx.x] - own;
        before += sums[STAGE_BLOCK - 1];
        __syncthreads();
    }
    if (threadIdx.x == 0) wave.counters[WAVE_HITS] = before;
}

// Each hit goes to its material's group; the order within a group is a matter of chance.
extern "C" __global__ void sort_hits(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    __shared__ u32 counts[COUNTED_IN_BLOCK], places[COUNTED_IN_BLOCK];
    const Wavefront& wave = task.wave;
    u32 materials = task.scene.view.material_count, k = stage_index();
    bool in_block = materials <= COUNTED_IN_BLOCK;
    for (u32 m = threadIdx.x; in_block && m < materials; m += blockDim.x) counts[m] = 0;
    __syncthreads();
    u32 m = k < wave.counters[WAVE_RAYS] ? material_of(task, k) : NONE;
    u32 place = 0;
    if (m != NONE) place = atomicAdd(in_block ? counts + m : wave.material_first + m, 1u);
    __syncthreads();
    for (u32 i = threadIdx.x; in_block && i < materials; i += blockDim.x)
        if (counts[i] != 0) places[i] = atomicAdd(wave.material_first + i, counts[i]);
    __syncthreads();
    if (m != NONE) wave.sorted[(in_block ? places[m] : 0u) + place] = k;
}

// The next round's rays become this one's; the host swaps their arrays.
extern "C" __global__ void next_round(const __grid_constant__ luch::RenderTask task) {
    using namespace luch;
    const Wavefront& wave = task.wave;
    for (u32 m = threadIdx.x; m < task.scene.view.material_count; m += blockDim.x) wave.material_first[m] = 0;
    if (threadIdx.x != 0) return;
    wave.counters[WAVE_RAYS] = wave.counters[WAVE_NEXT_RAYS];
    for (u32 c = WAVE_NEXT_RAYS; c < WAVE_COUNTERS; ++c) wave.counters[c] = 0;
}

// Of every photon its bucket, and its number below: what a level is sorted by.
extern "C" __global__ void bucket_photons(const luch::Photon* photons, const u32 count, const float inverse_cell,
                                          const u32 mask, luch::u64* keys) {
    using namespace luch;
    u32 i = stage_index();
    if (i < count) keys[i] = u64(bucket_of(cell_of(photons[i].point, inverse_cell), mask)) << 32 | i;
}

extern "C" __global__ void place_photons(const luch::Photon* photons, const u32 count, const luch::u64* keys,
                                         luch::PhotonPlace* places) {
    using namespace luch;
    u32 i = stage_index();
    if (i >= count) return;
    u32 photon = u32(keys[i]);
    places[i] = {photons[photon].point, photon};
}

// Adds the layers [1, layers) to layer 0 and empties them: one thread a pixel.
extern "C" __global__ void merge_layers(const __grid_constant__ luch::RenderTask task, const u32 layers) {
    using namespace luch;
    u32 pixel = stage_index();
    if (pixel >= task.wave.film_pixels) return;
    FilmWriter to{task.film, nullptr};
    for (u32 layer = 1; layer < layers; ++layer) {
        FilmView from = task.film;
        from.rows += u64(layer) * task.wave.layer_stride;
        from.sample_counts += u64(layer) * task.wave.film_pixels;
        if (from.sample_counts[pixel] == 0) continue;
        film_merge_pixel(to, from, pixel);
        from.sample_counts[pixel] = 0;
        FilmSum* row = film_row(from, pixel);
        for (u32 c = 0; c < task.film.layout.stride; ++c) row[c] = 0;
    }
}

// One pass of every pixel, 0 where it has no samples; after merge_layers.
extern "C" __global__ void read_pass(const __grid_constant__ luch::RenderTask task, const luch::PassRead read,
                                     float* out) {
    using namespace luch;
    u32 pixel = stage_index(), samples;
    if (pixel >= task.wave.film_pixels) return;
    float* to = out + u64(pixel) * read.from.channels;
    if ((samples = task.film.sample_counts[pixel]) != 0)
        return read_pixel(read.from, film_row(task.film, pixel), task.film.layout, samples, read.exposure, to);
    for (u32 k = 0; k < read.from.channels; ++k) to[k] = 0.0f;
}

// Means, then deviations, three floats a pixel each; of every pixel the samples before its mark, then those in all.
extern "C" __global__ void read_deviations(const __grid_constant__ luch::RenderTask task, const luch::PassRead read,
                                           float* out, u32* marked) {
    using namespace luch;
    u32 pixel = stage_index(), pixels = task.wave.film_pixels;
    if (pixel >= pixels) return;
    float* mean = out + 3 * u64(pixel);
    MarkedSamples own = read_deviation(film_row(task.film, pixel), task.film.layout, task.film.sample_counts[pixel],
                                       read.exposure, mean, mean + 3 * u64(pixels));
    marked[pixel] = own.before;
    marked[pixels + pixel] = own.all;
}
