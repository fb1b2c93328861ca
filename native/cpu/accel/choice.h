// Which structure a scene is searched by: the one that the user names, or the fastest of those that may win here.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "cpu/accel/accel.h"

namespace luch::cpu {

// AUTO, BVH, BVH2, ... as in luch/accel.py and Blender's panel.
struct AccelRequest {
    bool automatic = true;
    AccelChoice choice;
    // Of the whole render: what trying out another structure may cost depends on them.
    double expected_rays = 0.0;
    double time_limit_s = INFINITE_DISTANCE;
};

// Throws std::invalid_argument, naming those that exist.
AccelRequest accel_request(const std::string& name, const std::string& precision);
std::string accel_name(const AccelChoice& choice);

struct ChosenAccel {
    std::unique_ptr<Accel> accel;
    AccelChoice choice;
    std::string reason;  // one sentence for the statistics, with what was measured
};

ChosenAccel build_chosen(const SceneView& scene, const std::vector<std::vector<u8>>& flags, ThreadPool& pool,
                         const AccelRequest& request);

}  // namespace luch::cpu
