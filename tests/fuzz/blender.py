"""Random files made in Blender itself: node trees of any nodes linked at random, objects of any kind, hostile numbers."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from fuzz.values import Rng, chance, hostile

SHADERS = [
    name for name in dir(bpy.types) if name.startswith(("ShaderNodeBsdf", "ShaderNodeVolume", "ShaderNodeEmission"))
]
OTHERS = [
    name for name in dir(bpy.types)
    if name.startswith("ShaderNode") and name not in SHADERS
    and name not in ("ShaderNode", "ShaderNodeTree", "ShaderNodeCustomGroup", "ShaderNodeGroup")
]  # fmt: skip
MODIFIERS = ("SUBSURF", "BEVEL", "SOLIDIFY", "WAVE", "ARRAY", "DECIMATE", "WIREFRAME", "DISPLACE", "MIRROR", "BUILD")


def random_file(seed: int) -> bpy.types.Scene:
    """An empty file filled at random. Luch is registered; Luch is its engine; 8 x 8 pixels, 2 samples."""
    rng = np.random.default_rng(seed)
    wild = (0.0, 0.05, 0.3)[int(rng.integers(3))]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for k in range(int(rng.integers(1, 4))):
        _object(rng, scene, k, wild)
    for k in range(int(rng.integers(0, 3))):
        lamp = bpy.data.lights.new(f"Lamp {k}", ("POINT", "SUN", "SPOT", "AREA")[int(rng.integers(4))])
        scramble(
            lamp, rng, wild, ("energy", "color", "shadow_soft_size", "size", "size_y", "spot_size", "angle", "spread")
        )
        _link(scene, bpy.data.objects.new(f"Lamp {k}", lamp), rng, wild)
    scene.world = bpy.data.worlds.new("World")
    if chance(rng, 0.5):
        _tree(scene.world.node_tree, rng, wild, "World Output")
    camera = bpy.data.cameras.new("Camera")
    camera.type = ("PERSP", "ORTHO", "PANO")[int(rng.integers(3))]
    scramble(camera, rng, wild, ("lens", "ortho_scale", "shift_x", "clip_start", "clip_end", "sensor_width"))
    camera.dof.use_dof = chance(rng, 0.3)
    scramble(camera.dof, rng, wild, ("focus_distance", "aperture_fstop", "aperture_blades", "aperture_ratio"))
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.location = (0.0, 0.0, 6.0)
    render = scene.render
    render.engine, scene.luch.samples = "LUCH", 2
    render.resolution_x, render.resolution_y, render.resolution_percentage = 8, 8, 100
    render.use_motion_blur = chance(rng, 0.2)
    render.film_transparent = chance(rng, 0.2)
    for name in dir(scene.view_layers[0]):
        if name.startswith("use_pass_") and name != "use_pass_grease_pencil" and chance(rng, 0.1):
            setattr(scene.view_layers[0], name, True)
    return scene


def scramble(owner: Any, rng: Rng, wild: float, names: tuple[str, ...]) -> None:
    """Sets numbers to random ones, as far as Blender takes them."""
    for name in names:
        if not hasattr(owner, name) or chance(rng, 0.4):
            continue
        old = getattr(owner, name)
        try:
            if isinstance(old, bool):
                setattr(owner, name, not old)
            elif isinstance(old, int):
                setattr(owner, name, int(rng.integers(0, 8)))
            elif isinstance(old, float):
                setattr(owner, name, hostile(rng) if chance(rng, wild) else float(rng.uniform(0.0, 3.0)))
            elif hasattr(old, "__len__") and not isinstance(old, str):
                setattr(owner, name, [hostile(rng) if chance(rng, wild) else float(rng.random()) for _ in old])
        except (TypeError, ValueError, OverflowError, AttributeError):  # Blender refuses the value: nothing is set
            continue


def _link(scene: Any, thing: Any, rng: Rng, wild: float) -> None:
    scene.collection.objects.link(thing)
    scramble(thing, rng, wild * 0.3, ("location", "rotation_euler", "scale"))


def _object(rng: Rng, scene: Any, index: int, wild: float) -> None:
    name = f"Object {index}"
    mesh = bpy.data.meshes.new(name)
    count = int(rng.integers(0, 12))
    points = rng.normal(0.0, 1.0, (count, 3))
    if chance(rng, wild) and count:
        points[int(rng.integers(count)), int(rng.integers(3))] = hostile(rng)
    faces = (
        [list(rng.choice(count, int(rng.integers(3, min(count, 6) + 1)), replace=False)) for _ in range(6)]
        if count > 3
        else []
    )
    with np.errstate(over="ignore"):
        mesh.from_pydata(points.astype(np.float32).tolist(), [], [[int(k) for k in face] for face in faces])
    if chance(rng, 0.5):
        mesh.uv_layers.new(name="UVMap")
    thing = bpy.data.objects.new(name, mesh)
    for k in range(int(rng.integers(0, 3))):
        material = bpy.data.materials.new(f"Material {index}.{k}")
        _tree(material.node_tree, rng, wild, "Material Output")
        mesh.materials.append(material)
    _link(scene, thing, rng, wild)
    if chance(rng, 0.3) and count < 10:
        modifier = thing.modifiers.new("Any", MODIFIERS[int(rng.integers(len(MODIFIERS)))])
        if modifier.type in ("SUBSURF",):
            modifier.render_levels = 1


def _tree(tree: Any, rng: Rng, wild: float, output: str) -> None:
    """Nodes of any kind, their inputs random, linked at random; loops too."""
    nodes = []
    for _ in range(int(rng.integers(1, 7))):
        kinds = SHADERS if chance(rng, 0.4) else OTHERS
        try:
            node = tree.nodes.new(kinds[int(rng.integers(len(kinds)))])
        except RuntimeError:  # of another kind of tree
            continue
        nodes.append(node)
        for prop in node.bl_rna.properties:
            if prop.type == "ENUM" and not prop.is_readonly and not prop.is_enum_flag and chance(rng, 0.5):
                items = [item.identifier for item in prop.enum_items]
                if items:
                    try:
                        setattr(node, prop.identifier, items[int(rng.integers(len(items)))])
                    except TypeError:  # an item that is not offered now
                        continue
        for socket in node.inputs:
            if hasattr(socket, "default_value") and socket.type not in ("STRING", "OBJECT", "IMAGE", "COLLECTION"):
                scramble(socket, rng, wild, ("default_value",))
    targets = [socket for node in nodes for socket in node.inputs]
    sources = [socket for node in nodes for socket in node.outputs]
    for _ in range(min(12, len(sources) * 2)):
        if targets and sources:
            tree.links.new(sources[int(rng.integers(len(sources)))], targets[int(rng.integers(len(targets)))])
    last = tree.nodes.get(output)
    for name in ("Surface", "Volume", "Displacement"):
        if last is not None and sources and name in last.inputs and chance(rng, 0.8 if name == "Surface" else 0.2):
            tree.links.new(sources[int(rng.integers(len(sources)))], last.inputs[name])
