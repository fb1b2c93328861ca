"""Colour spaces beyond sRGB and linear, by Blender's own OpenColorIO configuration."""

from __future__ import annotations

import importlib
import os
import sys
from functools import cache
from typing import Any

import bpy
import numpy as np
from luch.scene import F32
from numpy.typing import NDArray


def to_scene_linear(pixels: NDArray[np.uint8], space: str) -> F32 | None:
    """(H, W, 4) bytes in a colour space of Blender's -> scene-linear float32; None where that cannot be done."""
    processor = _processor(space)
    if processor is None:
        return None
    values = np.ascontiguousarray(pixels, dtype=np.float32)
    values *= np.float32(1.0 / 255.0)
    processor.applyRGBA(values)
    return values


@cache
def _processor(space: str) -> Any:
    try:
        ocio = _open_color_io()
        path = os.environ.get("OCIO") or os.path.join(
            bpy.utils.resource_path("LOCAL"), "datafiles", "colormanagement", "config.ocio"
        )
        config = ocio.Config.CreateFromFile(path)
        return config.getProcessor(space, "scene_linear").getDefaultCPUProcessor()
    except Exception:  # no module, no configuration, no such space: the caller says so
        return None


def _open_color_io() -> Any:
    """Blender carries the module, but the bpy package leaves its folder out of sys.path."""
    try:
        return importlib.import_module("PyOpenColorIO")
    except ImportError:
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        sys.path.append(os.path.join(bpy.utils.resource_path("LOCAL"), "python", "lib", version, "site-packages"))
        try:
            return importlib.import_module("PyOpenColorIO")
        finally:
            sys.path.pop()
