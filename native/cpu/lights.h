// Builds what light/light.h reads: lamps in their final units, the tree over all emitters, the
// world's importance map. Nothing here is kept from the input after build().
#pragma once
#include <memory>
#include <vector>

#include "cpu/device_image.h"
#include "luch/light/light.h"

namespace luch::cpu {

class ThreadPool;

enum class LampShape : u8 { POINT, SPOT, SUN, SQUARE, RECTANGLE, DISK, ELLIPSE };

// luch.scene.Light, resolved: the same meanings and units, the matrix already camera-relative.
struct LampInput {
    LampShape shape = LampShape::POINT;
    Affine matrix{};          // local to world, shines along local -z
    Color color{1.0f, 1.0f, 1.0f};
    float power = 10.0f;      // W; sun W/m2
    bool normalize = true;
    float radius = 0.0f;
    bool soft_falloff = true;
    float spot_size = 0.785398f, spot_blend = 0.15f;
    float angle = 0.0f;       // sun, angular diameter
    float size = 0.25f, size_y = 0.25f;
    float spread = PI;
    bool has_program = false;
    Program program{};
    u32 visibility = 62;      // RayKind
    bool cast_shadow = true, use_mis = true;
    u32 max_bounces = 1024;
    u32 lightgroup = 0;       // bit index + 1, 0: none
    float random = 0.0f;
};

struct WorldInput {
    bool present = false, constant = true;
    Color constant_radiance{};
    // Radiance seen along world_map_direction(map_width, map_height, x, y); rows from latitude -pi/2 up. Copied.
    // Best at the environment image's own resolution: density is bilinear between the same texel centres.
    int map_width = 0, map_height = 0;
    const float* map_rgb = nullptr;
    u32 visibility = RAY_ALL, lightgroup = 0;
    u32 max_bounces = 1024;
    // A sun that the map cannot resolve (Sky Texture): direction to it, angular diameter, its mean radiance.
    bool has_sun = false;
    Vec3 sun_direction{0.0f, 0.0f, 1.0f};
    float sun_angle = 0.0f;
    Color sun_radiance{};
};

// Where the centre of texel (x, y) of the importance map looks; Blender's equirectangular convention.
Vec3 world_map_direction(int width, int height, int x, int y);

class LightStore {
 public:
    // Up to so many emissive triangles, over all instances, every one is in the tree (about 120 bytes each, twice
    // that while building). Beyond, instances of meshes used more than once are one emitter each.
    static constexpr size_t MOST_TRIANGLES = 2'000'000;

    LightStore();
    ~LightStore();
    // scene: meshes, instances, materials and material_table must be filled; SceneView::lights is not read.
    // material_emission_estimate: typical radiance per material, for choosing among lights. A material that may
    // emit and whose estimate is 0 counts as 1: it must stay reachable.
    void build(const SceneView& scene, const std::vector<LampInput>& lamps, const WorldInput& world,
               const std::vector<Color>& material_emission_estimate, bool use_light_tree, ThreadPool& pool,
               size_t most_triangles = MOST_TRIANGLES);
    const LightsView& view() const { return view_; }
    // Adds view() and the arrays behind it; returns the view's block.
    u32 describe(DeviceImage& image) const;

 private:
    struct Arrays;
    std::unique_ptr<Arrays> arrays_;
    LightsView view_{};
};

}  // namespace luch::cpu
