// From a camera in Blender's terms (luch.scene.Camera and Film) to a CameraView.
#pragma once
#include <string>

#include "luch/camera/camera.h"

namespace luch::cpu {

// Fields as in luch.scene.Camera; lengths in metres unless the name says otherwise.
struct CameraSpec {
    std::string kind = "PERSP";
    double matrix[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  // camera to world, looks along -Z
    double lens_mm = 50.0, sensor_width_mm = 36.0, sensor_height_mm = 24.0;
    std::string sensor_fit = "AUTO";
    double ortho_scale = 6.0, shift_x = 0.0, shift_y = 0.0;
    double clip_start = 0.1, clip_end = 1000.0;
    bool use_dof = false;
    double focus_distance = 10.0, fstop = 2.8;
    int blades = 0;
    double blades_rotation = 0.0, aperture_ratio = 1.0;
    double latitude[2] = {-1.5707963267948966, 1.5707963267948966};
    double longitude[2] = {-3.141592653589793, 3.141592653589793};
    double fisheye_fov = 3.141592653589793, fisheye_lens_mm = 10.5;
    double fisheye_polynomial[5] = {0.0, 0.0, 0.0, 0.0, 0.0};  // angle = -(k0 + k1 r + ... k4 r^4), r in mm
    double cylinder_angle[2] = {-3.141592653589793, 3.141592653589793};
    double cylinder_height[2] = {-1.0, 1.0};  // on a cylinder of radius 1
};

// The full frame, in pixels.
struct FrameSpec {
    int width = 1920, height = 1080;
    double pixel_aspect[2] = {1.0, 1.0};
};

// origin: Scene.origin, subtracted from the camera's place in double. Throws std::invalid_argument
// that names the field if the kind is unknown or the frame empty.
CameraView make_camera_view(const CameraSpec& camera, const FrameSpec& frame, const double origin[3]);

}  // namespace luch::cpu
