"""Vector nodes: Vector Math, Mapping, rotations, spaces, Bump, Normal Map."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from luch.shader import Value, Vector

from .converters import apply_curves
from .inputs import normal, tangent_slot
from .tree import Compiler, Outputs, emitter, find_socket

# Modes that work on each component alone: the Math operation and how many vectors it reads.
_EACH = {
    **dict.fromkeys(["FLOOR", "CEIL", "ABSOLUTE", "SINE", "COSINE", "TANGENT", "SIGN", "ROUND"], 1),
    **dict.fromkeys(["ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "SNAP", "MODULO", "MINIMUM", "MAXIMUM", "POWER"], 2),
    **dict.fromkeys(["WRAP", "MULTIPLY_ADD"], 3),
}
_PAIRS_TO_VECTOR = ("CROSS_PRODUCT", "PROJECT", "REFLECT")
_PAIRS_TO_VALUE = ("DOT_PRODUCT", "DISTANCE")


@emitter("ShaderNodeVectorMath")
def vector_math(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Vector Math, in every mode."""
    b, mode = c.builder, node.operation

    def read(k: int) -> Vector:
        return c.vector(node, ("Vector", "Vector_001", "Vector_002")[k])

    if mode in _EACH:
        return {"Vector": b.each(f"MATH_{mode}", *(read(k) for k in range(_EACH[mode])))}
    if mode == "FRACTION":
        return {"Vector": b.each("MATH_FRACT", read(0))}
    if mode == "SCALE":
        return {"Vector": b.scale(read(0), c.float(node, "Scale"))}
    if mode in _PAIRS_TO_VECTOR:
        return {"Vector": b.op3(f"VECTOR_{mode}", (*read(0), *read(1)))}
    if mode in _PAIRS_TO_VALUE:
        return {"Value": b.op1(f"VECTOR_{mode}", (*read(0), *read(1)))}
    if mode == "REFRACT":
        return {"Vector": b.op3("VECTOR_REFRACT", (*read(0), *read(1), c.float(node, "Scale")))}
    if mode == "FACEFORWARD":
        return {"Vector": b.op3("VECTOR_FACEFORWARD", (*read(0), *read(1), *read(2)))}
    if mode == "LENGTH":
        return {"Value": b.op1("VECTOR_LENGTH", read(0))}
    return {"Vector": b.op3("VECTOR_NORMALIZE", read(0))}


@emitter("ShaderNodeVectorCurve")
def vector_curves(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Vector Curves."""
    x, y, z = apply_curves(c, node.mapping, c.vector(node, "Vector"), c.float(node, "Fac"), combined=False)
    return {"Vector": (x, y, z)}


def rotate_euler(c: Compiler, vector: Vector, rotation: Vector, inverse: bool = False) -> Vector:
    """A vector turned by XYZ Euler angles, or back; angles known to be zero cost nothing."""
    if c.builder.known_vector(rotation) == (0.0, 0.0, 0.0):
        return vector
    columns = c.builder.op("EULER_MATRIX", rotation)
    name = "MATRIX_MULTIPLY_TRANSPOSED" if inverse else "MATRIX_MULTIPLY"
    return c.builder.op3(name, (*vector, *columns))


@emitter("ShaderNodeMapping")
def mapping(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Mapping: point, texture, vector or normal."""
    b = c.builder
    vector, rotation, scale = c.vector(node, "Vector"), c.vector(node, "Rotation"), c.vector(node, "Scale")
    if node.vector_type == "TEXTURE":
        moved = b.each("MATH_SUBTRACT", vector, c.vector(node, "Location"))
        return {"Vector": b.each("MATH_DIVIDE", rotate_euler(c, moved, rotation, inverse=True), scale)}
    if node.vector_type == "NORMAL":
        turned = rotate_euler(c, b.each("MATH_DIVIDE", vector, scale), rotation)
        return {"Vector": b.op3("VECTOR_NORMALIZE", turned)}
    turned = rotate_euler(c, b.modulate(vector, scale), rotation)
    if node.vector_type == "VECTOR":
        return {"Vector": turned}
    return {"Vector": b.each("MATH_ADD", turned, c.vector(node, "Location"))}


@emitter("ShaderNodeVectorRotate")
def vector_rotate(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Vector Rotate about an axis or by Euler angles."""
    b = c.builder
    center = c.vector(node, "Center")
    arm = b.each("MATH_SUBTRACT", c.vector(node, "Vector"), center)
    if node.rotation_type == "EULER_XYZ":
        turned = rotate_euler(c, arm, c.vector(node, "Rotation"), inverse=node.invert)
    else:
        axes = {"X_AXIS": (1.0, 0.0, 0.0), "Y_AXIS": (0.0, 1.0, 0.0), "Z_AXIS": (0.0, 0.0, 1.0)}
        fixed = axes.get(node.rotation_type)
        axis = b.vector(*fixed) if fixed else c.vector(node, "Axis")
        angle = c.float(node, "Angle")
        if node.invert:
            angle = b.multiply(angle, b.constant(-1.0))
        turned = b.op3("ROTATE_AXIS", (*arm, *axis, angle))
    return {"Vector": b.each("MATH_ADD", turned, center)}


@emitter("ShaderNodeVectorTransform")
def vector_transform(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Vector Transform between world, object and camera."""
    spaces = ("WORLD", "OBJECT", "CAMERA")
    params = (
        spaces.index(node.convert_from),
        spaces.index(node.convert_to),
        ("VECTOR", "POINT", "NORMAL").index(node.vector_type),
    )
    return {"Vector": c.builder.op3("VECTOR_TRANSFORM", c.vector(node, "Vector"), params)}


@emitter("ShaderNodeNormal")
def normal_node(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Normal: a direction picked by hand, and its cosine with the input."""
    b = c.builder
    direction = b.op3("VECTOR_NORMALIZE", b.vector(*node.outputs["Normal"].default_value))
    given = b.op3("VECTOR_NORMALIZE", c.vector(node, "Normal"))
    return {"Normal": direction, "Dot": b.op1("VECTOR_DOT_PRODUCT", (*direction, *given))}


def bump_normal(
    c: Compiler,
    height: Callable[[], Value],
    *,
    strength: Value,
    distance: Value,
    filter_width: float,
    base: Vector,
    inverted: bool = False,
    object_space: bool = False,
) -> Vector:
    """A normal bent by a height, which is emitted at the three corners of the bump stencil."""
    heights = []
    for corner in range(3):
        with c.at_offset(corner, filter_width):
            heights.append(height())
    if heights[0] == heights[1] == heights[2]:  # the same everywhere
        return base
    width = c.builder.constant(filter_width)
    inputs = (strength, distance, width, *heights, *base)
    return c.builder.op3("BUMP", inputs, (int(inverted), int(object_space)))


@emitter("ShaderNodeBump")
def bump(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Bump."""
    base = c.vector_or(node, "Normal", lambda: normal(c))
    if not c.is_linked(node, "Height"):
        return {"Normal": base}
    bent = bump_normal(
        c,
        lambda: c.float(node, "Height"),
        strength=c.float(node, "Strength"),
        distance=c.float(node, "Distance"),
        filter_width=find_socket(node.inputs, "Filter Width").default_value,
        base=base,
        inverted=node.invert,
    )
    return {"Normal": bent}


@emitter("ShaderNodeNormalMap")
def normal_map(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Normal Map in tangent, object or world space."""
    strength, color = c.float(node, "Strength"), c.color(node, "Color")
    if node.space.startswith("BLENDER_"):  # the baker's convention: y and z point the other way
        one = c.builder.constant(1.0)
        flipped = [c.builder.op1("MATH_SUBTRACT", (one, color[k])) for k in (1, 2)]
        color = (color[0], flipped[0], flipped[1])
    space = {"TANGENT": 0, "OBJECT": 1, "BLENDER_OBJECT": 1}.get(node.space, 2)
    slot = tangent_slot(c, node.uv_map) if space == 0 else 0
    params = (space, int(node.convention == "DIRECTX"), slot)
    return {"Normal": c.builder.op3("NORMAL_MAP", (strength, *color), params)}


@emitter("ShaderNodeDisplacement")
def displacement(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Displacement along the normal; the length is in object or world units."""
    b = c.builder
    height, midlevel = c.float(node, "Height"), c.float(node, "Midlevel")
    length = b.multiply(b.op1("MATH_SUBTRACT", (height, midlevel)), c.float(node, "Scale"))
    direction = c.vector_or(node, "Normal", lambda: normal(c))
    if node.space == "OBJECT":
        direction = b.op3("VECTOR_TRANSFORM", direction, (0, 1, 2))  # world to object, normal
        return {"Displacement": b.op3("VECTOR_TRANSFORM", b.scale(direction, length), (1, 0, 0))}
    return {"Displacement": b.scale(direction, length)}


@emitter("ShaderNodeVectorDisplacement")
def vector_displacement(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Vector Displacement in object or world space."""
    b = c.builder
    midlevel, scale = c.float(node, "Midlevel"), c.float(node, "Scale")
    offset = b.scale(b.each("MATH_SUBTRACT", c.vector(node, "Vector"), (midlevel,) * 3), scale)
    if node.space == "TANGENT":
        c.warn(node, "is read in object space; set its space to Object or World")
    if node.space != "WORLD":
        offset = b.op3("VECTOR_TRANSFORM", offset, (1, 0, 0))
    return {"Displacement": offset}
