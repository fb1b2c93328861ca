// Lights, as the integrator asks for them. Lamps, emissive triangles and the world are one list of
// emitters under one light tree; every pdf is per steradian and already holds the choice of emitter.
#pragma once
#include "luch/shade/scene_view.h"

namespace luch {

enum class EmitterKind : u8 { NONE_, LAMP, TRIANGLE, WORLD };

struct LightSample {
    EmitterKind kind;     // NONE_: nothing can be sampled from here
    bool delta;           // point of no size, sun of no angle, area light of no spread
    bool mis;             // a BSDF ray may find this emitter too; false (always for delta): weight 1
    Vec3 direction;       // unit, from the shaded point to the light
    float distance;       // metres; INFINITE_DISTANCE for suns and the world
    float pdf_sa;         // for a delta light the probability of choosing it
    Color radiance;       // what the program's emission multiplies: a lamp's radiance (for a delta light
                          // its irradiance at normal incidence), 1 for triangles and the world
    u32 lamp;             // LAMP: index into LightsView::lamps, the scene's own order
    u32 instance, prim;   // TRIANGLE
    float u, v;           // TRIANGLE: barycentrics as in Hit; LAMP: what Geometry > Parametric gives
    Vec3 point, normal;   // on the light, world; normal is geometric and faces the shaded point
    u32 visibility;       // RayKind bits that the emitter lights (diffuse, glossy, transmission)
    u32 lightgroup;       // as ObjectView::lightgroup
    bool cast_shadow;
};

struct LampHit {
    u32 lamp;             // NONE: no lamp before t_max
    float t;
    Color radiance;       // multiplies the lamp's program
    float u, v;
    Vec3 normal;
};

// Implemented in light/sample.h (which includes the rest: lamp, triangle, tree, world, closest_lamp):
//   LightSample sample_light(const SceneView&, Vec3 p, Vec3 n, bool transmits, float u_select, Vec2 u, float time);
//     n: shading normal (zero vector inside a volume); transmits: light from behind n counts too.
//     A caller whose closures have normals of their own (bump per closure) passes transmits = true or n = 0:
//     emitters wholly behind n are never chosen. Triangles that move are sampled where they are at that time; they are
//     chosen by where they are at any.
//   float pdf_triangle(const SceneView&, Vec3 p, Vec3 n, bool transmits, u32 instance, u32 prim,
//                      Vec3 direction, float distance, float time);  // what sample_light would have had; 0: not a light
//   float pdf_lamp(const SceneView&, Vec3 p, Vec3 n, bool transmits, const LampHit&, Vec3 direction);
//   float pdf_world(const SceneView&, Vec3 p, Vec3 n, bool transmits, Vec3 direction);
//   LampHit closest_lamp(const SceneView&, const Ray&, u32 ray_kind);  // lamps of finite size. Unit direction.
//     Lamps let rays through: to go on, ask again with the same origin and t_min = t of the hit.
//   LampHit sun_hit(const SceneView&, u32 sun, Vec3 direction, u32 ray_kind);  // sun in [0, sun_count):
//     what a ray that leaves the scene sees of that sun; lamp = NONE outside its disk. pdf_lamp takes it.

enum class LampKind : u8 { SPHERE, DISK, SUN, RECTANGLE, ELLIPSE };  // DISK: soft falloff, faces the shaded point

// A lamp as kernels see it. Lengths in metres, world (camera-relative) space.
struct LampView {
    LampKind kind;
    bool spot;                  // SPHERE and DISK: has a cone
    bool delta;                 // see LightSample
    bool mis;                   // BSDF rays may hit it
    bool cast_shadow;
    bool has_program;           // program multiplies the radiance
    Vec3 position;
    float radius;               // SPHERE, DISK
    Color radiance;             // of its surface; delta: intensity (W/sr) or, SUN and spread 0, irradiance
    Vec3 axis_u, axis_v;        // AREA: unit axes in its plane
    float half_u, half_v;       // AREA: half extents
    Vec3 direction;             // unit, where a spot, a sun, an area light shines
    float area;                 // AREA: m2
    float tan_half_spread;      // AREA: INFINITE_DISTANCE without a spread
    float spread_scale;         // AREA: 1 / (tan a - a), a the half spread
    float cos_half_spot, spot_scale;  // smoothstep((z - cos_half_spot) * spot_scale)
    float half_cot_half_spot;
    float spot_one_minus_cos;   // 1 - cos of the widest half angle of the cone (a scaled lamp's cone is not round)
    float cos_half_angle, one_minus_cos_half_angle;  // SUN
    float to_local[9];          // rows; world direction to the lamp's own axes
    Program program;
    float random;
    u32 visibility, lightgroup;
    u32 max_bounces;            // points after more bounces do not sample it; paths that hit it still see it
    u32 emitter;                // index into LightsView::emitters; of a sun: into suns; NONE: gives no light
};

struct LightTreeNode;  // light/tree.h
struct LampBoxNode;    // light/closest_lamp.h
struct Emitter;        // light/tree.h

// An instance's part in the lights. Its triangles are emitters each, or the whole instance is one emitter (a
// cluster) whose triangle a table picks: scenes of millions of instanced emissive triangles keep their size.
struct InstanceLight {
    u32 triangles;              // offset into triangle_emitters; NONE: emits nothing, or a cluster
    u32 cluster;                // emitter; NONE: no cluster
    u32 cdf;                    // offset into cluster_cdf
    u32 sides;                  // worth sampling: 1 front, 2 back, 3 both
};

struct WorldLight {
    bool present, constant;
    Color radiance;             // constant
    u32 width, height;          // importance map, bilinear between texel centres
    const float* density;       // height * width, per unit square of (longitude, latitude): see light/world.h
    const float* row_cdf;       // height + 2
    const float* column_cdf;    // (height + 1) * (width + 1)
    float irradiance;           // that sampling is for, luminance; 0: never sampled
    u32 visibility, lightgroup;
    u32 max_bounces;            // points after more bounces do not sample it
    bool has_sun;               // an extra cone around the sun of a sky texture
    Vec3 sun_direction;
    float sun_one_minus_cos;
    float sun_irradiance, map_irradiance;  // luminance, of the sun's disk faced squarely and of the rest
};

struct LightsView {
    const LampView* lamps;
    const Emitter* emitters;            // local lamps and triangles, in the order of (lamp | instance, prim)
    const LightTreeNode* nodes;         // nodes[0]: the root
    const InstanceLight* instances;     // per instance
    const u32* triangle_emitters;  // emitter of each triangle of instances in the tree triangle by triangle; NONE
    const float* cluster_cdf;  // per shared cluster: triangle count + 1 entries, by area and radiance
    const LampBoxNode* boxes;  // boxes[0]: the root
    const u32* suns;  // lamp indices
    const float* sun_irradiance;  // luminance
    u32 lamp_count, emitter_count, node_count, box_count, sun_count;
    u32 hittable;  // RayKind bits of the rays that can hit any lamp of finite size
    bool uniform;  // light tree off: every emitter is as likely
    WorldLight world;
};

}  // namespace luch
