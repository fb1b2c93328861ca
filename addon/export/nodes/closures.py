"""Closure nodes: what a surface does with light. Each is given the weight it carries in the tree.

An unlinked Normal is passed as the zero vector (the shading normal, or the bump that stands for the
material's displacement); an unlinked Tangent matters only to anisotropic lobes.
"""

from __future__ import annotations

import bpy
from luch.shader import Value, Vector

from ..curves import RANDOM
from .tree import Compiler, closure_emitter

_SUBSURFACE = {"RANDOM_WALK": 0, "RANDOM_WALK_SKIN": 1, "RANDOM_WALK_LEGACY": 2, "BURLEY": 3}  # SubsurfaceMethod, there
_BUMP_CORRECTION, _OWN_NORMAL = 1, 2  # bits of a lobe's first word: shade/nodes/closures.h
_MICROFACETS = {"GGX": 0, "BECKMANN": 1, "MULTI_GGX": 2, "ASHIKHMIN_SHIRLEY": 3}  # Microfacets of bsdf/params.h


def _normal(c: Compiler, node: bpy.types.Node, identifier: str = "Normal") -> Vector:
    return c.vector_or(node, identifier, lambda: c.surface_normal or c.builder.vector(0.0, 0.0, 0.0))


def _tangent(c: Compiler, node: bpy.types.Node, anisotropy: Value) -> Vector:
    """The tangent, radial about Z where none is linked; zero where nothing is anisotropic."""
    if c.builder.known(anisotropy) == 0.0:
        return c.builder.vector(0.0, 0.0, 0.0)
    return c.vector_or(node, "Tangent", lambda: c.builder.op3("TANGENT_RADIAL", (), (0, 0, 3)))


def _params(c: Compiler, node: bpy.types.Node, *words: int) -> tuple[int, ...]:
    """What the closure's normal is, and its other words. The normal of a displacement that is shown as bump is the
    surface's own: light that meets it is not softened as on a Bump node's."""
    own = c.surface_normal is not None and not c.is_linked(node, "Normal")
    return (_BUMP_CORRECTION * c.bump_correction | _OWN_NORMAL * own, *words)


@closure_emitter("ShaderNodeEmission", "ShaderNodeBackground")
def emission(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Emission and Background: colour x strength."""
    radiance = c.builder.scale(c.color(node, "Color"), c.float(node, "Strength"))
    c.builder.closure("CLOSURE_EMISSION", c.builder.modulate(weight, radiance))


@closure_emitter("ShaderNodeBsdfTransparent")
def transparent(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Transparent: lets light pass straight on."""
    c.builder.closure("CLOSURE_TRANSPARENT", c.builder.modulate(weight, c.color(node, "Color")))


@closure_emitter("ShaderNodeHoldout")
def holdout(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Holdout: a hole in the picture."""
    c.builder.closure("CLOSURE_HOLDOUT", weight)


@closure_emitter("ShaderNodeMixShader")
def mix_shader(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Mix Shader: 1 - Fac of the first, Fac of the second."""
    b = c.builder
    factor = b.op1("MATH_SATURATE", (c.float(node, "Fac"),))
    rest = b.op1("MATH_SUBTRACT", (b.constant(1.0), factor))
    c.closure(node, "Shader", b.scale(weight, rest))
    c.closure(node, "Shader_001", b.scale(weight, factor))


@closure_emitter("ShaderNodeAddShader")
def add_shader(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Add Shader: both, in full."""
    c.closure(node, "Shader", weight)
    c.closure(node, "Shader_001", weight)


@closure_emitter("ShaderNodeBsdfDiffuse")
def diffuse(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Diffuse: Lambert, Oren-Nayar where it is rough."""
    inputs = (*c.color(node, "Color"), c.float(node, "Roughness"), *_normal(c, node))
    c.builder.closure("CLOSURE_DIFFUSE", weight, inputs, _params(c, node))


@closure_emitter("ShaderNodeBsdfTranslucent")
def translucent(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Translucent: diffuse to the other side."""
    c.builder.closure("CLOSURE_TRANSLUCENT", weight, (*c.color(node, "Color"), *_normal(c, node)), _params(c, node))


@closure_emitter("ShaderNodeBsdfSheen")
def sheen(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Sheen: microfibre, or Ashikhmin's velvet."""
    inputs = (*c.color(node, "Color"), c.float(node, "Roughness"), *_normal(c, node))
    c.builder.closure("CLOSURE_SHEEN", weight, inputs, _params(c, node, int(node.distribution == "ASHIKHMIN")))


@closure_emitter("ShaderNodeBsdfToon")
def toon(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Toon: diffuse or glossy."""
    inputs = (*c.color(node, "Color"), c.float(node, "Size"), c.float(node, "Smooth"), *_normal(c, node))
    c.builder.closure("CLOSURE_TOON", weight, inputs, _params(c, node, int(node.component == "GLOSSY")))


@closure_emitter("ShaderNodeBsdfAnisotropic")
def glossy(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Glossy."""
    anisotropy = c.float(node, "Anisotropy")
    scalars = (c.float(node, "Roughness"), anisotropy, c.float(node, "Rotation"))
    inputs = (*c.color(node, "Color"), *scalars, *_normal(c, node), *_tangent(c, node, anisotropy))
    c.builder.closure("CLOSURE_GLOSSY", weight, inputs, _params(c, node, _MICROFACETS[node.distribution]))


@closure_emitter("ShaderNodeBsdfMetallic")
def metallic(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Metallic: F82 tint or a physical conductor."""
    anisotropy = c.float(node, "Anisotropy")
    colors = [value for name in ("Base Color", "Edge Tint", "IOR", "Extinction") for value in c.vector(node, name)]
    scalars = (c.float(node, "Roughness"), anisotropy, c.float(node, "Rotation"))
    film = (c.float(node, "Thin Film Thickness"), c.float(node, "Thin Film IOR"))
    inputs = (*colors, *scalars, *_normal(c, node), *_tangent(c, node, anisotropy), *film)
    physical = int(node.fresnel_type == "PHYSICAL_CONDUCTOR")
    c.builder.closure("CLOSURE_METALLIC", weight, inputs, _params(c, node, _MICROFACETS[node.distribution], physical))


@closure_emitter("ShaderNodeBsdfGlass")
def glass(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Glass."""
    film = (c.float(node, "Thin Film Thickness"), c.float(node, "Thin Film IOR"))
    scalars = (c.float(node, "Roughness"), c.float(node, "IOR"))
    inputs = (*c.color(node, "Color"), *scalars, *_normal(c, node), *film)
    c.builder.closure("CLOSURE_GLASS", weight, inputs, _params(c, node, _MICROFACETS[node.distribution]))


@closure_emitter("ShaderNodeBsdfRefraction")
def refraction(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Refraction."""
    inputs = (*c.color(node, "Color"), c.float(node, "Roughness"), c.float(node, "IOR"), *_normal(c, node))
    c.builder.closure("CLOSURE_REFRACTION", weight, inputs, _params(c, node, _MICROFACETS[node.distribution]))


@closure_emitter("ShaderNodeBsdfPrincipled")
def principled(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Principled. Alpha, and emission under neither coat nor sheen, become closures of their own."""
    b = c.builder
    alpha = b.op1("MATH_SATURATE", (c.float(node, "Alpha"),))
    b.closure("CLOSURE_TRANSPARENT", b.scale(weight, b.op1("MATH_SUBTRACT", (b.constant(1.0), alpha))))
    weight = b.scale(weight, alpha)
    strength = c.float(node, "Emission Strength")
    glow = b.scale(c.color(node, "Emission Color"), strength)
    layered = any(b.known(c.float(node, name)) != 0.0 for name in ("Coat Weight", "Sheen Weight"))
    if not layered:
        b.closure("CLOSURE_EMISSION", b.modulate(weight, glow))
        glow = b.vector(0.0, 0.0, 0.0)
    emits = any(b.known(value) != 0.0 for value in glow)
    thin_wall, transmission = c.float(node, "Thin Wall"), c.float(node, "Transmission Weight")
    lets_through = b.known(thin_wall) != 0.0 and b.known(transmission) != 0.0
    params = _params(c, node, int(node.distribution == "MULTI_GGX"), int(emits), int(lets_through))
    inputs = _principled_inputs(c, node, thin_wall, glow)
    radius = _subsurface_radius(c, node, "Subsurface Radius", "Subsurface Scale")
    walks = b.known(thin_wall) in (None, 0.0) and b.known(c.float(node, "Subsurface Weight")) != 0.0
    if walks and b.known_vector(radius) != (0.0, 0.0, 0.0):
        inputs = [*radius, c.float(node, "Subsurface IOR"), *inputs]
        method = _SUBSURFACE[node.subsurface_method]
        b.closure("CLOSURE_PRINCIPLED_SUBSURFACE", weight, inputs, (*params, method))
    else:
        b.closure("CLOSURE_PRINCIPLED", weight, inputs, params)


def _subsurface_radius(c: Compiler, node: bpy.types.Node, radius: str, scale: str) -> Vector:
    """Metres a channel."""
    return c.builder.scale(c.vector(node, radius), c.float(node, scale))


def _principled_inputs(c: Compiler, node: bpy.types.Node, thin_wall: Value, glow: Vector) -> list[Value]:
    """The node's inputs in the order that OpClosurePrincipled reads them."""
    anisotropic = c.float(node, "Anisotropic")
    has_coat = c.builder.known(c.float(node, "Coat Weight")) != 0.0
    zero = c.builder.vector(0.0, 0.0, 0.0)
    coat_normal = _normal(c, node, "Coat Normal") if has_coat or c.is_linked(node, "Coat Normal") else zero

    def scalars(*names: str) -> list[Value]:
        return [c.float(node, name) for name in names]

    return [
        *c.color(node, "Base Color"),
        *scalars("Metallic", "Roughness", "IOR"),
        thin_wall,
        *_normal(c, node),
        *scalars("Diffuse Roughness", "Subsurface Weight", "Subsurface Anisotropy", "Specular IOR Level"),
        *c.color(node, "Specular Tint"),
        anisotropic,
        *scalars("Anisotropic Rotation"),
        *_tangent(c, node, anisotropic),
        *scalars("Transmission Weight", "Coat Weight", "Coat Roughness", "Coat IOR"),
        *c.color(node, "Coat Tint"),
        *coat_normal,
        *scalars("Sheen Weight", "Sheen Roughness"),
        *c.color(node, "Sheen Tint"),
        *glow,
        c.builder.constant(1.0),  # strength is in the colour
        *scalars("Thin Film Thickness", "Thin Film IOR"),
    ]


@closure_emitter("ShaderNodeSubsurfaceScattering")
def subsurface(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Subsurface Scattering; diffuse where its radius is known to be 0."""
    color, radius = c.color(node, "Color"), _subsurface_radius(c, node, "Radius", "Scale")
    if c.builder.known_vector(radius) == (0.0, 0.0, 0.0):
        smooth = c.builder.constant(0.0)
        c.builder.closure("CLOSURE_DIFFUSE", weight, (*color, smooth, *_normal(c, node)), _params(c, node))
        return
    scalars = (c.float(node, "IOR"), c.float(node, "Roughness"), c.float(node, "Anisotropy"))
    inputs = (*color, *radius, *scalars, *_normal(c, node))
    c.builder.closure("CLOSURE_SUBSURFACE", weight, inputs, _params(c, node, _SUBSURFACE[node.falloff]))


@closure_emitter("ShaderNodeBsdfHair")
def hair(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Hair BSDF: reflection or transmission. Without a tangent of its own the curve's serves."""
    tangent = c.vector(node, "Tangent") if c.is_linked(node, "Tangent") else c.builder.vector(0.0, 0.0, 0.0)
    scalars = (c.float(node, "Offset"), c.float(node, "RoughnessU"), c.float(node, "RoughnessV"))
    inputs = (*c.color(node, "Color"), *scalars, *tangent)
    c.builder.closure("CLOSURE_HAIR", weight, inputs, _params(c, node, int(node.component == "Transmission")))


# As HairColor of luch/bsdf/setup_hair.h.
_HAIR_COLORS = {"ABSORPTION": 0, "MELANIN": 1, "COLOR": 2}


@closure_emitter("ShaderNodeBsdfHairPrincipled")
def principled_hair(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Principled Hair: the model of Chiang, in all three ways to give a colour."""
    radial = c.float(node, "Radial Roughness")
    if node.model == "HUANG":
        c.warn(node, "uses the model Huang, which is not supported yet; it is shown by the model Chiang", "Huang hair")
        radial = c.float(node, "Roughness")
    random = (
        c.float(node, "Random")
        if c.is_linked(node, "Random")
        else c.builder.op("ATTRIBUTE_VALUE", (), (0, 0, c.builder.attribute(RANDOM)))[3]
    )

    def scalars(*names: str) -> list[Value]:
        return [c.float(node, name) for name in names]

    inputs = [
        *c.color(node, "Color"),
        *scalars("Melanin", "Melanin Redness"),
        *c.color(node, "Tint"),
        *c.vector(node, "Absorption Coefficient"),
        *scalars("Roughness"),
        radial,
        *scalars("Coat", "IOR", "Offset", "Random Color", "Random Roughness"),
        random,
    ]
    c.builder.closure("CLOSURE_PRINCIPLED_HAIR", weight, inputs, _params(c, node, _HAIR_COLORS[node.parametrization]))


@closure_emitter("ShaderNodeBsdfRayPortal")
def ray_portal(c: Compiler, node: bpy.types.Node, weight: Vector) -> None:
    """Ray Portal: light passes straight on."""
    c.warn(node, "is not supported yet; light passes straight through")
    c.builder.closure("CLOSURE_TRANSPARENT", c.builder.modulate(weight, c.color(node, "Color")))
