"""Stereoscopic scenes: each eye's picture beside Cycles'."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import OpenImageIO as oiio
import pytest
from support.objects import look_down, show
from support.pictures import F32

EYES = {"left": "_L", "right": "_R"}


def eyes(engine: str, scene: bpy.types.Scene, folder: Path) -> list[F32]:
    """Pictures of the left and of the right eye, float32 (H, W, 4)."""
    render = scene.render
    render.engine = engine
    render.resolution_x, render.resolution_y, render.resolution_percentage = 32, 32, 100
    scene.cycles.samples = scene.luch.samples = 4
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.view_settings.view_transform = "Raw"
    render.image_settings.file_format, render.image_settings.color_depth = "PNG", "16"
    render.filepath = str(folder / engine)
    bpy.ops.render.render(write_still=True)
    return [oiio.ImageBuf(f"{render.filepath}{end}.png").get_pixels(oiio.FLOAT) for end in EYES.values()]


@pytest.mark.parametrize("mode", ["OFFAXIS", "PARALLEL", "TOE", "cameras of their own"])
def test_each_eye_sees_what_it_sees_in_cycles(scene: bpy.types.Scene, tmp_path: Path, mode: str) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.data.materials.append(show("ShaderNodeTexCoord", "Generated"))
    look_down(scene, 3.0)
    scene.camera.data.type, scene.camera.location.z = "PERSP", 5.0
    scene.render.use_multiview = True
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_distance = 0.8, 6.0
    if mode in ("OFFAXIS", "PARALLEL", "TOE"):
        stereo.convergence_mode = mode
    else:
        scene.render.views_format = "MULTIVIEW"
        for end, x in zip(EYES.values(), (-0.5, 0.7), strict=True):
            eye = scene.camera.copy()
            eye.name, eye.location.x = f"Eye{end}", x
            scene.collection.objects.link(eye)
        scene.camera = bpy.data.objects["Eye_L"]
    ours, theirs = (eyes(engine, scene, tmp_path) for engine in ("LUCH", "CYCLES"))
    assert np.abs(theirs[0] - theirs[1]).mean() > 0.01
    for picture, reference in zip(ours, theirs, strict=True):
        assert (np.abs(picture - reference).max(axis=2) > 0.01).mean() < 0.1
