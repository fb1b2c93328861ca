"""Our closures against Cycles': a flat board of tiles, one material each, under a world that varies with direction.

Of every material three numbers are compared per viewing angle: what it sends of a white world (its
directional albedo), of light concentrated on one side, and of light from above. Cycles renders the
board; ours are means of closure samples. Every difference must lie within 0.2 % and the noise of both.

The world is found by closure samples only. Cycles' lights would add to rough refraction: its evaluation
also counts facets that are seen from behind (0.6 % at roughness 0.6 from above, several times the light at
roughness 1 and grazing angles), which no sample ever meets; ours does not. Its Ashikhmin-Shirley sampling
likewise turns rejected half vectors back up at grazing angles: at roughness 0.8 and 75 degrees a white world
gives 0.638, where the integral of the function that both engines evaluate alike (lamps agree to 1e-5) is 0.4965,
which is what ours gives.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray

bpy = pytest.importorskip("bpy")
oiio = pytest.importorskip("OpenImageIO")

Floats = NDArray[np.float64]
CAMERA, BACKFACING = 1, 512
TILE = 6  # pixels
SAMPLES = 1024  # per pixel
COLUMNS = 8
VIEWS = ((20.0, False), (75.0, False), (50.0, True))  # degrees from the normal; seen from behind
OUR_SAMPLES = 1 << 19
RELATIVE = 0.002
LOOSER = {"glossy phong": 0.012, "aniso phong": 0.012}  # see above
BLUE, GOLD, ROSE = (0.2, 0.4, 0.8), (0.9, 0.6, 0.2), (0.8, 0.3, 0.4)

# Blender's node, its menus, its inputs; and ours. Inputs of the same meaning are written once: ours
# in lower case with underscores.
Material = tuple[str, dict[str, Any], dict[str, Any]]
MATERIALS: dict[str, Material] = {
    "diffuse": ("Diffuse", {}, {"Color": BLUE}),
    "diffuse rough": ("Diffuse", {}, {"Color": BLUE, "Roughness": 0.7}),
    "translucent": ("Translucent", {}, {"Color": BLUE}),
    "glossy ggx": ("Anisotropic", {"distribution": "GGX"}, {"Color": GOLD, "Roughness": 0.4}),
    "glossy multi": ("Anisotropic", {"distribution": "MULTI_GGX"}, {"Color": GOLD, "Roughness": 0.9}),
    "glossy beckmann": ("Anisotropic", {"distribution": "BECKMANN"}, {"Color": GOLD, "Roughness": 0.6}),
    "glossy phong": ("Anisotropic", {"distribution": "ASHIKHMIN_SHIRLEY"}, {"Color": GOLD, "Roughness": 0.5}),
    "glossy mirror": ("Anisotropic", {"distribution": "MULTI_GGX"}, {"Color": GOLD, "Roughness": 0.0}),
    "aniso ggx": (
        "Anisotropic",
        {"distribution": "MULTI_GGX"},
        {"Color": GOLD, "Roughness": 0.5, "Anisotropy": 0.6, "Rotation": 0.1, "Tangent": (1.0, 0.0, 0.0)},
    ),
    "aniso phong": (
        "Anisotropic",
        {"distribution": "ASHIKHMIN_SHIRLEY"},
        {"Color": GOLD, "Roughness": 0.4, "Anisotropy": -0.5, "Rotation": 0.1, "Tangent": (1.0, 0.0, 0.0)},
    ),
    "metal f82": ("Metallic", {"fresnel_type": "F82"}, {"Roughness": 0.5, "Edge Tint": ROSE}),
    "metal physical": ("Metallic", {"fresnel_type": "PHYSICAL_CONDUCTOR"}, {"Roughness": 0.3}),
    "metal aniso": (
        "Metallic",
        {"fresnel_type": "F82"},
        {"Roughness": 0.5, "Anisotropy": 0.8, "Rotation": 0.2, "Tangent": (1.0, 0.0, 0.0)},
    ),
    "metal film f82": ("Metallic", {"fresnel_type": "F82"}, {"Thin Film Thickness": 350.0, "Roughness": 0.3}),
    "metal film physical": (
        "Metallic",
        {"fresnel_type": "PHYSICAL_CONDUCTOR"},
        {"Thin Film Thickness": 350.0, "Thin Film IOR": 1.5, "Roughness": 0.3},
    ),
    "glass smooth": ("Glass", {"distribution": "MULTI_GGX"}, {"Color": BLUE, "Roughness": 0.0}),
    "glass rough": ("Glass", {"distribution": "MULTI_GGX"}, {"Color": BLUE, "Roughness": 0.6}),
    "glass ggx": ("Glass", {"distribution": "GGX"}, {"Color": BLUE, "Roughness": 0.4, "IOR": 1.8}),
    "glass beckmann": ("Glass", {"distribution": "BECKMANN"}, {"Color": BLUE, "Roughness": 0.3}),
    "glass film": ("Glass", {"distribution": "GGX"}, {"Thin Film Thickness": 400.0, "Roughness": 0.2}),
    "refraction": ("Refraction", {"distribution": "GGX"}, {"Color": BLUE, "Roughness": 0.4, "IOR": 0.8}),
    "sheen": ("Sheen", {"distribution": "MICROFIBER"}, {"Color": ROSE, "Roughness": 0.4}),
    "velvet": ("Sheen", {"distribution": "ASHIKHMIN"}, {"Color": ROSE, "Roughness": 0.6}),
    "toon diffuse": ("Toon", {"component": "DIFFUSE"}, {"Color": ROSE, "Size": 0.4, "Smooth": 0.3}),
    "toon glossy": ("Toon", {"component": "GLOSSY"}, {"Color": ROSE, "Size": 0.2, "Smooth": 0.1}),
    "principled": ("Principled", {}, {"Base Color": BLUE}),
    "principled ggx": ("Principled", {"distribution": "GGX"}, {"Base Color": BLUE, "Roughness": 0.9}),
    "principled metal": (
        "Principled",
        {},
        {"Base Color": GOLD, "Metallic": 0.7, "Specular Tint": ROSE, "Diffuse Roughness": 0.5},
    ),
    "principled tinted": (
        "Principled",
        {},
        {"Base Color": BLUE, "Specular IOR Level": 0.9, "Specular Tint": ROSE, "Roughness": 0.3},
    ),
    "principled coat": (
        "Principled",
        {},
        {"Base Color": BLUE, "Coat Weight": 0.8, "Coat Roughness": 0.2, "Coat Tint": GOLD, "Coat IOR": 1.7},
    ),
    "principled sheen": ("Principled", {}, {"Base Color": BLUE, "Sheen Weight": 0.9, "Sheen Tint": ROSE}),
    "principled glass": (
        "Principled",
        {"distribution": "MULTI_GGX"},
        {"Base Color": BLUE, "Transmission Weight": 0.8, "Roughness": 0.4, "Specular Tint": ROSE},
    ),
    "principled film": ("Principled", {}, {"Base Color": BLUE, "Thin Film Thickness": 300.0, "Roughness": 0.2}),
    "principled aniso": (
        "Principled",
        {"distribution": "MULTI_GGX"},
        {"Metallic": 1.0, "Anisotropic": 0.7, "Anisotropic Rotation": 0.15, "Tangent": (1.0, 0.0, 0.0)},
    ),
    "principled emission": (
        "Principled",
        {},
        {"Emission Strength": 0.5, "Emission Color": GOLD, "Coat Weight": 1.0, "Sheen Weight": 0.6, "Alpha": 0.8},
    ),
    "bumped towards": ("Diffuse", {}, {"Color": BLUE, "Normal": (0.6, 0.3, 0.74)}),
    "bumped away": ("Diffuse", {}, {"Color": BLUE, "Normal": (-0.5, 0.3, 0.81), "Roughness": 0.4}),
    "bumped glossy": (
        "Anisotropic",
        {"distribution": "MULTI_GGX"},
        {"Color": GOLD, "Roughness": 0.4, "Normal": (-0.4, 0.5, 0.77)},
    ),
    "bumped glass": ("Glass", {"distribution": "MULTI_GGX"}, {"Roughness": 0.3, "Normal": (-0.3, 0.4, 0.87)}),
    "bumped coat": (
        "Principled",
        {},
        {"Base Color": BLUE, "Coat Weight": 1.0, "Coat Normal": (0.3, 0.4, 0.87), "Normal": (-0.2, 0.3, 0.93)},
    ),
    "thin glass": (
        "Principled",
        {"distribution": "MULTI_GGX"},
        {"Base Color": BLUE, "Transmission Weight": 1.0, "Thin Wall": True, "Roughness": 0.4},
    ),
    "thin glass smooth": (
        "Principled",
        {},
        {"Base Color": BLUE, "Transmission Weight": 0.9, "Thin Wall": True, "Roughness": 0.0},
    ),
    "thin subsurface": (
        "Principled",
        {},
        {
            "Base Color": BLUE,
            "Subsurface Weight": 0.8,
            "Subsurface Anisotropy": 0.3,
            "Thin Wall": True,
            "Diffuse Roughness": 0.4,
        },
    ),
}


def our_closures(material: Material, wo: tuple[float, float, float], behind: bool) -> Any:
    node, menus, inputs = material
    ours = {name.lower().replace(" ", "_"): value for name, value in inputs.items()}
    name = {"Anisotropic": "glossy"}.get(node, node.lower())
    if node == "Sheen":
        name = "velvet" if menus["distribution"] == "ASHIKHMIN" else "sheen"
    elif node == "Principled":
        ours["multiple_scattering"] = menus.get("distribution", "MULTI_GGX") == "MULTI_GGX"
        for tint in ("specular_tint", "coat_tint", "sheen_tint", "emission_color"):
            ours.setdefault(tint, (1.0, 1.0, 1.0))
    else:
        if node == "Toon":
            ours["glossy"] = menus["component"] == "GLOSSY"
        if "distribution" in menus:
            ours["distribution"] = menus["distribution"]
        if node == "Metallic":
            ours["physical"] = menus["fresnel_type"] == "PHYSICAL_CONDUCTOR"
    return core.bsdf.Closures(name, ours, wo, path_flags=CAMERA | BACKFACING if behind else CAMERA)


def world_light(direction: Floats) -> Floats:
    """The world of the comparison: white, from +x, from +z; one per column."""
    return np.stack(
        [
            np.ones(len(direction)),
            (0.5 + 0.5 * direction[:, 0]) ** 8,
            (0.5 + 0.5 * direction[:, 2]) ** 4,
        ],
        axis=1,
    )


def our_light(material: Material, angle: float, behind: bool) -> Floats:
    """(3 lights, 3 channels): what the closures send towards the viewer."""
    wo = (math.sin(angle), 0.0, math.cos(angle))
    closures = our_closures(material, wo, behind)
    i = np.arange(OUR_SAMPLES) + 0.5
    u = np.stack([(i * c) % 1.0 for c in (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)], axis=1)
    drawn = closures.sample(u.astype(np.float32))
    light = world_light(drawn["direction"].astype(float))
    scattered = light.T @ drawn["throughput"].astype(float) / OUR_SAMPLES
    through = world_light(-np.array([wo]))[0]
    return scattered + np.array(closures.emission)[None, :] + through[:, None] * np.array(closures.transparent)[None, :]


def build_node(material: bpy.types.Material, recipe: Material) -> None:
    node, menus, inputs = recipe
    tree = material.node_tree
    tree.nodes.clear()
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    closure = tree.nodes.new(f"ShaderNodeBsdf{node}")
    if node == "Principled":
        closure.distribution = "MULTI_GGX"
    if node == "Metallic":
        closure.distribution = "MULTI_GGX"
    for menu, value in menus.items():
        setattr(closure, menu, value)
    for name, value in inputs.items():
        socket = closure.inputs[name]
        if name in ("Tangent", "Normal", "Coat Normal"):
            constant = tree.nodes.new("ShaderNodeCombineXYZ")
            for axis, number in zip("XYZ", value, strict=True):
                constant.inputs[axis].default_value = number
            tree.links.new(constant.outputs[0], socket)
        else:
            socket.default_value = (*value, 1.0) if socket.type == "RGBA" else value
    tree.links.new(closure.outputs[0], out.inputs["Surface"])


def build_world(column: int) -> bpy.types.World:
    """The world of world_light's column as nodes."""
    world = bpy.data.worlds.new("Board light")
    world.cycles.sampling_method = "NONE"
    tree = world.node_tree
    background = next(n for n in tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    if column == 0:
        return world
    coordinate, split = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(coordinate.outputs["Generated"], split.inputs[0])
    half, power = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMath")
    half.operation, power.operation = "MULTIPLY_ADD", "POWER"
    half.inputs[1].default_value = half.inputs[2].default_value = 0.5
    power.inputs[1].default_value = 8.0 if column == 1 else 4.0
    tree.links.new(split.outputs["X" if column == 1 else "Z"], half.inputs[0])
    tree.links.new(half.outputs[0], power.inputs[0])
    tree.links.new(power.outputs[0], background.inputs["Strength"])
    return world


def build_board(angle: float, behind: bool) -> tuple[int, int]:
    """A scene of one square tile per material, seen under the angle; returns the tiles' columns and rows."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    rows = -(-len(MATERIALS) // COLUMNS)
    width = 1.0 / math.cos(angle)  # tiles look square
    vertices: list[tuple[float, float, float]] = []
    for k in range(len(MATERIALS)):
        x, y = (k % COLUMNS - COLUMNS / 2) * width, k // COLUMNS - rows / 2
        vertices += [(x, y, 0.0), (x + width, y, 0.0), (x + width, y + 1.0, 0.0), (x, y + 1.0, 0.0)]
    mesh = bpy.data.meshes.new("Board")
    corners = (3, 2, 1, 0) if behind else (0, 1, 2, 3)
    mesh.from_pydata(vertices, [], [tuple(4 * k + i for i in corners) for k in range(len(MATERIALS))])
    for name, recipe in MATERIALS.items():
        material = bpy.data.materials.new(name)
        build_node(material, recipe)
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", list(range(len(MATERIALS))))
    scene.collection.objects.link(bpy.data.objects.new("Board", mesh))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", float(max(COLUMNS, rows))
    eye = bpy.data.objects.new("Camera", camera)
    eye.location = (50.0 * math.sin(angle), 0.0, 50.0 * math.cos(angle))
    eye.rotation_euler = (0.0, angle, 0.0)
    scene.collection.objects.link(eye)
    scene.camera = eye
    return COLUMNS, rows


def render_tiles(column: int, columns: int, rows: int, folder: Path) -> tuple[Floats, Floats]:
    """Mean of each tile (materials, 3) and its standard error."""
    scene = bpy.context.scene
    scene.world = build_world(column)
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = SAMPLES, False, False
    cycles.max_bounces, cycles.blur_glossy, cycles.light_sampling_threshold = 4, 0.0, 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 0.01
    scene.render.resolution_x, scene.render.resolution_y = columns * TILE, rows * TILE
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    scene.render.filepath = str(folder / "board.exr")
    bpy.ops.render.render(write_still=True)
    file = oiio.ImageInput.open(scene.render.filepath)
    pixels = np.asarray(file.read_image("float"), dtype=float)[::-1, :, :3]
    file.close()
    tiles = pixels.reshape(rows, TILE, columns, TILE, 3).transpose(0, 2, 1, 3, 4).reshape(-1, TILE * TILE, 3)
    tiles = tiles[: len(MATERIALS)]
    return tiles.mean(axis=1), tiles.std(axis=1) / TILE


@pytest.mark.parametrize(("degrees", "behind"), VIEWS)
def test_closures_send_the_light_that_cycles_sends(degrees: float, behind: bool, tmp_path: Path) -> None:
    angle = math.radians(degrees)
    columns, rows = build_board(angle, behind)
    cycles = [render_tiles(column, columns, rows, tmp_path) for column in range(3)]
    failures = []
    print(f"\n{degrees} degrees; rows: light from everywhere, from +x, from +z; Cycles / ours - 1 in %")
    for k, (name, recipe) in enumerate(MATERIALS.items()):
        ours = our_light(recipe, angle, behind)
        theirs = np.array([mean[k] for mean, _ in cycles])
        error = np.array([e[k] for _, e in cycles])
        difference = theirs - ours
        allowed = LOOSER.get(name, RELATIVE) * np.maximum(ours, 0.02) + 4.0 * error
        percent = 100.0 * difference / np.maximum(ours, 1e-3)
        bad = bool(np.any(np.abs(difference) > allowed))
        print(f"{'*' if bad else ' '} {name:20s}", "  ".join(" ".join(f"{p:+6.2f}" for p in row) for row in percent))
        if bad:
            failures.append(f"{name}: ours {ours.round(4).tolist()}, Cycles {theirs.round(4).tolist()}")
    assert not failures, "\n".join(failures)
