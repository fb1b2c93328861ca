// The inputs of the nodes that have many, under Blender's names and with Blender's defaults. Colours
// are scene-linear, angles in turns (1 is a full turn), film thickness in nanometres.
#pragma once
#include "luch/math/vec.h"

namespace luch {

// Menu of the microfacet nodes. Each node offers a part of it.
enum class Microfacets : u8 { GGX, BECKMANN, MULTI_GGX, ASHIKHMIN_SHIRLEY };

// Menu of the nodes that scatter light under the surface.
enum class SubsurfaceMethod : u8 { RANDOM_WALK, SKIN, LEGACY, BURLEY };

struct SubsurfaceParams {
    Color color = {0.8f, 0.8f, 0.8f};
    Vec3 radius = {};  // mean free path a channel, metres: the node's radius times its scale; 0: diffuse
    float ior = 1.4f;
    float alpha = 1.0f;  // of the interface where light goes in, GGX
    float anisotropy = 0.0f;
    Vec3 normal = {};
    SubsurfaceMethod method = SubsurfaceMethod::RANDOM_WALK;
};

struct GlossyParams {
    Color color = {0.8f, 0.8f, 0.8f};
    float roughness = 0.5f;
    float anisotropy = 0.0f, rotation = 0.0f;
    Vec3 normal = {}, tangent = {};
    Microfacets distribution = Microfacets::MULTI_GGX;
};

struct MetallicParams {
    bool physical = false;  // physical conductor: ior and extinction; else F82: base_color, edge_tint
    Color base_color = {0.617f, 0.577f, 0.540f}, edge_tint = {0.695f, 0.726f, 0.770f};
    Vec3 ior = {2.757f, 2.513f, 2.231f}, extinction = {3.867f, 3.404f, 3.009f};
    float roughness = 0.5f;
    float anisotropy = 0.0f, rotation = 0.0f;
    Vec3 normal = {}, tangent = {};
    float thin_film_thickness = 0.0f, thin_film_ior = 1.33f;
    Microfacets distribution = Microfacets::MULTI_GGX;  // GGX, BECKMANN, MULTI_GGX
};

struct GlassParams {
    Color color = {1.0f, 1.0f, 1.0f};
    float roughness = 0.0f;
    float ior = 1.5f;
    Vec3 normal = {};
    float thin_film_thickness = 0.0f, thin_film_ior = 1.33f;
    Microfacets distribution = Microfacets::MULTI_GGX;  // GGX, BECKMANN, MULTI_GGX
};

struct RefractionParams {
    Color color = {1.0f, 1.0f, 1.0f};
    float roughness = 0.0f;
    float ior = 1.45f;
    Vec3 normal = {};
    Microfacets distribution = Microfacets::BECKMANN;  // GGX, BECKMANN
};

struct PrincipledParams {
    Color base_color = {0.8f, 0.8f, 0.8f};
    float metallic = 0.0f;
    float roughness = 0.5f;
    float ior = 1.5f;
    float alpha = 1.0f;
    bool thin_wall = false;
    Vec3 normal = {};
    float diffuse_roughness = 0.0f;
    float subsurface_weight = 0.0f;
    float subsurface_anisotropy = 0.0f;
    Vec3 subsurface_radius = {};    // times the node's scale, metres; 0: diffuse. Not of thin walls
    float subsurface_ior = 1.4f;    // of SKIN; the other methods take ior
    SubsurfaceMethod subsurface_method = SubsurfaceMethod::RANDOM_WALK;
    float specular_ior_level = 0.5f;
    Color specular_tint = {1.0f, 1.0f, 1.0f};
    float anisotropic = 0.0f, anisotropic_rotation = 0.0f;
    Vec3 tangent = {};
    float transmission_weight = 0.0f;
    float coat_weight = 0.0f, coat_roughness = 0.03f, coat_ior = 1.5f;
    Color coat_tint = {1.0f, 1.0f, 1.0f};
    Vec3 coat_normal = {};
    float sheen_weight = 0.0f, sheen_roughness = 0.5f;
    Color sheen_tint = {1.0f, 1.0f, 1.0f};
    Color emission_color = {1.0f, 1.0f, 1.0f};
    float emission_strength = 0.0f;
    float thin_film_thickness = 0.0f, thin_film_ior = 1.33f;
    bool multiple_scattering = true;  // distribution MULTI_GGX, else GGX
};

}  // namespace luch
