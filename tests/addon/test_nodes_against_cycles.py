"""Every node in every mode against Cycles in the same bpy: one picture of small tiles (support/node_tiles.py)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import node_tiles

Tree = Any
Case = Callable[[Tree], Any]

# Largest difference relative to max(1, |Cycles|). Cycles keeps mesh normals and tangents in 16 bits a
# coordinate; what is made from them can differ by 6e-4.
TOLERANCE = 2e-4
ROUNDED_NORMALS = 1e-3
# Cases that jump: a pixel at the jump may fall on either side (share of pixels that may).
JUMPING = {
    "Math ": 0.15,
    "Vector Math ": 0.15,
    "Wireframe": 0.15,
    "Map Range STEPPED": 0.1,
    "Map Range vector STEPPED": 0.1,
}


def new(tree: Tree, kind: str, **settings: Any) -> Any:
    node = tree.nodes.new(kind)
    for name, value in settings.items():
        setattr(node, name, value)
    return node


def feed(tree: Tree, node: Any, identifier: str, source: Any) -> None:
    socket = next(s for s in node.inputs if s.identifier == identifier)
    if isinstance(source, (int, float)):
        socket.default_value = source
    elif isinstance(source, tuple):
        socket.default_value = (*source, 1.0) if socket.type == "RGBA" else source
    else:
        tree.links.new(source, socket)


def output(node: Any, identifier: str) -> Any:
    return next(s for s in node.outputs if s.identifier == identifier)


def vary(tree: Tree, low: tuple[float, float, float], high: tuple[float, float, float]) -> Any:
    """A vector that runs from low to high over the tile: x and y with UV, z with the position's height."""
    uv = new(tree, "ShaderNodeUVMap", uv_map="UVMap")
    geometry = new(tree, "ShaderNodeNewGeometry")
    height = new(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(output(geometry, "Position"), height.inputs[0])
    flat = new(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(uv.outputs[0], flat.inputs[0])
    joined = new(tree, "ShaderNodeCombineXYZ")
    for k in range(2):
        tree.links.new(flat.outputs[k], joined.inputs[k])
    tree.links.new(height.outputs[2], joined.inputs[2])
    scaled = new(tree, "ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    tree.links.new(joined.outputs[0], scaled.inputs[0])
    scaled.inputs[1].default_value = [b - a for a, b in zip(low, high, strict=True)]
    scaled.inputs[2].default_value = low
    return scaled.outputs[0]


def parts(tree: Tree, vector: Any) -> list[Any]:
    node = new(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(vector, node.inputs[0])
    return list(node.outputs)


def simple(kind: str, out: str, inputs: dict[str, Any] | None = None, **settings: Any) -> Case:
    """A node whose inputs are constants or functions of the tree."""

    def case(tree: Tree) -> Any:
        node = new(tree, kind, **settings)
        for identifier, source in (inputs or {}).items():
            feed(tree, node, identifier, source(tree) if callable(source) else source)
        return output(node, out)

    return case


def vector_between(low: tuple[float, float, float], high: tuple[float, float, float]) -> Callable[[Tree], Any]:
    return lambda tree: vary(tree, low, high)


def value_between(low: float, high: float, axis: int = 0) -> Callable[[Tree], Any]:
    return lambda tree: parts(tree, vary(tree, (low,) * 3, (high,) * 3))[axis]


COLOR_A = vector_between((0.05, 0.9, 0.1), (1.1, 0.1, 0.7))
COLOR_B = vector_between((0.7, 0.2, -0.1), (0.1, 0.8, 0.9))
SIGNED = vector_between((-2.0, -1.5, -1.0), (2.0, 1.7, 1.3))
POSITIVE = vector_between((0.2, 0.3, 0.5), (2.0, 1.7, 1.3))


def math_cases() -> dict[str, Case]:
    import bpy

    cases: dict[str, Case] = {}
    for mode in (item.identifier for item in bpy.types.ShaderNodeMath.bl_rna.properties["operation"].enum_items):
        domain = (0.05, 2.0) if mode in ("POWER", "LOGARITHM") else (-2.0, 2.0)
        inputs = {"Value": value_between(*domain), "Value_001": value_between(-1.5, 1.6, 1), "Value_002": 0.7}
        cases[f"Math {mode}"] = simple("ShaderNodeMath", "Value", inputs, operation=mode)
    cases["Math clamped"] = simple(
        "ShaderNodeMath", "Value", {"Value": value_between(-2, 2), "Value_001": 0.5}, use_clamp=True
    )
    for mode in (item.identifier for item in bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items):
        first = POSITIVE if mode == "POWER" else SIGNED
        inputs = {
            "Vector": first,
            "Vector_001": vector_between((1.5, -1.0, 0.4), (-1.0, 1.2, 0.9)),
            "Vector_002": (0.3, -0.6, 0.2),
            "Scale": 0.8,
        }
        out = "Value" if mode in ("DOT_PRODUCT", "DISTANCE", "LENGTH") else "Vector"
        cases[f"Vector Math {mode}"] = simple("ShaderNodeVectorMath", out, inputs, operation=mode)
    for mode in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"):
        ends = {"From Min": 0.2, "From Max": 0.8, "To Min": -1.0, "To Max": 2.0, "Steps": 3.0}
        cases[f"Map Range {mode}"] = simple(
            "ShaderNodeMapRange",
            "Result",
            {"Value": value_between(-0.5, 1.5), **ends},
            interpolation_type=mode,
            clamp=False,
        )
        ends3 = {
            "From_Min_FLOAT3": (0.1, 0.2, 0.9),
            "From_Max_FLOAT3": (0.8, 0.7, 0.1),
            "To_Min_FLOAT3": (2.0, 0.0, 0.0),
            "Steps_FLOAT3": (2.0, 3.0, 4.0),
        }
        cases[f"Map Range vector {mode}"] = simple(
            "ShaderNodeMapRange",
            "Vector",
            {"Vector": SIGNED, **ends3},
            interpolation_type=mode,
            data_type="FLOAT_VECTOR",
            clamp=True,
        )
    cases["Clamp range"] = simple(
        "ShaderNodeClamp", "Result", {"Value": value_between(-1, 2), "Min": 0.9, "Max": 0.1}, clamp_type="RANGE"
    )
    cases["Clamp"] = simple("ShaderNodeClamp", "Result", {"Value": value_between(-1, 2), "Min": 0.1, "Max": 0.9})
    return cases


def ramp(tree: Tree, interpolation: str, mode: str) -> Any:
    node = new(tree, "ShaderNodeValToRGB")
    node.color_ramp.color_mode = mode
    node.color_ramp.interpolation = interpolation if mode == "RGB" else node.color_ramp.interpolation
    node.color_ramp.elements[0].color = (0.9, 0.1, 0.2, 0.5)
    middle = node.color_ramp.elements.new(0.4)
    middle.color = (0.1, 0.8, 0.3, 1.0)
    node.color_ramp.elements[-1].position = 0.85
    feed(tree, node, "Fac", value_between(-0.2, 1.2)(tree))
    return node.outputs["Color"]


def curves(tree: Tree, kind: str, extend: str) -> Any:
    node = new(tree, kind)
    node.mapping.extend = extend
    for k, curve in enumerate(node.mapping.curves):
        curve.points.new(0.3, 0.5 - 0.1 * k)
        curve.points.new(0.6, 0.4 + 0.15 * k)
    node.mapping.update()
    if kind == "ShaderNodeFloatCurve":
        feed(tree, node, "Value", value_between(-0.4, 1.3)(tree))
        feed(tree, node, "Factor", 0.8)
    else:
        feed(tree, node, "Fac", 0.8)
        name = "Color" if kind == "ShaderNodeRGBCurve" else "Vector"
        feed(tree, node, name, vector_between((-0.3, 1.2, 0.0), (1.3, -0.2, 0.9))(tree))
    return node.outputs[0]


def color_cases() -> dict[str, Case]:
    import bpy

    cases: dict[str, Case] = {}
    modes = [item.identifier for item in bpy.types.ShaderNodeMix.bl_rna.properties["blend_type"].enum_items]
    for mode in modes:
        inputs = {"Factor_Float": value_between(-0.2, 1.3), "A_Color": COLOR_A, "B_Color": COLOR_B}
        cases[f"Mix {mode}"] = simple("ShaderNodeMix", "Result_Color", inputs, data_type="RGBA", blend_type=mode)
    cases["Mix clamped"] = simple(
        "ShaderNodeMix",
        "Result_Color",
        {"Factor_Float": 0.7, "A_Color": COLOR_A, "B_Color": COLOR_B},
        data_type="RGBA",
        blend_type="ADD",
        clamp_result=True,
    )
    cases["Mix float"] = simple(
        "ShaderNodeMix",
        "Result_Float",
        {"Factor_Float": value_between(-0.5, 1.5), "A_Float": 2.0, "B_Float": -1.0},
        clamp_factor=False,
    )
    cases["Mix vector"] = simple(
        "ShaderNodeMix",
        "Result_Vector",
        {"Factor_Float": value_between(-0.5, 1.5), "A_Vector": COLOR_A, "B_Vector": COLOR_B},
        data_type="VECTOR",
    )
    cases["Mix vector by vector"] = simple(
        "ShaderNodeMix",
        "Result_Vector",
        {"Factor_Vector": SIGNED, "A_Vector": COLOR_A, "B_Vector": COLOR_B},
        data_type="VECTOR",
        factor_mode="NON_UNIFORM",
    )
    cases["Mix RGB (old)"] = simple(
        "ShaderNodeMixRGB", "Color", {"Fac": 0.4, "Color1": COLOR_A, "Color2": COLOR_B}, blend_type="OVERLAY"
    )
    for kind in ("HSV", "HSL"):
        cases[f"Separate {kind}"] = lambda tree, kind=kind: rejoin(
            tree, simple("ShaderNodeSeparateColor", "Red", {"Color": COLOR_A}, mode=kind)(tree).node
        )
        cases[f"Combine {kind}"] = simple(
            "ShaderNodeCombineColor",
            "Color",
            {"Red": value_between(0, 1), "Green": value_between(0, 1, 1), "Blue": 0.6},
            mode=kind,
        )
    cases["Invert"] = simple("ShaderNodeInvert", "Color", {"Fac": 0.7, "Color": COLOR_A})
    cases["Hue/Saturation"] = simple(
        "ShaderNodeHueSaturation", "Color", {"Hue": 0.7, "Saturation": 1.5, "Value": 0.8, "Fac": 0.9, "Color": COLOR_A}
    )
    cases["Brightness/Contrast"] = simple(
        "ShaderNodeBrightContrast", "Color", {"Color": COLOR_A, "Bright": 0.1, "Contrast": 0.4}
    )
    cases["Gamma"] = simple("ShaderNodeGamma", "Color", {"Color": COLOR_B, "Gamma": 2.2})
    cases["RGB to BW"] = simple("ShaderNodeRGBToBW", "Val", {"Color": COLOR_A})
    cases["Colour read as number"] = simple(
        "ShaderNodeMath",
        "Value",
        {
            "Value": lambda t: t.links.new(COLOR_A(t), t.nodes.new("ShaderNodeGamma").inputs[0]).to_node.outputs[0],
            "Value_001": 0.0,
        },
    )
    for interpolation in ("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE"):
        cases[f"Color Ramp {interpolation}"] = lambda tree, i=interpolation: ramp(tree, i, "RGB")
    cases["Color Ramp HSV"] = lambda tree: ramp(tree, "LINEAR", "HSV")
    for kind in ("RGB", "Vector", "Float"):
        for extend in ("HORIZONTAL", "EXTRAPOLATED"):
            cases[f"{kind} curve {extend}"] = lambda tree, k=kind, e=extend: curves(tree, f"ShaderNode{k}Curve", e)
    return cases


def rejoin(tree: Tree, node: Any) -> Any:
    joined = new(tree, "ShaderNodeCombineXYZ")
    for k in range(3):
        tree.links.new(node.outputs[k], joined.inputs[k])
    return joined.outputs[0]


def vector_cases() -> dict[str, Case]:
    cases: dict[str, Case] = {}
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        inputs = {
            "Vector": SIGNED,
            "Location": (0.3, -0.2, 0.5),
            "Rotation": (0.4, -0.7, 1.1),
            "Scale": (1.5, 0.5, -2.0),
        }
        if kind in ("VECTOR", "NORMAL"):
            inputs.pop("Location")
        cases[f"Mapping {kind}"] = simple("ShaderNodeMapping", "Vector", inputs, vector_type=kind)
    cases["Mapping turned by a link"] = simple("ShaderNodeMapping", "Vector", {"Vector": SIGNED, "Rotation": COLOR_A})
    for kind in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"):
        for invert in (False, True):
            inputs = {
                "Vector": SIGNED,
                "Center": (0.1, 0.2, 0.3),
                "Axis": (0.3, 0.5, -0.7),
                "Angle": value_between(-2.0, 3.0),
                "Rotation": (0.4, -0.7, 1.1),
            }
            cases[f"Vector Rotate {kind}{' inverted' if invert else ''}"] = simple(
                "ShaderNodeVectorRotate", "Vector", inputs, rotation_type=kind, invert=invert
            )
    for kind in ("VECTOR", "POINT", "NORMAL"):
        for source in ("WORLD", "OBJECT", "CAMERA"):
            for target in ("WORLD", "OBJECT", "CAMERA"):
                if source != target:
                    cases[f"Vector Transform {kind} {source} to {target}"] = simple(
                        "ShaderNodeVectorTransform",
                        "Vector",
                        {"Vector": SIGNED},
                        vector_type=kind,
                        convert_from=source,
                        convert_to=target,
                    )
    cases["Normal dot"] = simple("ShaderNodeNormal", "Dot", {"Normal": SIGNED})
    return cases


def input_cases() -> dict[str, Case]:
    import bpy

    cases: dict[str, Case] = {}
    for name in (
        "Position",
        "Normal",
        "Tangent",
        "True Normal",
        "Incoming",
        "Parametric",
        "Backfacing",
        "Pointiness",
        "Random Per Island",
    ):
        cases[f"Geometry {name}"] = simple("ShaderNodeNewGeometry", name)
    for name in ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection"):
        cases[f"Texture Coordinate {name}"] = simple("ShaderNodeTexCoord", name)
    cases["Texture Coordinate other Object"] = lambda tree: output(
        new(tree, "ShaderNodeTexCoord", object=bpy.data.objects["Other"]), "Object"
    )
    cases["UV Map Second"] = simple("ShaderNodeUVMap", "UV", uv_map="Second")
    cases["UV Map unnamed"] = simple("ShaderNodeUVMap", "UV")
    for name in ("Color", "Alpha"):
        cases[f"Color Attribute {name}"] = simple("ShaderNodeVertexColor", name, layer_name="Tint")
        cases[f"Color Attribute unnamed {name}"] = simple("ShaderNodeVertexColor", name)
        cases[f"Color Attribute missing {name}"] = simple("ShaderNodeVertexColor", name, layer_name="Nothing")
    for attribute in ("warmth", "flow", "Tint", "Second", "Nothing"):
        for name in ("Color", "Vector", "Fac", "Alpha"):
            cases[f"Attribute {attribute} {name}"] = simple("ShaderNodeAttribute", name, attribute_name=attribute)
    for name in ("Location", "Color", "Alpha", "Object Index", "Material Index"):
        cases[f"Object Info {name}"] = simple("ShaderNodeObjectInfo", name)
    for name in ("Is Camera Ray", "Is Shadow Ray", "Is Glossy Ray", "Ray Length", "Ray Depth", "Transparent Depth"):
        cases[f"Light Path {name}"] = simple("ShaderNodeLightPath", name)
    for name in ("View Vector", "View Z Depth", "View Distance"):
        cases[f"Camera Data {name}"] = simple("ShaderNodeCameraData", name)
    cases["Fresnel"] = simple("ShaderNodeFresnel", "Fac", {"IOR": 1.45})
    cases["Fresnel below 1"] = simple("ShaderNodeFresnel", "Fac", {"IOR": 0.7})
    cases["Fresnel of a normal"] = simple("ShaderNodeFresnel", "Fac", {"IOR": 1.45, "Normal": POSITIVE})
    for blend in (0.2, 0.5, 0.8):
        cases[f"Layer Weight Fresnel {blend}"] = simple("ShaderNodeLayerWeight", "Fresnel", {"Blend": blend})
        cases[f"Layer Weight Facing {blend}"] = simple("ShaderNodeLayerWeight", "Facing", {"Blend": blend})
    cases["Wireframe"] = simple("ShaderNodeWireframe", "Fac", {"Size": 0.2})
    cases["Wireframe pixels"] = simple("ShaderNodeWireframe", "Fac", {"Size": 1.0}, use_pixel_size=True)
    for axis in "XYZ":
        cases[f"Tangent radial {axis}"] = simple("ShaderNodeTangent", "Tangent", direction_type="RADIAL", axis=axis)
    cases["Tangent UV"] = simple("ShaderNodeTangent", "Tangent", direction_type="UV_MAP", uv_map="Second")
    cases["Tangent UV active"] = simple("ShaderNodeTangent", "Tangent", direction_type="UV_MAP")
    return cases


def object_cases() -> dict[str, Case]:
    """What only a whole scene knows: properties of objects."""
    cases: dict[str, Case] = {}
    for name in ("Color", "Vector", "Fac", "Alpha"):
        for attribute in ("level", "hue", "pass_index", "color", "Nothing"):
            cases[f"Attribute of the object {attribute} {name}"] = simple(
                "ShaderNodeAttribute", name, attribute_name=attribute, attribute_type="OBJECT"
            )
    return cases


def hill(tree: Tree) -> Any:
    """A height over UV, generated and object coordinates."""
    wave = new(tree, "ShaderNodeMath", operation="SINE")
    tree.links.new(parts(tree, vary(tree, (-3.0, 0.0, 0.0), (3.0, 1.0, 1.0)))[0], wave.inputs[0])
    own = simple("ShaderNodeTexCoord", "Object")(tree)
    product = new(tree, "ShaderNodeMath", operation="MULTIPLY_ADD")
    tree.links.new(wave.outputs[0], product.inputs[0])
    tree.links.new(parts(tree, own)[1], product.inputs[1])
    tree.links.new(parts(tree, simple("ShaderNodeNewGeometry", "Parametric")(tree))[0], product.inputs[2])
    return product.outputs[0]


def normal_cases() -> dict[str, Case]:
    cases: dict[str, Case] = {
        "Bump": simple("ShaderNodeBump", "Normal", {"Height": hill, "Distance": 0.3}),
        "Bump weak, inverted": simple(
            "ShaderNodeBump", "Normal", {"Height": hill, "Distance": 0.5, "Strength": 0.4}, invert=True
        ),
        "Bump of filter width": simple(
            "ShaderNodeBump", "Normal", {"Height": hill, "Distance": 0.3, "Filter Width": 1.0}
        ),
        "Bump of a normal": simple("ShaderNodeBump", "Normal", {"Height": hill, "Distance": 0.3, "Normal": POSITIVE}),
        "Bump of an attribute": simple(
            "ShaderNodeBump",
            "Normal",
            {"Height": simple("ShaderNodeAttribute", "Fac", attribute_name="warmth"), "Distance": 0.3},
        ),
        "Bump without height": simple("ShaderNodeBump", "Normal"),
        "Displacement node": simple(
            "ShaderNodeDisplacement", "Displacement", {"Height": value_between(0, 2), "Scale": 0.7}
        ),
        "Displacement node, world": simple(
            "ShaderNodeDisplacement", "Displacement", {"Height": value_between(0, 2), "Scale": 0.7}, space="WORLD"
        ),
        "Displacement as bump": displaced,
    }
    for space in ("TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"):
        for strength in (1.0, 0.6):
            inputs = {"Color": vector_between((0.3, 0.7, 0.6), (0.6, 0.4, 0.9)), "Strength": strength}
            cases[f"Normal Map {space} {strength}"] = simple("ShaderNodeNormalMap", "Normal", inputs, space=space)
    cases["Normal Map DirectX"] = simple(
        "ShaderNodeNormalMap", "Normal", {"Color": (0.4, 0.7, 0.9)}, convention="DIRECTX"
    )
    cases["Normal Map Second"] = simple("ShaderNodeNormalMap", "Normal", {"Color": (0.4, 0.7, 0.9)}, uv_map="Second")
    return cases


def displaced(tree: Tree) -> Any:
    node = new(tree, "ShaderNodeDisplacement")
    feed(tree, node, "Height", hill(tree))
    node.inputs["Scale"].default_value = 0.3
    target = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], target.inputs["Displacement"])
    return output(new(tree, "ShaderNodeNewGeometry"), "Normal")


@pytest.mark.parametrize("family", [math_cases, color_cases, vector_cases, input_cases, normal_cases])
def test_nodes_give_what_cycles_gives(family: Callable[[], dict[str, Case]], tmp_path: Path) -> None:
    tolerance = ROUNDED_NORMALS if family in (input_cases, normal_cases) else TOLERANCE
    tiles = node_tiles.compare(family(), tmp_path)
    scale = np.maximum(1.0, np.abs(tiles.cycles))
    error = np.where(tiles.hit[..., None], np.abs(tiles.luch - tiles.cycles) / scale, 0.0).max(-1)
    failures = []
    for name, tile, hit in zip(tiles.names, error, tiles.hit, strict=True):
        wrong = (tile > tolerance) | ~np.isfinite(tile)
        share = wrong.sum() / hit.sum()
        allowed = max((share for start, share in JUMPING.items() if name.startswith(start)), default=0.0)
        print(f"{name:48s} worst {tile.max():9.2e}  off {share:6.1%} of {hit.sum()} pixels")
        if not share <= allowed or hit.sum() < 15:
            failures.append(name)
    for text in tiles.warnings:
        print("warning:", text)
    assert not failures, failures
    # The renderer runs the same programs; its points lie a little apart, so that jumps and slopes show.
    apart = np.abs(tiles.drawn - tiles.cycles)[tiles.hit] / scale[tiles.hit]
    assert (apart.max(-1) < 0.02).mean() > 0.985


def test_objects_give_their_properties(tmp_path: Path) -> None:
    pictures = node_tiles.draw(object_cases(), tmp_path, mirrored=False, behind=False)
    assert pictures["CYCLES"].max() == 7.0  # pass_index
    apart = np.abs(pictures["LUCH"] - pictures["CYCLES"])
    assert (apart.max(-1) < 1e-4).mean() > 0.985


@pytest.mark.parametrize(("mirrored", "behind"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("family", [input_cases, normal_cases])
def test_nodes_hold_in_a_mirror_and_from_behind(
    family: Callable[[], dict[str, Case]], mirrored: bool, behind: bool, tmp_path: Path
) -> None:
    pictures = node_tiles.draw(family(), tmp_path, mirrored=mirrored, behind=behind)
    apart = np.abs(pictures["LUCH"] - pictures["CYCLES"]) / np.maximum(1.0, np.abs(pictures["CYCLES"]))
    assert (apart.max(-1) < 0.02).mean() > 0.985  # edges of tiles and of triangles may fall either way
