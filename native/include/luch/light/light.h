// Lights, as the integrator asks for them. Lamps, emissive triangles and the world are one list of
// emitters under one light tree; every pdf is per steradian and already holds the choice of emitter.
#pragma once
#include "luch/shade/scene_view.h"

namespace luch {

enum class EmitterKind : u8 { NONE_, LAMP, TRIANGLE, WORLD };

struct LightSample {
    EmitterKind kind;     // NONE_: nothing can be sampled from here
    bool delta;           // point of no size or sun of no angle: a BSDF ray cannot find it
    Vec3 direction;       // unit, from the shaded point to the light
    float distance;       // metres; INFINITE_DISTANCE for suns and the world
    float pdf_sa;         // for a delta light the probability of choosing it
    Color radiance;       // what the program's emission multiplies: a lamp's radiance (for a delta light
                          // its irradiance at normal incidence), 1 for triangles and the world
    u32 lamp;             // LAMP: index into SceneView::lights
    u32 instance, prim;   // TRIANGLE
    float u, v;           // TRIANGLE: barycentrics; LAMP: its parametric coordinates
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

// Implemented in the other headers of this room:
//   LightSample sample_light(const SceneView&, Vec3 p, Vec3 n, bool transmits, float u_select, Vec2 u);
//     n: shading normal (zero vector inside a volume); transmits: light from behind n counts too.
//   float pdf_triangle(const SceneView&, Vec3 p, Vec3 n, bool transmits, u32 instance, u32 prim,
//                      Vec3 direction, float distance);   // what sample_light would have had; 0: not a light
//   float pdf_lamp(const SceneView&, Vec3 p, Vec3 n, bool transmits, const LampHit&, Vec3 direction);
//   float pdf_world(const SceneView&, Vec3 p, Vec3 n, bool transmits, Vec3 direction);
//   LampHit closest_lamp(const SceneView&, const Ray&, u32 ray_kind);  // area, sphere, spot lamps of finite size
//   Color suns_radiance(const SceneView&, Vec3 direction, u32 ray_kind, ...);  // suns with an angle, seen by a ray that leaves the scene
// Host side (cpu/lights.h): builds LightsView from luch.Scene's lights, emissive triangles and world map.

}  // namespace luch
