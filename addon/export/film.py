"""Film: resolution, border, pixel filter, passes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from luch.scene import Film

from .. import passes
from ..settings import effective
from .context import ExportContext
from .view import View


def export_film(context: ExportContext, size: tuple[int, int] | None) -> Film:
    """What the film records. size: full frame in pixels, None for the scene's own resolution."""
    scene, view_layer = context.scene, context.view_layer
    render = scene.render
    aovs, unnamed = passes.enabled_aovs(view_layer)
    for name in unnamed:
        context.warn(f'View layer "{view_layer.name}": AOV "{name}" has the name of another pass. Rename it.')
    for name in passes.missing_passes(view_layer):
        context.warn(f'View layer "{view_layer.name}" asks for the pass "{name}", which Luch does not render.')
    scale = render.resolution_percentage / 100.0
    width, height = size or (int(render.resolution_x * scale), int(render.resolution_y * scale))
    film = replace(
        _look(context),
        width=max(1, width),
        height=max(1, height),
        border=_border(render, width, height),
        pixel_aspect=(render.pixel_aspect_x, render.pixel_aspect_y),
        alpha_threshold=view_layer.pass_alpha_threshold,
        passes=[entry.name for entry in passes.enabled_passes(view_layer, scene)],
        cryptomatte_depth=passes.cryptomatte_depth(view_layer),
        lightgroups=[group.name for group in view_layer.lightgroups],
        aovs=[(aov.name, aov.type) for aov in aovs],
    )
    if scene.world is not None:
        mist = scene.world.mist_settings
        film.mist = (mist.start, mist.depth, mist.falloff)
    return film


def export_view_film(context: ExportContext, view: View) -> Film:
    """Of a 3D viewport: Combined alone."""
    return replace(
        _look(context), width=view.width, height=view.height, border=view.border, pixel_aspect=view.pixel_aspect
    )


def _look(context: ExportContext) -> Film:
    """What makes Combined look as it does, whatever its size."""
    scene = context.scene
    return Film(
        filter=effective(scene, "pixel_filter_type"),
        filter_width=effective(scene, "filter_width"),
        exposure=effective(scene, "film_exposure"),
        transparent=scene.render.film_transparent,
        transparent_glass=effective(scene, "film_transparent_glass"),
        transparent_roughness=effective(scene, "film_transparent_roughness"),
    )


def _border(render: Any, width: int, height: int) -> tuple[int, int, int, int] | None:
    """The rectangle that Blender allocates for a border: fractions of the frame, cut to whole pixels."""
    if not render.use_border:
        return None
    # In single precision, as Blender multiplies: 0.7 of 10 is 7, in double it would be 6.99999988.
    x0, x1 = (int(np.float32(edge) * np.float32(width)) for edge in (render.border_min_x, render.border_max_x))
    y0, y1 = (int(np.float32(edge) * np.float32(height)) for edge in (render.border_min_y, render.border_max_y))
    return (x0, y0, max(x1, x0 + 1), max(y1, y0 + 1))
