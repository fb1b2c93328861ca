"""Cryptomatte as compositors read it: the pixels name what the manifest lists."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO as oiio
from support.blender import save_every_pass


def test_pixels_and_manifest_agree_with_cycles(
    scene: bpy.types.Scene, render_passes: Callable[..., dict[str, np.ndarray]]
) -> None:
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 5.0))
    scene.camera = bpy.context.object
    layer = scene.view_layers[0]
    for kind in ("object", "material", "asset"):
        setattr(layer, f"use_pass_cryptomatte_{kind}", True)
    passes = {engine: render_passes(engine, width=4, height=4, samples=2) for engine in ("CYCLES", "LUCH")}
    for kind in ("Object", "Material", "Asset"):
        ours, theirs = (passes[engine][f"Crypto{kind}00"] for engine in ("LUCH", "CYCLES"))
        np.testing.assert_array_equal(ours[..., :2], theirs[..., :2], err_msg=kind)


def test_instances_have_the_names_that_cycles_gives_them(
    scene: bpy.types.Scene, render_passes: Callable[..., dict[str, np.ndarray]]
) -> None:
    collection = bpy.data.collections.new("Props")
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    plane = bpy.context.object
    scene.collection.objects.unlink(plane)
    collection.objects.link(plane)
    plane.parent = bpy.data.objects.new("Inside", None)
    collection.objects.link(plane.parent)
    top = bpy.data.objects.new("Top", None)
    instancer = bpy.data.objects.new("Instancer", None)
    instancer.instance_type, instancer.instance_collection, instancer.parent = "COLLECTION", collection, top
    for empty in (top, instancer):
        scene.collection.objects.link(empty)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 2.0))
    scene.camera = bpy.context.object
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_asset = True
    passes = {engine: render_passes(engine, width=4, height=4, samples=2) for engine in ("CYCLES", "LUCH")}
    for kind in ("Object", "Asset"):
        ours, theirs = (passes[engine][f"Crypto{kind}00"] for engine in ("LUCH", "CYCLES"))
        np.testing.assert_array_equal(ours[..., 0], theirs[..., 0], err_msg=kind)


def test_the_manifest_names_the_bits_of_the_pixels(scene: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    bpy.context.object.name = "Plane é"
    bpy.ops.object.camera_add(location=(0.0, 0.0, 5.0))
    scene.camera = bpy.context.object
    scene.view_layers[0].use_pass_cryptomatte_object = True
    render = scene.render
    render.engine = "LUCH"
    render.resolution_x = render.resolution_y = 4
    scene.luch.samples = 1
    save_every_pass(scene)
    render.filepath = str(tmp_path / "matte.exr")
    bpy.ops.render.render(write_still=True)
    file = oiio.ImageInput.open(render.filepath)
    header = {attribute.name: attribute.value for attribute in file.spec().extra_attribs}
    (prefix,) = {key.rsplit("/", 1)[0] for key in header if key.startswith("cryptomatte/")}
    assert header[f"{prefix}/name"] == "ViewLayer.CryptoObject"
    assert header[f"{prefix}/conversion"] == "uint32_to_float32"
    manifest = json.loads(header[f"{prefix}/manifest"])
    identifier = struct.unpack(">f", bytes.fromhex(manifest["Plane é"]))[0]
    from support.pictures import read_passes

    assert (read_passes(tmp_path / "matte.exr")["CryptoObject00"][..., 0] == np.float32(identifier)).all()
