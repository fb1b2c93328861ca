// Owns the media of a scene as paths read them (luch/integrator/medium.h), and finds which of them hold the camera.
#pragma once
#include <string>
#include <vector>

#include "cpu/device_image.h"
#include "luch/camera/camera.h"
#include "luch/integrator/medium.h"

namespace luch::cpu {

struct PhaseInput {
    std::string kind;  // as luch.scene.Phase has it
    Color scattering;
    float a, b;
};

struct MediumInput {
    Color absorption, emission;
    std::vector<PhaseInput> scattering;
};

class MediaStore {
 public:
    // Returns the medium's number; NONE where nothing is left of it. Throws std::invalid_argument for a phase function
    // that is not known.
    u32 add(const MediumInput& input);
    void set_world(u32 medium) { world_ = medium; }
    // Whether a path can come into any of them.
    bool shown(const SceneView& scene) const;

    // The view of it, with the camera's place among the borders in the scene.
    MediaView view(const SceneView& scene, const CameraView& camera, float frame_width, float frame_height) const;

    // Adds the arrays behind `view`, which lies inside the image's block `block`.
    void describe(DeviceImage& image, u32 block, const MediaView& view) const;

 private:
    std::vector<MediumView> media_;
    std::vector<PhaseLobe> lobes_;
    std::vector<float> tables_;
    u32 world_ = NONE;
};

}  // namespace luch::cpu
