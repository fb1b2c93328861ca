"""Opening files, registering Luch from the source tree, rendering: what the jobs share. Runs in .venv with bpy."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import bpy

from buildtools.places import ROOT


@dataclass
class Render:
    """What one render took, everything after opening the file included."""

    wall_s: float
    cpu_s: float  # of all threads
    width: int
    height: int


def open_file(path: str | None, engine: str = "LUCH") -> bpy.types.Scene:
    """Opens path (None: keeps what is there), the engine registered and chosen, and gives its scene."""
    if engine == "LUCH":
        import addon

        addon.register()  # before the file, so that Luch's settings in it are read
    if path is not None:
        # Scripts of a stranger's file do not run; drivers that need them keep their last value.
        bpy.ops.wm.open_mainfile(filepath=path, use_scripts=False)
    scene = bpy.context.scene
    setattr(scene.render, "engine", engine)  # (the stubs know only Blender's own engines)
    if engine == "CYCLES":
        scene.cycles.device = "CPU"
    return scene


def build_demo() -> None:
    """The repository's own scene, by its script, into the file that is open."""
    sys.path.insert(0, str(ROOT / "tests"))
    from scenes import demo

    demo.build()


def choose_samples(
    scene: bpy.types.Scene, samples: int | None = None, time_limit_s: float | None = None, seed: int | None = None
) -> None:
    """Sets what is not None, for the engine chosen."""
    settings = scene.cycles if scene.render.engine == "CYCLES" else scene.luch
    if samples is not None:
        settings.samples = samples
    if time_limit_s is not None:
        settings.time_limit = time_limit_s
    if seed is not None:
        settings.seed = seed


def choose_error(scene: bpy.types.Scene, error: float, samples: int | None) -> None:
    """Ends a render by Luch at that error, a fraction; without a number of samples, however many it takes."""
    from luch.stopping import UNLIMITED_SAMPLES

    settings = scene.luch
    settings.error_limit_percent = 100.0 * error
    settings.samples = samples or UNLIMITED_SAMPLES


def choose_size(scene: bpy.types.Scene, width: int, height: int) -> None:
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100


def choose_window(scene: bpy.types.Scene, window: tuple[int, int, int, int]) -> None:
    """Renders only pixels x0..x1, y0..y1 (from the bottom left) of the frame, and saves only them."""
    render = scene.render
    x0, y0, x1, y1 = window
    width, height = render.resolution_x, render.resolution_y
    render.use_border = render.use_crop_to_border = (x0, y0, x1, y1) != (0, 0, width, height)
    # Blender rounds border * size down: aim at the middle of the pixel.
    render.border_min_x, render.border_max_x = (x0 + 0.5) / width, min(1.0, (x1 + 0.5) / width)
    render.border_min_y, render.border_max_y = (y0 + 0.5) / height, min(1.0, (y1 + 0.5) / height)


def render_frame(scene: bpy.types.Scene) -> Render:
    """Renders the current frame into Blender's Render Result. Raises RuntimeError when the engine reports an error."""
    wall, cpu = time.perf_counter(), time.process_time()
    bpy.ops.render.render(scene=scene.name)
    size = scene.render.resolution_percentage / 100
    width, height = int(scene.render.resolution_x * size), int(scene.render.resolution_y * size)
    return Render(time.perf_counter() - wall, time.process_time() - cpu, width, height)


def save_result(scene: bpy.types.Scene, path: Path) -> None:
    """The Render Result as multilayer float EXR, or as PNG through the scene's own view transform."""
    path.parent.mkdir(parents=True, exist_ok=True)
    settings = scene.render.image_settings
    if path.suffix == ".exr":
        settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format = "OPEN_EXR_MULTILAYER"
        settings.color_depth, settings.exr_codec = "32", "ZIP"
    else:
        settings.media_type = "IMAGE"
        settings.file_format = "PNG"
        settings.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
        settings.color_depth = "8"
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)
