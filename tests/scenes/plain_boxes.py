"""The boxes of support/plain_boxes.py in Blender, for Luch and Cycles alike: nothing takes light away or cleans noise."""

from __future__ import annotations

import math
from typing import Any

import bpy
from support.plain_boxes import Box, Surface, Thing


def build(box: Box, size: int, bounces: int, threads: int) -> bpy.types.Scene:
    """A fresh file with only this box in it. size: pixels of both sides; threads 0: all."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for thing in box.things:
        _link(scene, thing.name, _mesh(thing))
    _lamp(scene, box)
    _eye(scene, box)
    render = scene.render
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    render.use_persistent_data = render.use_compositing = render.use_sequencer = False
    render.threads_mode = "FIXED" if threads else "AUTO"
    if threads:
        render.threads = threads
    scene.view_layers[0].use_pass_z = False
    for settings in (scene.cycles, scene.luch):
        _plain(settings, bounces)
    scene.cycles.device, scene.luch.device = "CPU", "CPU"
    scene.cycles.use_guiding = scene.cycles.use_fast_gi = False
    return scene


def _plain(settings: Any, bounces: int) -> None:
    """What both engines have under one name."""
    settings.use_adaptive_sampling = settings.use_denoising = False
    settings.time_limit = 0.0
    settings.sample_clamp_direct = settings.sample_clamp_indirect = settings.blur_glossy = 0.0
    settings.light_sampling_threshold = 0.0
    settings.caustics_reflective = settings.caustics_refractive = True
    settings.pixel_filter_type, settings.filter_width = "BOX", 1.0
    for kind in ("max", "diffuse", "glossy", "transmission", "volume", "transparent_max"):
        setattr(settings, f"{kind}_bounces", bounces)


def _link(scene: bpy.types.Scene, name: str, data: bpy.types.ID) -> bpy.types.Object:
    thing = bpy.data.objects.new(name, data)
    scene.collection.objects.link(thing)
    return thing


def _mesh(thing: Thing) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(thing.name)
    mesh.from_pydata(list(thing.vertices), [], list(thing.polygons))
    mesh.polygons.foreach_set("use_smooth", [thing.smooth] * len(mesh.polygons))
    mesh.materials.append(_material(thing.name, thing.surface))
    mesh.update()
    return mesh


def _material(name: str, surface: Surface) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    kinds = {"diffuse": "BsdfDiffuse", "metal": "BsdfAnisotropic", "glass": "BsdfGlass"}
    shader = tree.nodes.new(f"ShaderNode{kinds[surface.kind]}")
    shader.inputs["Color"].default_value = (*surface.colour, 1.0)
    shader.inputs["Roughness"].default_value = surface.roughness
    if surface.kind != "diffuse":
        shader.distribution = "GGX"
    if surface.kind == "glass":
        shader.inputs["IOR"].default_value = surface.ior
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def _lamp(scene: bpy.types.Scene, box: Box) -> None:
    """Blender's area lamp shines along its -Z, as this one does."""
    lamp = bpy.data.lights.new("Lamp", "AREA")
    lamp.shape, lamp.size, lamp.energy = "SQUARE", box.lamp.side, box.lamp.watts
    _link(scene, "Lamp", lamp).location = box.lamp.middle


def _eye(scene: bpy.types.Scene, box: Box) -> None:
    camera = bpy.data.cameras.new("Eye")
    camera.sensor_fit, camera.angle = "HORIZONTAL", math.radians(box.eye.angle_deg)
    eye = _link(scene, "Eye", camera)
    eye.location, eye.rotation_euler = box.eye.at, (math.pi / 2.0, 0.0, 0.0)
    scene.camera = eye
