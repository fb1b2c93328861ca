// The media around the camera: which ones hold it, and whether its rays may begin on the other side of a border.
#pragma once
#include "luch/camera/camera.h"
#include "luch/integrator/medium.h"

namespace luch::cpu {

// Whether any instance shows a material that has a medium.
bool any_medium(const SceneView& scene);

// Fills camera, camera_position and camera_walks. As in Cycles an instance's medium holds the camera if the first of
// its surfaces in some direction is seen from behind.
void place_camera(const SceneView& scene, const CameraView& camera, float frame_width, float frame_height,
                  MediaView* media);

}  // namespace luch::cpu
