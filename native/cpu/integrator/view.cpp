// The part of a renderer that a moved camera changes: how the prepared scene is looked at.
#include <algorithm>
#include <stdexcept>

#include "cpu/integrator/renderer.h"
#include "cpu/shade/interpreter.h"
#include "luch/math/bounds.h"
#include "luch/shade/ops.h"

namespace luch::cpu {
namespace {

// Along each side of the film. A thing that none of these rays meets covers less than 1/32 of either side.
constexpr u32 PROBES = 32;

u32 ceil_log2(u32 n) {
    u32 bits = 0;
    while (bits < 31 && (1u << bits) < n) bits++;
    return bits;
}

// Whether what the program gives depends on the camera's place or frame.
bool reads_camera(const SceneView& scene, const Program& program) {
    constexpr u32 CAMERA_SPACE = 2;  // OpVectorTransform
    for (u32 k = 0; k < program.instruction_count; k++) {
        const Instruction& instruction = scene.instructions[program.first_instruction + k];
        const OpInfo& info = op_info(instruction.op);
        const u32* params = scene.operands + instruction.operands + info.outputs + info.inputs;
        switch (OpCode(instruction.op)) {
            case OpCode::POINT_CAMERA:
            case OpCode::POINT_WINDOW:
            case OpCode::CAMERA_DATA:
                return true;
            case OpCode::VECTOR_TRANSFORM:
                if (params[0] == CAMERA_SPACE || params[1] == CAMERA_SPACE) return true;
                break;
            default:
                break;
        }
    }
    return false;
}

}  // namespace

void Renderer::look() {
    scene_.camera = input_.camera;
    scene_.view.camera = &scene_.camera;
    scene_.view.frame_size = {float(input_.frame_width), float(input_.frame_height)};
    scene_.view.flags = (input_.limits.caustics_reflective ? 0u : u32(SCENE_NO_REFLECTIVE_CAUSTICS)) |
                        (input_.limits.caustics_refractive ? 0u : u32(SCENE_NO_REFRACTIVE_CAUSTICS));
    scene_.filter_table = input_.filter;
    scene_.filter = &scene_.filter_table;
    scene_.limits = input_.limits;
    if (input_.photon_maps) scene_.limits.filter_glossy = 0.0f;  // it blurs for want of photons
    scene_.seed = input_.seed;
    scene_.sampler = input_.sampler;
    scene_.first_sample = input_.first_sample;
    scene_.log2_samples = ceil_log2(std::max(input_.samples_in_all, input_.first_sample + input_.samples));
    scene_.has_lens = input_.camera.aperture_radius > 0.0f || input_.forced.lens;
    scene_.mist_start = input_.mist_start;
    scene_.mist_inverse_depth = input_.mist_depth > 0.0f ? 1.0f / input_.mist_depth : 0.0f;
    scene_.mist_exponent = input_.mist_exponent;
    build_shutter();
}

// Paths have times only where something moves: a shutter that is open over what stands still costs nothing.
void Renderer::build_shutter() {
    const MotionInput& in = input_.motion;
    scene_.shutter = nullptr;
    scene_.camera_keys = in.camera;
    if (!in.shutter || (!scene_.view.motion && in.camera.empty() && !in.zooms)) return;
    scene_.shutter_times = invert_shutter_curve(in.curve);
    ShutterView& shutter = scene_.shutter_view;
    shutter.times = scene_.shutter_times.empty() ? nullptr : scene_.shutter_times.data();
    shutter.camera = scene_.camera_keys.empty() ? nullptr : scene_.camera_keys.data();
    shutter.camera_keys = u32(scene_.camera_keys.size());
    shutter.zooms = in.zooms;
    for (int end = 0; end < 2; ++end) {
        shutter.centre[end] = in.camera_ends[end].centre;
        shutter.scale[end] = in.camera_ends[end].scale;
    }
    shutter.rolling = in.rolling;
    scene_.shutter = &shutter;
}

// After lights: whether a path's last turn in a medium can bring light depends on them.
void Renderer::place_media() {
    scene_.has_media = input_.media.shown(scene_.view);
    if (!scene_.has_media) return;
    MediaView& media = scene_.media;
    media = input_.media.view(scene_.view, scene_.camera, float(input_.frame_width), float(input_.frame_height));
    // The borders between the camera's place in the shutter's middle and where it is at other times.
    if (scene_.shutter && scene_.shutter->camera_keys) media.camera_walks = true;
    for (u32 m = 0; m < media.count; m++) {
        if (is_zero(media.media[m].emission)) continue;
        scene_.can_meet_light = true;
        media.last_turn_matters = 1u;
    }
    if (scene_.has_world && !lights_.view().world.present) media.last_turn_matters = 1u;
}

// They hold the film's place and what a path of this scene needs.
void Renderer::make_batches() {
    batches_.clear();
    for (unsigned worker = 0; worker < pool_.size() && !input_.for_device; worker++)
        batches_.push_back(std::make_unique<Batch>(scene_, film_->view(), cancelled_));
}

void Renderer::set_view(const ViewInput& view) {
    std::shared_ptr<Film> film = std::make_shared<Film>(view.film);
    if (!std::equal(view.origin, view.origin + 3, input_.origin))
        throw std::invalid_argument("Renderer: a view's origin must be that of the prepared scene.");
    film_ = std::move(film);
    static_cast<ViewInput&>(input_) = view;
    cancelled_.store(false);
    pool_.resume();
    stats_.accel_builds = 0;
    stats_.accel_seconds = stats_.lights_seconds = stats_.trace_seconds = 0.0;
    look();
    if (world_reads_camera_) build_lights();
    place_media();
    map_sample_ = NONE, scene_.photon_pilot = {};
    make_batches();
}

bool Renderer::reads_camera_in_world() const {
    return input_.world.present && reads_camera(scene_.view, scene_.view.world_program);
}

std::vector<CameraRay> Renderer::probe_rays() const {
    std::vector<CameraRay> rays;
    const FilmSpec& film = input_.film;
    for (u32 y = 0; y < PROBES; y++) {
        for (u32 x = 0; x < PROBES; x++) {
            Vec2 at = {(float(x) + 0.5f) / float(PROBES), (float(y) + 0.5f) / float(PROBES)};
            Vec2 raster = {float(film.x0) + at.x * float(film.width), float(film.y0) + at.y * float(film.height)};
            CameraRay ray = generate_ray(scene_.camera, raster, {0.5f, 0.5f});
            if (ray.ray.t_max >= 0.0f) rays.push_back(ray);
        }
    }
    return rays;
}

// Each thing allows what moves it by a small part of a pixel (a footprint is the mean of a pixel's sides), or by no more
// than its corners round anyway: gamma(4) (|M p| + |m|), bounds.h 2, with the place m of its object seen from the camera.
double Renderer::origin_reach(const std::vector<CameraRay>& rays, const float* distances, const u32* instances) const {
    double shift_m = double(INFINITE_DISTANCE);
    const Vec3 camera = camera_position(scene_.camera);
    for (size_t i = 0; i < rays.size(); i++) {
        if (!(distances[i] < INFINITE_DISTANCE) || instances[i] >= scene_.view.instance_count) continue;
        const float* m = scene_.view.instances[instances[i]].to_world.m;
        const Vec3 place = {m[3], m[7], m[11]}, point = rays[i].ray.origin + rays[i].ray.direction * distances[i];
        const float pixel_m = rays[i].footprint + distances[i] * rays[i].spread;
        const float own_m = gamma_f(4) * (length(point - place) + length(place - camera));
        shift_m = std::min(shift_m, std::max(double(ORIGIN_SHIFT_PIXELS * pixel_m), double(own_m)));
    }
    return shift_m / (double(ORIGIN_ROUNDINGS) * double(EPS));
}

double Renderer::origin_reach() const {
    if (scene_.accel == nullptr) throw std::logic_error("Renderer: another device traces its rays.");
    std::vector<CameraRay> probes = probe_rays();
    std::vector<Ray> rays;
    for (const CameraRay& probe : probes) rays.push_back(probe.ray);
    std::vector<u32> kinds(rays.size(), u32(RAY_CAMERA));
    std::vector<Hit> hits(rays.size());
    scene_.accel->closest(rays.data(), kinds.data(), hits.data(), rays.size());
    std::vector<float> distances;
    std::vector<u32> instances;
    for (const Hit& hit : hits) {
        distances.push_back(hit.t);
        instances.push_back(hit.instance);
    }
    return origin_reach(probes, distances.data(), instances.data());
}

}  // namespace luch::cpu
