// The shutter: at which time a path sees the scene, and where the camera is then. Present only where something moves.
#pragma once
#include "luch/camera/camera.h"
#include "luch/geometry/motion.h"

namespace luch {

// The inverted distribution of the shutter's curve: time of u, linear between entries.
inline constexpr u32 SHUTTER_ENTRIES = 1024;  // of steps; a curve of 256 points is then inverted to 1e-3 of the shutter

struct ShutterView {
    const float* times;  // SHUTTER_ENTRIES + 1; null: open alike all the time
    const TransformKey* camera;  // camera to world; the lens's axes as CameraView has them
    u32 camera_keys;  // 0: the camera stands still
    bool zooms;  // the field of view changes: centre and scale at the ends
    Vec2 centre[2], scale[2];  // as CameraView's, when the shutter opens and when it closes
    float rolling;  // share of the shutter that a line of pixels sees; below 0: all see all of it
};

// u: a random number; line: of pixels, from the bottom, of so many.
LUCH_FN float shutter_time(const ShutterView& shutter, float u, u32 line, u32 lines) {
    float time = u;
    if (shutter.times) {
        float at = u * static_cast<float>(SHUTTER_ENTRIES);
        u32 entry = static_cast<u32>(at);
        entry = entry < SHUTTER_ENTRIES - 1u ? entry : SHUTTER_ENTRIES - 1u;
        time = mix_f(shutter.times[entry], shutter.times[entry + 1u], at - static_cast<float>(entry));
    }
    if (shutter.rolling < 0.0f) return time;
    // As in Cycles: a part of the blur is kept, the rest of the time goes down the picture line by line.
    float down = 1.0f - static_cast<float>(line) / static_cast<float>(lines);
    return saturate_f((time - 0.5f) * shutter.rolling + (down - 0.5f) * (1.0f - shutter.rolling) + 0.5f);
}

// The camera at a time. What its rays need: to_camera stays that of the shutter's middle, which passes are told in.
LUCH_FN_SLOW CameraView camera_at_time(const CameraView& camera, const ShutterView& shutter, float time) {
    CameraView moved = camera;
    if (shutter.camera_keys != 0u) moved.to_world = transform_at(shutter.camera, {0u, shutter.camera_keys, 0u}, time);
    if (shutter.zooms) {
        // The place in the image plane is blended, from the end that is nearer to the middle, as in Cycles.
        u32 end = time < 0.5f ? 0u : 1u;
        float share = abs_f(2.0f * time - 1.0f);
        // plane = (raster - centre) scale, linear in the raster: a blend of two such maps is one.
        Vec2 scale = {mix_f(camera.scale.x, shutter.scale[end].x, share),
                      mix_f(camera.scale.y, shutter.scale[end].y, share)};
        Vec2 shift = {mix_f(camera.centre.x * camera.scale.x, shutter.centre[end].x * shutter.scale[end].x, share),
                      mix_f(camera.centre.y * camera.scale.y, shutter.centre[end].y * shutter.scale[end].y, share)};
        moved.scale = scale;
        moved.centre = {shift.x / scale.x, shift.y / scale.y};
    }
    return moved;
}

}  // namespace luch
