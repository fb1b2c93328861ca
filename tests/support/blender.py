"""Small renders in this process's bpy, by Cycles and by Luch, as float arrays."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from support.pictures import read_passes

F32 = NDArray[np.float32]


def empty_scene() -> bpy.types.Scene:
    """A file with nothing in it: no object, no world; Luch stays registered."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def set_plain_cycles(scene: bpy.types.Scene, samples: int, seed: int) -> None:
    """Cycles on the CPU with nothing that takes light away or cleans noise."""
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.seed = seed
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.time_limit = 0.0


def save_every_pass(scene: bpy.types.Scene) -> None:
    """Frames become multilayer EXR of floats."""
    settings = scene.render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"


def render_passes(
    engine: str, folder: Path, *, width: int = 32, height: int = 32, samples: int = 16, seed: int = 0
) -> dict[str, F32]:
    """Render the current scene; pass name -> float32 (height, width, channels), top row first.

    engine: "LUCH" or "CYCLES". The scene's own settings stand but for size, samples and seed; Luch reads
    the same ones. Raises RuntimeError (Blender's own) when the engine reports an error.
    """
    scene = bpy.context.scene
    render = scene.render
    render.engine = engine
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.use_persistent_data = False
    set_plain_cycles(scene, samples, seed)
    if engine == "LUCH":
        scene.luch.samples, scene.luch.seed = samples, seed
    save_every_pass(scene)
    render.image_settings.exr_codec = "ZIP"
    path = folder / f"{engine.lower()}-{os.getpid()}.exr"
    render.filepath = str(path)
    render.use_file_extension = False
    bpy.ops.render.render(write_still=True)
    passes = read_passes(path)
    path.unlink()
    return passes


def render_combined(engine: str, folder: Path, **options: int) -> F32:
    """Like render_passes, only Combined: float32 (height, width, 4)."""
    return render_passes(engine, folder, **options)["Combined"]
