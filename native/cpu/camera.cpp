#include "cpu/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "luch/math/bounds.h"

namespace luch::cpu {
namespace {

// The side of the frame that the sensor (or the orthographic scale) spans, which is also the unit of
// shift: its half length on a plane one metre away (orthographic: in metres) and its pixels' count.
struct Fit {
    double half_length;
    double pixels_x, pixels_y;  // pixels along either axis that make that length
};

Fit fit_sensor(const CameraSpec& camera, const FrameSpec& frame, CameraKind kind) {
    double aspect = frame.pixel_aspect[0] / frame.pixel_aspect[1];
    bool wide = frame.width * aspect > frame.height;
    bool horizontal = camera.sensor_fit == "HORIZONTAL" || (camera.sensor_fit == "AUTO" && wide);
    double sensor = camera.sensor_fit == "VERTICAL" ? camera.sensor_height_mm : camera.sensor_width_mm;
    double half = kind == CameraKind::ORTHOGRAPHIC ? 0.5 * camera.ortho_scale
                                                   : 0.5 * sensor / std::max(camera.lens_mm, SMALLEST_LENS);
    if (horizontal) return {half, static_cast<double>(frame.width), frame.width * aspect};
    return {half, frame.height / aspect, static_cast<double>(frame.height)};
}

// Panoramas other than the equirectangular: a rectangle of the plane fills the frame, or the sensor does in millimetres.
void set_panorama_map(const CameraSpec& camera, const FrameSpec& frame, CameraKind kind, double (&scale)[2],
                      double (&centre)[2]) {
    double low[2] = {-1.0, -1.0}, high[2] = {1.0, 1.0};
    if (kind == CameraKind::CYLINDER) {
        low[0] = camera.cylinder_angle[0], high[0] = camera.cylinder_angle[1];
        low[1] = camera.cylinder_height[0], high[1] = camera.cylinder_height[1];
    } else if (kind == CameraKind::FISHEYE_EQUISOLID || kind == CameraKind::FISHEYE_POLYNOMIAL) {
        Fit fit = fit_sensor(camera, frame, CameraKind::ORTHOGRAPHIC);
        double sensor = camera.sensor_fit == "VERTICAL" ? camera.sensor_height_mm : camera.sensor_width_mm;
        high[0] = 0.5 * sensor * frame.width / fit.pixels_x, low[0] = -high[0];
        high[1] = 0.5 * sensor * frame.height / fit.pixels_y, low[1] = -high[1];
    }
    double sides[2] = {static_cast<double>(frame.width), static_cast<double>(frame.height)};
    double shifts[2] = {camera.shift_x, camera.shift_y};
    for (int k = 0; k < 2; ++k) {
        scale[k] = std::max(high[k] - low[k], SMALLEST_PLANE) / sides[k];
        centre[k] = -low[k] / scale[k] - shifts[k] * sides[k];
    }
}

void set_raster_map(CameraView& view, const CameraSpec& camera, const FrameSpec& frame) {
    double cx, cy, sx, sy;  // plane = (raster - centre) * scale
    if (view.kind == CameraKind::EQUIRECTANGULAR) {
        // Kept from 0, which would leave no place for the centre.
        sx = std::min(camera.longitude[0] - camera.longitude[1], -SMALLEST_PLANE) / frame.width;
        sy = std::min(camera.latitude[0] - camera.latitude[1], -SMALLEST_PLANE) / frame.height;
        cx = camera.longitude[0] / sx - camera.shift_x * frame.width;
        cy = (camera.latitude[0] - 1.5707963267948966) / sy - camera.shift_y * frame.height;
    } else if (is_panorama(view.kind)) {
        double scale[2], centre[2];
        set_panorama_map(camera, frame, view.kind, scale, centre);
        sx = scale[0], sy = scale[1], cx = centre[0], cy = centre[1];
    } else {
        Fit fit = fit_sensor(camera, frame, view.kind);
        sx = 2.0 * fit.half_length / fit.pixels_x;
        sy = 2.0 * fit.half_length / fit.pixels_y;
        cx = 0.5 * frame.width - camera.shift_x * fit.pixels_x;
        cy = 0.5 * frame.height - camera.shift_y * fit.pixels_y;
    }
    view.centre = {static_cast<float>(cx), static_cast<float>(cy)};
    view.scale = {static_cast<float>(sx), static_cast<float>(sy)};
}

// Blender's camera axes without their scale, turned into camera space. A collapsed axis (an object
// scaled to 0) is rebuilt from the other two.
void set_transforms(CameraView& view, const CameraSpec& camera, const double origin[3]) {
    double axis[3][3];
    for (int k = 0; k < 3; ++k) {
        double x = camera.matrix[k], y = camera.matrix[4 + k], z = camera.matrix[8 + k];
        double length = std::hypot(x, y, z);
        bool valid = length > 1e-150 && std::isfinite(length);
        axis[k][0] = valid ? x / length : (k == 0);
        axis[k][1] = valid ? y / length : (k == 1);
        axis[k][2] = valid ? z / length : (k == 2);
    }
    bool panorama = is_panorama(view.kind);
    double m[12];
    for (int row = 0; row < 3; ++row) {
        double right = axis[0][row], up = axis[1][row], forward = -axis[2][row];
        m[4 * row + 0] = panorama ? forward : right;
        m[4 * row + 1] = panorama ? -right : up;
        m[4 * row + 2] = panorama ? up : forward;
        double place = camera.matrix[4 * row + 3] - origin[row];
        m[4 * row + 3] = std::isfinite(place) ? place : 0.0;
    }
    double cofactor[9];
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) {
            int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            cofactor[3 * r + c] = m[4 * r1 + c1] * m[4 * r2 + c2] - m[4 * r1 + c2] * m[4 * r2 + c1];
        }
    }
    double det = m[0] * cofactor[0] + m[1] * cofactor[1] + m[2] * cofactor[2];
    if (!(std::fabs(det) > FLAT_CAMERA))
        throw std::invalid_argument("Camera: its matrix is flat. Reset the camera's scale.");
    for (int i = 0; i < 12; ++i) view.to_world.m[i] = static_cast<float>(m[i]);
    for (int r = 0; r < 3; ++r) {
        double shift = 0.0;
        for (int c = 0; c < 3; ++c) {
            double inverse = cofactor[3 * c + r] / det;
            view.to_camera.m[4 * r + c] = static_cast<float>(inverse);
            shift -= inverse * m[4 * c + 3];
        }
        view.to_camera.m[4 * r + 3] = static_cast<float>(shift);
    }
}

// The near plane moves towards the camera and the far one away by more than the rounding of a ray's
// origin and of a hit's distance: what lies exactly in a clipping plane is wholly visible.
void set_clipping(CameraView& view, const CameraSpec& camera) {
    double reach = std::hypot(view.to_world.m[3], view.to_world.m[7], view.to_world.m[11]);
    double margin = CLIP_SLACK * camera.clip_start + CLIP_PLACE_SLACK * reach;
    double start = std::max(camera.clip_start - margin, 0.0);
    double end = camera.clip_end * (1.0 + CLIP_SLACK);
    double biggest = std::numeric_limits<float>::max();
    view.clip_start = static_cast<float>(std::min(start, biggest));
    view.clip_length = static_cast<float>(std::clamp(end - start, 0.0, biggest));
    if (camera.clip_end < camera.clip_start) view.clip_length = 0.0f;
}

void set_lens(CameraView& view, const CameraSpec& camera) {
    view.aperture_radius = 0.0f;
    view.inverse_focus = 0.0f;
    view.blades = camera.blades < 3 ? 0.0f : static_cast<float>(camera.blades);
    view.blades_rotation = static_cast<float>(camera.blades_rotation);
    view.inverse_aperture_ratio = static_cast<float>(1.0 / std::max(camera.aperture_ratio, SMALLEST_STOP));
    if (!camera.use_dof) return;
    double fstop = std::max(camera.fstop, SMALLEST_STOP);
    double focal_length = view.kind == CameraKind::ORTHOGRAPHIC ? 1.0 : camera.lens_mm * 1e-3;
    view.aperture_radius = static_cast<float>(focal_length / (2.0 * fstop));
    view.inverse_focus = static_cast<float>(1.0 / std::max(camera.focus_distance, SMALLEST_STOP));
}

void set_fisheye(CameraView& view, const CameraSpec& camera) {
    view.fisheye.half_fov = static_cast<float>(0.5 * camera.fisheye_fov);
    view.fisheye.lens_mm = static_cast<float>(std::max(camera.fisheye_lens_mm, SMALLEST_FISHEYE));
    for (int k = 0; k < 5; ++k) view.fisheye.k[k] = static_cast<float>(camera.fisheye_polynomial[k]);
}

struct KindName {
    const char* name;
    CameraKind kind;
};
constexpr KindName KINDS[] = {{"PERSP", CameraKind::PERSPECTIVE},
                              {"ORTHO", CameraKind::ORTHOGRAPHIC},
                              {"EQUIRECTANGULAR", CameraKind::EQUIRECTANGULAR},
                              {"FISHEYE_EQUIDISTANT", CameraKind::FISHEYE_EQUIDISTANT},
                              {"FISHEYE_EQUISOLID", CameraKind::FISHEYE_EQUISOLID},
                              {"FISHEYE_POLYNOMIAL", CameraKind::FISHEYE_POLYNOMIAL},
                              {"MIRROR_BALL", CameraKind::MIRROR_BALL},
                              {"CUBE_FACE", CameraKind::CUBE_FACE},
                              {"CYLINDER", CameraKind::CYLINDER}};

CameraKind kind_of(const std::string& name) {
    std::string known;
    for (const KindName& entry : KINDS) {
        if (name == entry.name) return entry.kind;
        known += (known.empty() ? "" : ", ") + std::string(entry.name);
    }
    throw std::invalid_argument("Camera: kind \"" + name + "\" is unknown. Use one of " + known + ".");
}

}  // namespace

CameraView make_camera_view(const CameraSpec& camera, const FrameSpec& frame, const double origin[3]) {
    if (frame.width < 1 || frame.height < 1)
        throw std::invalid_argument("Film: the frame is " + std::to_string(frame.width) + " x " +
                                    std::to_string(frame.height) + " pixels. Give it at least one.");
    if (!(frame.pixel_aspect[0] > 0.0 && frame.pixel_aspect[1] > 0.0))
        throw std::invalid_argument("Film: pixel_aspect must be positive.");
    CameraView view{};
    view.kind = kind_of(camera.kind);
    set_fisheye(view, camera);
    set_transforms(view, camera, origin);
    set_raster_map(view, camera, frame);
    set_clipping(view, camera);
    set_lens(view, camera);
    return view;
}

}  // namespace luch::cpu
