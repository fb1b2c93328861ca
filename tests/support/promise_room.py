"""A small room for the promises of docs/reliability.md, and renders of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from support.blender import save_every_pass
from support.pictures import read_passes

F32 = NDArray[np.float32]


def prepare(scene: bpy.types.Scene, folder: Path, size: int = 16) -> None:
    """Luch draws every pass of one sample into a file in that folder."""
    render = scene.render
    render.engine = "LUCH"
    render.resolution_x, render.resolution_y, render.resolution_percentage = size, size, 100
    save_every_pass(scene)
    render.filepath = str(folder / f"{scene.name}.exr")
    render.use_file_extension = False
    scene.luch.samples = 1


def picture(scene: bpy.types.Scene) -> F32:
    """Combined, (height, width, 4)."""
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_passes(Path(scene.render.filepath))["Combined"]


def raising(error: BaseException) -> Callable[..., Any]:
    """What raises it, however it is called."""

    def fail(*args: object, **named: object) -> None:
        raise error

    return fail


def heavy(scene: bpy.types.Scene) -> None:
    """Light that bounces sixty times in a white box, at a size that takes long."""
    cube = bpy.data.objects["Cube"]
    cube.scale = (8.0, 8.0, 8.0)
    scene.render.resolution_x = scene.render.resolution_y = 256
    scene.luch.samples = 1 << 20
    scene.luch.max_bounces = scene.luch.diffuse_bounces = scene.luch.min_light_bounces = 60
    shader = cube.data.materials[0].node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)
