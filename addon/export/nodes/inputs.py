"""Input nodes: what a program asks about the point, the object, the ray.

``position``, ``normal``, ``generated``, ``uv`` are what other families need where a socket is left
unlinked; all of them heed the bump stencil (Compiler.offset_params).
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from luch.shader import ATTRIBUTE_COLOR, ATTRIBUTE_UV, Value, Vector, float_word

from ..curves import INTERCEPT, LENGTH, RANDOM
from ..derived import ISLAND, POINTINESS, property_color
from ..told import PARTICLE
from .tree import Compiler, Outputs, emitter

# PathFlag of shade/point.h
_CAMERA, _SHADOW, _DIFFUSE, _GLOSSY, _SINGULAR, _REFLECT, _TRANSMIT, _VOLUME = (1 << k for k in range(8))

# Computed by the exporter on request.
TANGENT_ATTRIBUTE = "tangent"  # of the active UV map; "NAME.tangent" of another: x, y, z, sign


def position(c: Compiler) -> Vector:
    """The point, world space (for a world: the direction)."""
    return c.builder.op3("POINT_POSITION", (), c.offset_params())


def normal(c: Compiler) -> Vector:
    """Shading normal, world space, on the side of the ray; bent where the material's displacement is bump."""
    return c.surface_normal or c.builder.op3("POINT_NORMAL")


def generated(c: Compiler) -> Vector:
    """Texture Coordinate > Generated: 0..1 over Blender's texture space."""
    return c.builder.op3("POINT_GENERATED", (), c.offset_params())


def uv(c: Compiler, name: str = "") -> Vector:
    """A UV map by name, the active one without; z is 0."""
    slot = c.builder.attribute(name) if name else ATTRIBUTE_UV
    x, y, z, _factor, _alpha = c.builder.op("ATTRIBUTE_VALUE", (), (*c.offset_params(), slot))
    return x, y, z


def tangent_slot(c: Compiler, uv_map: str) -> int:
    """Attribute slot of the tangents of a UV map, the active one without a name."""
    return c.builder.attribute(f"{uv_map}.{TANGENT_ATTRIBUTE}" if uv_map else TANGENT_ATTRIBUTE)


@emitter("ShaderNodeValue")
def value(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Value: a number."""
    return {"Value": c.builder.constant(node.outputs[0].default_value)}


@emitter("ShaderNodeRGB")
def rgb(c: Compiler, node: bpy.types.Node) -> Outputs:
    """RGB: a colour."""
    red, green, blue, _alpha = node.outputs[0].default_value
    return {"Color": c.builder.vector(red, green, blue)}


@emitter("FunctionNodeInputVector")
def vector(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Vector: what Blender leaves of a Combine XYZ whose inputs are constant."""
    x, y, z = tuple(node.vector)[:3]
    return {"Vector": c.builder.vector(x, y, z)}


@emitter("ShaderNodeTexCoord")
def texture_coordinate(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Texture Coordinate, of the object itself, of another one, or of the instancer."""
    b, corner = c.builder, c.offset_params()
    if node.object is not None:
        matrix: Any = c.context.object_matrix(node.object)
        to_object = np.linalg.inv(np.array(matrix, np.float64))[:3]
        object_space = b.op3("POINT_OTHER_OBJECT", (), (*corner, *(float_word(x) for x in to_object.ravel())))
    else:
        object_space = b.op3("POINT_OBJECT", (), corner)
    return {
        "Generated": b.op3("INSTANCER_GENERATED") if node.from_instancer else generated(c),
        "Normal": b.op3("POINT_OBJECT_NORMAL"),
        "UV": b.op3("INSTANCER_UV") if node.from_instancer else uv(c),
        "Object": object_space,
        "Camera": b.op3("POINT_CAMERA", (), corner),
        "Window": b.op3("POINT_WINDOW", (), corner),
        "Reflection": b.op3("POINT_REFLECTION"),
    }


@emitter("ShaderNodeUVMap")
def uv_map(c: Compiler, node: bpy.types.Node) -> Outputs:
    """UV Map, by name or of the instancer."""
    return {"UV": c.builder.op3("INSTANCER_UV") if node.from_instancer else uv(c, node.uv_map)}


@emitter("ShaderNodeNewGeometry")
def geometry(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Geometry."""
    b, corner = c.builder, c.offset_params()
    outputs: Outputs = {
        "Position": position(c),
        "Normal": normal(c),
        "Tangent": b.op3("TANGENT_RADIAL", (), (0, 0, 3)),
        "True Normal": b.op3("POINT_TRUE_NORMAL"),
        "Incoming": b.op3("POINT_INCOMING"),
        "Parametric": b.op3("POINT_PARAMETRIC", (), corner),
        "Backfacing": b.op1("POINT_BACKFACING"),
    }
    for identifier, name in (("Pointiness", POINTINESS), ("Random Per Island", ISLAND)):
        if c.output_used(node, identifier):
            outputs[identifier] = b.op("ATTRIBUTE_VALUE", (), (*corner, b.attribute(name)))[0]
    return outputs


@emitter("ShaderNodeObjectInfo")
def object_info(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Object Info."""
    b = c.builder
    red, green, blue, alpha = b.op("OBJECT_COLOR")
    return {
        "Location": b.op3("OBJECT_LOCATION"),
        "Color": (red, green, blue),
        "Alpha": alpha,
        "Object Index": b.op1("OBJECT_INDEX"),
        "Material Index": b.constant(c.pass_index),
        "Random": b.op1("OBJECT_RANDOM"),
    }


@emitter("ShaderNodeAttribute")
def attribute(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Attribute of the geometry, the object, the instancer or the view layer."""
    b, kind, name = c.builder, node.attribute_type, node.attribute_name
    if kind == "VIEW_LAYER":
        scene = c.context.scene
        owners = [owner for owner in (c.context.view_layer, scene, scene.world) if owner is not None]
        red, green, blue, alpha = property_color(owners, name) or (0.0, 0.0, 0.0, 0.0)
        color = b.vector(red, green, blue)
        mean = b.constant((red + green + blue) / 3.0)
        return {"Color": color, "Vector": color, "Fac": mean, "Alpha": b.constant(alpha)}
    if kind == "GEOMETRY":
        values = b.op("ATTRIBUTE_VALUE", (), (*c.offset_params(), b.attribute(name)))
    else:
        values = b.op("ATTRIBUTE_OBJECT", (), (b.attribute(f"{kind.lower()}:{name}"),))
    x, y, z, factor, alpha_value = values
    return {"Color": (x, y, z), "Vector": (x, y, z), "Fac": factor, "Alpha": alpha_value}


@emitter("ShaderNodeVertexColor")
def color_attribute(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Color Attribute, by name or the active one."""
    slot = c.builder.attribute(node.layer_name) if node.layer_name else ATTRIBUTE_COLOR
    params = (*c.offset_params(), slot)
    red, green, blue, alpha = c.builder.op("ATTRIBUTE_COLOR", (), params)
    return {"Color": (red, green, blue), "Alpha": alpha}


@emitter("ShaderNodeLightPath")
def light_path(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Light Path."""
    b = c.builder
    flags = {
        "Is Camera Ray": _CAMERA,
        "Is Shadow Ray": _SHADOW,
        "Is Diffuse Ray": _DIFFUSE,
        "Is Glossy Ray": _GLOSSY,
        "Is Singular Ray": _SINGULAR,
        "Is Reflection Ray": _REFLECT,
        "Is Transmission Ray": _TRANSMIT,
        "Is Volume Scatter Ray": _VOLUME,
    }
    outputs: Outputs = {name: b.op1("LIGHT_PATH_FLAG", (), (bit,)) for name, bit in flags.items()}
    outputs["Ray Length"] = b.op1("LIGHT_PATH_LENGTH")
    outputs["Ray Depth"] = b.op1("LIGHT_PATH_DEPTH")
    for name, shift in (("Diffuse Depth", 8), ("Glossy Depth", 16), ("Transmission Depth", 24)):
        outputs[name] = b.op1("LIGHT_PATH_KIND_DEPTH", (), (shift,))
    outputs["Transparent Depth"] = b.op1("LIGHT_PATH_TRANSPARENT_DEPTH")
    outputs["Portal Depth"] = b.constant(0.0)
    return outputs


@emitter("ShaderNodeLightFalloff")
def light_falloff(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Light Falloff."""
    inputs = (c.float(node, "Strength"), c.float(node, "Smooth"))
    return dict(zip(("Quadratic", "Linear", "Constant"), c.builder.op("LIGHT_FALLOFF", inputs), strict=True))


@emitter("ShaderNodeFresnel")
def fresnel(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Fresnel."""
    facing = c.vector_or(node, "Normal", lambda: normal(c))
    return {"Fac": c.builder.op1("FRESNEL", (c.float(node, "IOR"), *facing))}


@emitter("ShaderNodeLayerWeight")
def layer_weight(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Layer Weight."""
    inputs = (c.float(node, "Blend"), *c.vector_or(node, "Normal", lambda: normal(c)))
    return {
        "Fresnel": c.builder.op1("LAYER_WEIGHT_FRESNEL", inputs),
        "Facing": c.builder.op1("LAYER_WEIGHT_FACING", inputs),
    }


@emitter("ShaderNodeCameraData")
def camera_data(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Camera Data."""
    x, y, z, depth, distance = c.builder.op("CAMERA_DATA")
    return {"View Vector": (x, y, z), "View Z Depth": depth, "View Distance": distance}


@emitter("ShaderNodeTangent")
def tangent(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Tangent, around an axis or along a UV map."""
    if node.direction_type == "RADIAL":
        params = (0, 0, ("X", "Y", "Z").index(node.axis))
        return {"Tangent": c.builder.op3("TANGENT_RADIAL", (), params)}
    return {"Tangent": c.builder.op3("TANGENT_UV", (), (0, 0, tangent_slot(c, node.uv_map)))}


@emitter("ShaderNodeWireframe")
def wireframe(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Wireframe, in world units or pixels."""
    params = (*c.offset_params(), int(node.use_pixel_size))
    return {"Fac": c.builder.op1("WIREFRAME", (c.float(node, "Size"),), params)}


@emitter("ShaderNodeBevel")
def bevel(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Bevel: not traced; the normal stays sharp."""
    c.warn(node, "is not supported yet; the normal stays as it is")
    return {"Normal": c.vector_or(node, "Normal", lambda: normal(c))}


@emitter("ShaderNodeAmbientOcclusion")
def ambient_occlusion(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Ambient Occlusion: not traced; nothing is occluded."""
    c.warn(node, "is not supported yet; nothing is taken as occluded")
    return {"Color": c.color(node, "Color"), "AO": c.builder.constant(1.0)}


@emitter("ShaderNodePointInfo")
def point_info(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Point Info: of a point cloud's point; on a mesh zero."""
    x, y, z, radius, random = c.builder.op("POINT_INFO")
    return {"Position": (x, y, z), "Radius": radius, "Random": random}


@emitter("ShaderNodeHairInfo")
def curves_info(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Curves Info: of a hair; elsewhere zero."""
    strand, thickness, *normal = c.builder.op("CURVES_INFO")

    def told(name: str) -> Value:
        return c.builder.op("ATTRIBUTE_VALUE", (), (0, 0, c.builder.attribute(name)))[3]

    return {
        "Is Strand": strand,
        "Intercept": told(INTERCEPT),
        "Length": told(LENGTH),
        "Thickness": thickness,
        "Tangent Normal": (normal[0], normal[1], normal[2]),
        "Random": told(RANDOM),
    }


@emitter("ShaderNodeParticleInfo")
def particle_info(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Particle Info: of the particle that shows this object."""
    outputs: Outputs = {}
    for socket in node.outputs:
        if not c.output_used(node, socket.identifier):
            continue
        x, y, z, *_ = c.builder.op("ATTRIBUTE_OBJECT", (), (c.builder.attribute(PARTICLE + socket.name),))
        outputs[socket.identifier] = (x, y, z) if socket.type == "VECTOR" else x
    return outputs


@emitter("ShaderNodeVolumeInfo")
def no_such_geometry(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Volume Info on a mesh: zero, as in Cycles."""
    return {
        socket.identifier: c.builder.vector(0.0, 0.0, 0.0)
        if socket.type in ("VECTOR", "RGBA")
        else c.builder.constant(0.0)
        for socket in node.outputs
    }
