// What code is compiled in. 1: the effect may be there, which is then asked at run time; 0: the scene has none, and
// neither has the code. General code has them all: the CPU's, and the kernels that are compiled ahead of time. A
// scene's own kernels get their -D from luch/cuda/plan.py, which reads luch.effects.
#pragma once
#include "luch/platform.h"

#ifndef LUCH_PLAN_CURVES
#define LUCH_PLAN_CURVES !LUCH_CUDA  // kernels that trace are compiled again for scenes with hair
#endif
#ifndef LUCH_PLAN_CURVE_SHAPE
#define LUCH_PLAN_CURVE_SHAPE 3
#endif
#ifndef LUCH_PLAN_SPHERES
#define LUCH_PLAN_SPHERES 1
#endif
#ifndef LUCH_PLAN_HAIR
#define LUCH_PLAN_HAIR 1
#endif
#ifndef LUCH_PLAN_FIBRES
#define LUCH_PLAN_FIBRES 1
#endif
#ifndef LUCH_PLAN_HAIR_CONES
#define LUCH_PLAN_HAIR_CONES 1
#endif
#ifndef LUCH_PLAN_THIN_FILM
#define LUCH_PLAN_THIN_FILM 1
#endif
#ifndef LUCH_PLAN_SHEEN
#define LUCH_PLAN_SHEEN 1
#endif
#ifndef LUCH_PLAN_TOON
#define LUCH_PLAN_TOON 1
#endif
#ifndef LUCH_PLAN_ASHIKHMIN_SHIRLEY
#define LUCH_PLAN_ASHIKHMIN_SHIRLEY 1
#endif
#ifndef LUCH_PLAN_MICROFACETS
#define LUCH_PLAN_MICROFACETS 1
#endif
#ifndef LUCH_PLAN_ROUND_LAMPS
#define LUCH_PLAN_ROUND_LAMPS 1
#endif
#ifndef LUCH_PLAN_AREA_LAMPS
#define LUCH_PLAN_AREA_LAMPS 1
#endif
#ifndef LUCH_PLAN_VISIBLE_LAMPS
#define LUCH_PLAN_VISIBLE_LAMPS 1
#endif
#ifndef LUCH_PLAN_LAMP_PROGRAMS
#define LUCH_PLAN_LAMP_PROGRAMS 1
#endif
#ifndef LUCH_PLAN_EMISSION_PROGRAMS
#define LUCH_PLAN_EMISSION_PROGRAMS 1
#endif
#ifndef LUCH_PLAN_WORLD_PROGRAM
#define LUCH_PLAN_WORLD_PROGRAM 1
#endif
#ifndef LUCH_PLAN_SUNS
#define LUCH_PLAN_SUNS 1
#endif
#ifndef LUCH_PLAN_EMISSIVE_MESHES
#define LUCH_PLAN_EMISSIVE_MESHES 1
#endif
#ifndef LUCH_PLAN_WORLD_SAMPLING
#define LUCH_PLAN_WORLD_SAMPLING 1
#endif
#ifndef LUCH_PLAN_LIGHT_PASSES
#define LUCH_PLAN_LIGHT_PASSES 1
#endif
#ifndef LUCH_PLAN_DATA_PASSES
#define LUCH_PLAN_DATA_PASSES 1
#endif
#ifndef LUCH_PLAN_DENOISING_PASSES
#define LUCH_PLAN_DENOISING_PASSES 1
#endif
#ifndef LUCH_PLAN_AMBIENT_OCCLUSION
#define LUCH_PLAN_AMBIENT_OCCLUSION 1
#endif
#ifndef LUCH_PLAN_FILTER_GLOSSY
#define LUCH_PLAN_FILTER_GLOSSY 1
#endif
#ifndef LUCH_PLAN_HOLDOUT
#define LUCH_PLAN_HOLDOUT 1
#endif
#ifndef LUCH_PLAN_CLAMPING
#define LUCH_PLAN_CLAMPING 1
#endif
#ifndef LUCH_PLAN_SUBSURFACE
#define LUCH_PLAN_SUBSURFACE 1
#endif
#ifndef LUCH_PLAN_BENT_EXITS
#define LUCH_PLAN_BENT_EXITS 1
#endif
#ifndef LUCH_PLAN_VOLUMES
#define LUCH_PLAN_VOLUMES 1
#endif
#ifndef LUCH_PLAN_MOTION
#define LUCH_PLAN_MOTION 1
#endif
#ifndef LUCH_PLAN_PHOTONS
#define LUCH_PLAN_PHOTONS !LUCH_CUDA  // kernels that ask for photons are compiled again for scenes that want them
#endif
#ifndef LUCH_PLAN_TIME
#define LUCH_PLAN_TIME 1
#endif
#ifndef LUCH_PLAN_COAT
#define LUCH_PLAN_COAT 1
#endif
#ifndef LUCH_PLAN_METALS
#define LUCH_PLAN_METALS 1
#endif
#ifndef LUCH_PLAN_CONDUCTORS
#define LUCH_PLAN_CONDUCTORS 1
#endif
#ifndef LUCH_PLAN_TRANSMISSION
#define LUCH_PLAN_TRANSMISSION 1
#endif
#ifndef LUCH_PLAN_THIN_WALLS
#define LUCH_PLAN_THIN_WALLS 1
#endif
#ifndef LUCH_PLAN_ANISOTROPY
#define LUCH_PLAN_ANISOTROPY 1
#endif
#ifndef LUCH_PLAN_BECKMANN
#define LUCH_PLAN_BECKMANN 1
#endif
#ifndef LUCH_PLAN_ROUGH_DIFFUSE
#define LUCH_PLAN_ROUGH_DIFFUSE 1
#endif
#ifndef LUCH_PLAN_CUBIC_IMAGES
#define LUCH_PLAN_CUBIC_IMAGES 1
#endif
#ifndef LUCH_PLAN_HALF_IMAGES
#define LUCH_PLAN_HALF_IMAGES 1
#endif
#ifndef LUCH_PLAN_FLOAT_IMAGES
#define LUCH_PLAN_FLOAT_IMAGES 1
#endif
#ifndef LUCH_PLAN_MOST_LOBES
#define LUCH_PLAN_MOST_LOBES 12  // Principled alone can make 8
#endif
#ifndef LUCH_PLAN_SAMPLER
#if LUCH_CUDA
#define LUCH_PLAN_SAMPLER 0  // kernels that draw numbers are compiled again for the other families
#else
#define LUCH_PLAN_SAMPLER 3
#endif
#endif

namespace luch::plan {

inline constexpr bool CURVES = LUCH_PLAN_CURVES;  // primitives that are pieces of hair
inline constexpr u32 CURVE_SHAPE = LUCH_PLAN_CURVE_SHAPE;  // the one CurveShape (geometry/curve.h) that there is
inline constexpr u32 ANY_CURVE_SHAPE = 3;                  // it is asked at run time
inline constexpr bool SPHERES = LUCH_PLAN_SPHERES;         // primitives that are points of point clouds
inline constexpr bool FIBRES = LUCH_PLAN_HAIR && LUCH_PLAN_FIBRES;          // lobes of Principled Hair
inline constexpr bool HAIR_CONES = LUCH_PLAN_HAIR && LUCH_PLAN_HAIR_CONES;  // lobes of the Hair BSDF node
inline constexpr bool HAIR = FIBRES || HAIR_CONES;
inline constexpr bool THIN_FILM = LUCH_PLAN_THIN_FILM;
inline constexpr bool SHEEN = LUCH_PLAN_SHEEN;  // Sheen and velvet lobes
inline constexpr bool TOON = LUCH_PLAN_TOON;
inline constexpr bool ASHIKHMIN_SHIRLEY = LUCH_PLAN_ASHIKHMIN_SHIRLEY;
inline constexpr bool MICROFACETS = LUCH_PLAN_MICROFACETS;
inline constexpr bool ROUND_LAMPS = LUCH_PLAN_ROUND_LAMPS;  // point and spot
inline constexpr bool AREA_LAMPS = LUCH_PLAN_AREA_LAMPS;
inline constexpr bool VISIBLE_LAMPS = LUCH_PLAN_VISIBLE_LAMPS;  // rays look for them
inline constexpr bool LAMP_PROGRAMS = LUCH_PLAN_LAMP_PROGRAMS;  // a lamp has nodes
inline constexpr bool EMISSION_PROGRAMS =
    LUCH_PLAN_EMISSION_PROGRAMS;  // a surface's emission is not the same everywhere
inline constexpr bool WORLD_PROGRAM = LUCH_PLAN_WORLD_PROGRAM;  // the world is not of one colour
inline constexpr bool LAMPS = ROUND_LAMPS || AREA_LAMPS;  // other than suns
inline constexpr bool SUNS = LUCH_PLAN_SUNS;
inline constexpr bool EMISSIVE_MESHES = LUCH_PLAN_EMISSIVE_MESHES;
inline constexpr bool WORLD_SAMPLING = LUCH_PLAN_WORLD_SAMPLING;
inline constexpr bool LIGHT_PASSES = LUCH_PLAN_LIGHT_PASSES;
inline constexpr bool DATA_PASSES = LUCH_PLAN_DATA_PASSES;
inline constexpr bool DENOISING_PASSES = LUCH_PLAN_DENOISING_PASSES;
inline constexpr bool AMBIENT_OCCLUSION = LUCH_PLAN_AMBIENT_OCCLUSION;
inline constexpr bool FILTER_GLOSSY = LUCH_PLAN_FILTER_GLOSSY;
inline constexpr bool HOLDOUT = LUCH_PLAN_HOLDOUT;
inline constexpr bool CLAMPING = LUCH_PLAN_CLAMPING;
inline constexpr bool SUBSURFACE = LUCH_PLAN_SUBSURFACE;  // other than of thin walls
inline constexpr bool BENT_EXITS = LUCH_PLAN_BENT_EXITS;  // of walks under surfaces whose program bends the normal
inline constexpr bool VOLUMES = LUCH_PLAN_VOLUMES;
inline constexpr bool MOTION = LUCH_PLAN_MOTION;  // of the camera, of objects, of their shapes
inline constexpr bool PHOTONS = LUCH_PLAN_PHOTONS;  // photon maps (integrator/caustics.h)
inline constexpr bool TIME = LUCH_PLAN_TIME;      // the Render Time pass
inline constexpr bool COAT = LUCH_PLAN_COAT;
inline constexpr bool METALS = LUCH_PLAN_METALS;  // Metallic and Principled's metal, by the tint at 82 degrees
inline constexpr bool CONDUCTORS = LUCH_PLAN_CONDUCTORS;  // by index and extinction
inline constexpr bool TRANSMISSION = LUCH_PLAN_TRANSMISSION;  // microfacets that refract
inline constexpr bool THIN_WALLS = LUCH_PLAN_THIN_WALLS;
inline constexpr bool ANISOTROPY = LUCH_PLAN_ANISOTROPY;
inline constexpr bool BECKMANN = LUCH_PLAN_BECKMANN;
inline constexpr bool ROUGH_DIFFUSE = LUCH_PLAN_ROUGH_DIFFUSE;  // Oren and Nayar
inline constexpr bool CUBIC_IMAGES = LUCH_PLAN_CUBIC_IMAGES;  // images looked up by cubic interpolation
inline constexpr bool HALF_IMAGES = LUCH_PLAN_HALF_IMAGES;
inline constexpr bool FLOAT_IMAGES = LUCH_PLAN_FLOAT_IMAGES;
inline constexpr int MOST_LOBES = LUCH_PLAN_MOST_LOBES;  // at one point
inline constexpr u32 SAMPLER = LUCH_PLAN_SAMPLER;  // the one SamplerFamily (sampling/sampler.h) that there is
inline constexpr u32 ANY_SAMPLER = 3;              // it is asked at run time

// A light that was chosen may have a program to ask for its emission.
inline constexpr bool SAMPLED_PROGRAMS = EMISSION_PROGRAMS || LAMP_PROGRAMS || (WORLD_PROGRAM && WORLD_SAMPLING);

}  // namespace luch::plan
