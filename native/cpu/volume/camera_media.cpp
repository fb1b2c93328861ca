#include "cpu/volume/camera_media.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace luch::cpu {
namespace {

struct Point {
    double x, y, z;
};
Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Point cross(Point a, Point b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double dot(Point a, Point b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Point widened(Vec3 v) { return {double(v.x), double(v.y), double(v.z)}; }

// Along no axis or diagonal that meshes are built along, where a ray would meet an edge.
constexpr Vec3 DIRECTION = {0.0537f, 0.1193f, 0.9914f};

// Distance to the triangle in units of the direction; infinity: none. Its edges belong to it.
double distance_to(const Triangle& t, Point origin, Point direction, Point* normal) {
    Point a = widened(t.p[0]), e1 = widened(t.p[1]) - a, e2 = widened(t.p[2]) - a, from = origin - a;
    *normal = cross(e1, e2);
    double facing = -dot(direction, *normal);
    Point m = cross(from, direction);
    double u = dot(e2, m) / facing, v = -dot(e1, m) / facing, distance = dot(from, *normal) / facing;
    bool hit = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
    return hit ? distance : double(INFINITE_DISTANCE);
}

// Whether the instance's nearest border is met from behind; *medium: that border's.
bool holds(const SceneView& scene, u32 instance_index, Vec3 position, u32* medium) {
    const InstanceView& instance = scene.instances[instance_index];
    const MeshView& mesh = scene.meshes[instance.mesh];
    Point origin = widened(transform_point(instance.to_object, position));
    Point direction = widened(transform_direction(instance.to_object, DIRECTION));
    double nearest = double(INFINITE_DISTANCE);
    bool behind = false;
    for (u32 prim = 0; prim < mesh.triangle_count; ++prim) {
        u32 own = scene.materials[material_at(scene, instance_index, prim)].medium;
        if (own == NONE) continue;
        Point normal;
        double distance = distance_to(triangle_at(scene, mesh, prim), origin, direction, &normal);
        if (!(distance < nearest)) continue;
        nearest = distance;
        behind = dot(normal, direction) > 0.0;
        *medium = own;
    }
    return behind;
}

bool has_medium(const SceneView& scene, const InstanceView& instance) {
    for (u32 slot = 0; slot < instance.material_count; ++slot)
        if (scene.materials[material_of_slot(scene, instance, slot)].medium != NONE) return true;
    return false;
}

// Whether a border of the instance comes within the radius of the place, at least by its triangles' boxes.
bool comes_near(const SceneView& scene, u32 instance_index, Vec3 place, float radius) {
    const InstanceView& instance = scene.instances[instance_index];
    const MeshView& mesh = scene.meshes[instance.mesh];
    for (u32 prim = 0; prim < mesh.triangle_count; ++prim) {
        if (scene.materials[material_at(scene, instance_index, prim)].medium == NONE) continue;
        Triangle t = triangle_at(scene, mesh, prim);
        Vec3 low = make_vec3(INFINITE_DISTANCE), high = -low;
        for (Vec3 corner : t.p) {
            corner = transform_point(instance.to_world, corner);
            low = min_v(low, corner), high = max_v(high, corner);
        }
        Vec3 apart = max_v(max_v(low - place, place - high), make_vec3(0.0f));
        if (length_squared(apart) <= radius * radius) return true;
    }
    return false;
}

// How far from `place` rays of the camera begin, at most: the frame's corners and the lens's edges tell.
float reach_of_rays(const CameraView& camera, Vec3 place, float width, float height) {
    float reach = 0.0f;
    for (int corner = 0; corner < 4; ++corner) {
        Vec2 raster = {corner & 1 ? width + 2.0f : -2.0f, corner & 2 ? height + 2.0f : -2.0f};
        Vec3 origin = generate_ray(camera, raster, {0.5f, 0.5f}).ray.origin;
        reach = std::max(reach, length(origin - place));
    }
    return 1.01f * (reach + 2.0f * camera.aperture_radius);
}

}  // namespace

bool any_medium(const SceneView& scene) {
    for (u32 i = 0; i < scene.instance_count; ++i)
        if (has_medium(scene, scene.instances[i])) return true;
    return false;
}

void place_camera(const SceneView& scene, const CameraView& camera, float frame_width, float frame_height,
                  MediaView* media) {
    // A ray's beginning in the middle of the frame: near clip and all, so that most rays begin close by.
    Vec3 place = generate_ray(camera, {0.5f * frame_width, 0.5f * frame_height}, {0.5f, 0.5f}).ray.origin;
    float reach = reach_of_rays(camera, place, frame_width, frame_height);
    media->camera_position = place;
    for (u32 i = 0; i < scene.instance_count; ++i) {
        if (!has_medium(scene, scene.instances[i])) continue;
        u32 medium = NONE;
        if (holds(scene, i, place, &medium)) enter_medium(media->camera, i, medium);
        if (comes_near(scene, i, place, reach)) media->camera_walks = 1u;
    }
}

}  // namespace luch::cpu
