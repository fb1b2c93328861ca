#include "cpu/integrator/renderer.h"

#include <algorithm>
#include <stdexcept>

#include "cpu/accel/scene_plan.h"
#include "cpu/seconds.h"
#include "cpu/shade/interpreter.h"
#include "cpu/sky/world_sun.h"
#include "luch/integrator/photon_map.h"
#include "luch/shade/surface_setup.h"

namespace luch::cpu {
namespace {

constexpr u32 SAMPLES_PER_BATCH = BATCH_PATHS / (TILE_SIZE * TILE_SIZE);
// Rays of a path, shadow rays among them. Interiors cast 8 to 12; a low guess only leaves out a trial.
constexpr double EXPECTED_RAYS = 4.0;

// One lane, evaluated for its emission.
Color evaluate_emission(const SceneView& view, const Program& program, const ShadePoints& points) {
    Registers registers(program);
    std::vector<ClosureSet> sets(1);
    run_program(view, program, points, sets.data(), registers.data());
    return sets[0].emission;
}

// Instances with a material that scatters under the surface; empty: there is none.
std::vector<u8> instances_with_subsurface(const SceneView& view) {
    std::vector<u8> wanted(view.instance_count);
    bool any = false;
    for (u32 i = 0; i < view.instance_count; i++) {
        const InstanceView& instance = view.instances[i];
        for (u32 slot = 0; slot < instance.material_count; slot++) {
            u32 material = view.material_table[instance.first_material + slot];
            if (view.materials[material].program.flags & PROGRAM_SUBSURFACE) wanted[i] = any = true;
        }
    }
    return any ? wanted : std::vector<u8>();
}

}  // namespace

Renderer::Renderer(std::unique_ptr<SceneStore> store, const RenderInput& input)
    : input_(input), store_(std::move(store)), pool_(input.threads), film_(std::make_shared<Film>(input.film)) {}

bool Renderer::prepare() {
    try {
        build_all();
    } catch (const Cancelled&) {
        return false;
    }
    return !cancelled_.load();
}

void Renderer::build_all() {
    scene_.view = store_->finish();
    mark_in_world();
    double start = seconds_now();
    if (input_.for_device)
        build_device_trees();
    else
        build_accel();
    build_local_trees();
    stats_.accel_seconds = seconds_now() - start;
    stats_.scene_bytes = store_->bytes();
    scene_.view.origin = {float(input_.origin[0]), float(input_.origin[1]), float(input_.origin[2])};
    look();
    find_constants();
    build_lights();
    place_media();
    find_casters();
    make_batches();
}

// Walks under a surface trace its object in the object's own space, whatever the scene's trees hold.
void Renderer::mark_in_world() {
    std::vector<u8> in_world = instances_in_world(scene_.view, FLATTEN_TRIANGLES);
    std::vector<u8> walked = instances_with_subsurface(scene_.view);
    for (size_t i = 0; i < walked.size(); i++)
        if (walked[i]) in_world[i] = 0;
    store_->mark_in_world(in_world);
}

Renderer::~Renderer() = default;

void Renderer::build_accel() {
    std::vector<std::vector<u8>> transparency = store_->transparency_flags(input_.forced.transparency);
    if (structures_ == nullptr || structures_->transparency != transparency) {
        AccelRequest request = input_.accel;
        request.expected_rays = double(film_->view().width) * film_->view().height * input_.samples * EXPECTED_RAYS;
        ChosenAccel chosen = build_chosen(scene_.view, transparency, pool_, request);
        structures_ = std::make_shared<const Structures>(
            Structures{std::move(chosen.accel), accel_name(chosen.choice), chosen.reason, std::move(transparency)});
        stats_.accel_builds = 1;
    }
    stats_.accel_name = structures_->name;
    stats_.accel_reason = structures_->reason;
    stats_.accel = structures_->accel->stats();
    scene_.accel = structures_->accel.get();
}

void Renderer::build_local_trees() {
    std::vector<u8> wanted = instances_with_subsurface(scene_.view);
    scene_.has_subsurface = !wanted.empty();
    if (wanted.empty()) return;
    local_trees_ =
        std::make_unique<LocalTrees>(scene_.view, wanted, input_.accel.choice.precision, input_.for_device, pool_);
    scene_.walk_trees = local_trees_.get();
    scene_.local_trees = input_.for_device ? local_trees_->view() : nullptr;
    stats_.local_tree_bytes = local_trees_->bytes();
}

void Renderer::build_device_trees() {
    AccelChoice choice = input_.accel.choice;
    choice.leave_from = input_.device_builds_from;
    stats_.accel_builds = 1;
    trees_ = SceneTrees::build(scene_.view, store_->transparency_flags(input_.forced.transparency), pool_, choice);
    stats_.accel_name = input_.accel.choice.wide ? "CWBVH" : accel_name(input_.accel.choice);
    stats_.accel_reason = input_.accel.automatic ? "on CUDA the compressed wide tree is the fastest in all measured "
                                                   "scenes (docs/rays.md)"
                                                 : "chosen in the scene's settings";
    stats_.accel = trees_->stats();
}

DeviceImage Renderer::device_image() {
    DeviceImage image;
    task_.scene = scene_;
    task_.film = film_->view();
    u32 block = image.add("task", &task_, sizeof(task_));
    store_->describe(image, block, task_.scene.view);
    image.link(block, &task_.scene.view.lights, lights_.describe(image));
    input_.media.describe(image, block, task_.scene.media);
    image.add_array("camera", block, task_.scene.view.camera, 1);
    image.add_array("filter", block, task_.scene.filter, 1);
    if (task_.scene.photon_maps) scene_.casters_store.describe(image, block, task_.scene.casters);
    if (task_.scene.local_trees) local_trees_->describe(image, block, task_.scene.local_trees);
    if (task_.scene.shutter) {
        u32 shutter = image.add_array("shutter", block, task_.scene.shutter, 1);
        image.add_array("shutter times", shutter, scene_.shutter_view.times, scene_.shutter_times.size());
        image.add_array("camera keys", shutter, scene_.shutter_view.camera, scene_.camera_keys.size());
    }
    image.add_array("material_emission", block, task_.scene.material_emission, scene_.emission_of_materials.size());
    return image;
}

// What does not change from point to point is evaluated here, once.
void Renderer::find_constants() {
    const SceneView& view = scene_.view;
    size_t registers = view.world_program.register_count;
    ShadePoints points{};
    points.count = 1;
    LaneInputs in{};
    in.to_viewer = {0.0f, 0.0f, 1.0f};
    in.instance = in.prim = NONE;
    in.flags = PATH_EMISSION_ONLY;
    setup_free_lane(in, {0.0f, 0.0f, 1.0f}, points, 0);
    ShadePoints seen_from_behind = points;
    seen_from_behind.flags[0] |= PATH_BACKFACING;
    for (u32 m = 0; m < view.material_count; m++) {
        const Program& program = view.materials[m].program;
        registers = std::max(registers, size_t(program.register_count));
        ConstantEmission emission{};
        emission.constant = !(program.flags & PROGRAM_EMISSION) || (program.flags & PROGRAM_CONSTANT_EMISSION);
        if (program.flags & PROGRAM_CONSTANT_EMISSION) emission.radiance = evaluate_emission(view, program, points);
        if (program.flags & PROGRAM_EMISSION_BY_SIDE) {
            emission.constant = emission.by_side = true;
            emission.radiance = evaluate_emission(view, program, points);
            emission.behind = evaluate_emission(view, program, seen_from_behind);
        }
        if (input_.forced.emission) emission.constant = emission.by_side = false;
        scene_.emission_of_materials.push_back(emission);
    }
    scene_.material_emission = scene_.emission_of_materials.data();
    for (const LampInput& lamp : input_.lamps) {
        if (lamp.has_program) registers = std::max(registers, size_t(lamp.program.register_count));
    }
    scene_.max_registers = registers;
    scene_.has_world = input_.world.present;
    scene_.world_visibility = input_.world.visibility;
    scene_.world_lightgroup = input_.world.lightgroup;
    const u32 world_flags = view.world_program.flags;
    if (input_.world.present && (world_flags & PROGRAM_CONSTANT_EMISSION)) {
        scene_.world_emission = {true, evaluate_emission(view, view.world_program, points), false, {}};
    } else if (!(world_flags & PROGRAM_EMISSION)) {
        scene_.world_emission = {true, make_vec3(0.0f), false, {}};
    }
    if (scene_.world_emission.constant && is_zero(scene_.world_emission.radiance)) scene_.has_world = false;
}

// The world without the disc of its sun, which has samples of its own.
std::vector<float> Renderer::world_map(int width, int height, const WorldSun& sun) {
    std::vector<float> map(size_t(width) * size_t(height) * 3);
    const SceneView& view = scene_.view;
    pool_.parallel_for(size_t(height), 4, [&](size_t begin, size_t end, unsigned) {
        Registers registers(view.world_program);
        auto points = std::make_unique<ShadePoints>();
        std::vector<ClosureSet> sets(SHADE_LANES);
        for (size_t y = begin; y < end; y++) {
            for (int x0 = 0; x0 < width; x0 += SHADE_LANES) {
                points->count = std::min(SHADE_LANES, width - x0);
                for (int lane = 0; lane < points->count; lane++) {
                    LaneInputs in{};
                    in.point = beside_sun(sun, world_map_direction(width, height, x0 + lane, int(y)));
                    in.to_viewer = -in.point;
                    in.instance = in.prim = NONE;
                    in.flags = PATH_EMISSION_ONLY | PATH_DIFFUSE;
                    setup_free_lane(in, -in.point, *points, lane);
                }
                run_program(view, view.world_program, *points, sets.data(), registers.data());
                for (int lane = 0; lane < points->count; lane++) {
                    float* out = map.data() + (y * size_t(width) + size_t(x0 + lane)) * 3;
                    out[0] = sets[lane].emission.x, out[1] = sets[lane].emission.y, out[2] = sets[lane].emission.z;
                }
            }
        }
    });
    return map;
}

WorldSun Renderer::find_sun(WorldInput& world) {
    WorldSun sun = find_world_sun(scene_.view);
    if (!sun.present) return sun;
    ShadePoints points{};
    points.count = 1;
    LaneInputs in{};
    in.point = sun.direction;
    in.to_viewer = -in.point;
    in.instance = in.prim = NONE;
    in.flags = PATH_EMISSION_ONLY | PATH_DIFFUSE;
    setup_free_lane(in, -in.point, points, 0);
    world.has_sun = true;
    world.sun_direction = sun.direction;
    world.sun_angle = sun.angle;
    world.sun_radiance = evaluate_emission(scene_.view, scene_.view.world_program, points) * SUN_MEAN_OVER_CENTRE;
    sun.present = max_component(world.sun_radiance) > 0.0f;  // else it is set: the map may keep what is left of it
    return sun;
}

void Renderer::build_lights() {
    const double start = seconds_now();
    WorldInput world = input_.world;
    std::vector<float> map;
    world.constant = scene_.world_emission.constant;
    world.constant_radiance = scene_.world_emission.radiance;
    if (world.present && !world.constant && input_.world_map_width > 0) {
        world.map_width = input_.world_map_width;
        world.map_height = input_.world_map_width / 2;
        const WorldSun sun = find_sun(world);
        map = world_map(world.map_width, world.map_height, sun);
        world.map_rgb = map.data();
    }
    // A world without a map is left to the paths that leave the scene: they follow the surface's own
    // distribution, which no choice among lights improves on where all directions are equally bright.
    if (world.map_rgb == nullptr) world.present = false;
    lights_.build(scene_.view, input_.lamps, world, input_.material_emission_estimate, input_.light_tree, pool_);
    store_->view().lights = scene_.view.lights = &lights_.view();
    const LightsView& lights = lights_.view();
    scene_.has_lights = lights.emitter_count > 0 || lights.sun_count > 0 || lights.world.present;
    scene_.has_visible_lamps = lights.box_count > 0 || input_.forced.lamps;
    scene_.can_meet_light = scene_.has_world || scene_.has_visible_lamps || input_.forced.emission;
    world_reads_camera_ = map.size() > 0 && reads_camera_in_world();
    if (input_.forced.world) scene_.world_emission.constant = false;  // after all that chooses by it
    for (u32 sun = 0; sun < lights.sun_count; sun++) {
        if (!lights.lamps[lights.suns[sun]].delta) scene_.can_meet_light = true;
    }
    for (u32 m = 0; m < scene_.view.material_count; m++) {
        if (scene_.view.materials[m].program.flags & PROGRAM_EMISSION) scene_.can_meet_light = true;
    }
    stats_.lights_seconds = seconds_now() - start;
}

size_t Renderer::tile_count() const {
    const size_t size = TILE_SIZE;
    return ((input_.film.width + size - 1) / size) * ((input_.film.height + size - 1) / size);
}

// halves: 1, or 2 for each tile's two; samples_of(i): of the i-th piece of work.
template <class SamplesOf>
bool Renderer::trace_tiles(int halves, const SamplesOf& samples_of) {
    const FilmSpec& film = input_.film;
    const int width = int(film.width), height = int(film.height);
    const size_t columns = size_t((width + TILE_SIZE - 1) / TILE_SIZE);
    const u32 at_once = u32(halves) * SAMPLES_PER_BATCH;
    double start = seconds_now();
    auto trace = [&](size_t begin, size_t end, unsigned worker) {
        for (size_t i = begin; i < end; i++) {
            PixelBlock block;
            const size_t tile = i / size_t(halves);
            block.half = halves == 1 ? PixelBlock::WHOLE : int(i % 2);
            int x = int(tile % columns) * TILE_SIZE, y = int(tile / columns) * TILE_SIZE;
            block.x0 = int(film.x0) + x, block.y0 = int(film.y0) + y;
            block.width = std::min(TILE_SIZE, width - x), block.height = std::min(TILE_SIZE, height - y);
            const Samples samples = samples_of(i);
            for (u32 done = 0; done < samples.count; done += block.sample_count) {
                if (cancelled_.load(std::memory_order_relaxed)) return;
                block.first_sample = samples.first + done;
                block.sample_count = std::min(at_once, samples_to_mark(samples.first + done, samples.count - done));
                batches_[worker]->trace(block);
            }
            tiles_done_.fetch_add(1, std::memory_order_relaxed);
        }
    };
    try {
        pool_.parallel_for(tile_count() * size_t(halves), 1, trace);
    } catch (const Cancelled&) {  // the film holds what was traced
    }
    stats_.trace_seconds += seconds_now() - start;
    return !cancelled_.load();
}

bool Renderer::render(u32 first, u32 count) {
    const u32 end = first + count;
    auto at_once = [&](u32 from) { return scene_.photon_maps ? samples_of_map(from, end - from) : end - from; };
    u64 pieces = 0;
    for (u32 from = first; from < end; from += at_once(from)) pieces++;
    tiles_total_ = tile_count() * pieces;
    tiles_done_.store(0);
    for (u32 from = first; from < end; from += at_once(from)) {
        if (scene_.photon_maps && !make_photon_map(from)) return false;
        if (!trace_tiles(1, [&](size_t) { return Samples{from, at_once(from)}; })) return false;
    }
    return !cancelled_.load();
}

bool Renderer::render_regions(const std::vector<u32>& begins, const std::vector<u32>& ends) {
    if (begins.size() != 2 * tile_count() || ends.size() != begins.size())
        throw std::invalid_argument("Renderer: two regions for each tile are needed.");
    if (scene_.photon_maps) throw std::invalid_argument("Renderer: with photon maps all pixels have the same samples.");
    tiles_total_ = tile_count() * 2;
    tiles_done_.store(0);
    return trace_tiles(2, [&](size_t i) { return Samples{begins[i], ends[i] > begins[i] ? ends[i] - begins[i] : 0u}; });
}

double Renderer::step_progress() const { return double(tiles_done_.load()) / double(std::max<u64>(tiles_total_, 1)); }

RenderStats Renderer::stats() const {
    RenderStats stats = stats_;
    stats.film_pixel_bytes = film_->pixel_bytes();
    for (const auto& batch : batches_) stats.counts.add(batch->counts());
    return stats;
}

}  // namespace luch::cpu
