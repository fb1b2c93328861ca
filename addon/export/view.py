"""What a 3D view of Blender's window looks through, read off the projection with which Blender draws its overlays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from luch.scene import F64, Camera

from .camera import export_camera
from .context import ExportContext


@dataclass
class View:
    """A region's camera, and where in the region its frame lies: pixels from the bottom left corner."""

    camera: Camera
    width: int  # of the frame, pixels
    height: int
    pixel_aspect: tuple[float, float]
    border: tuple[int, int, int, int] | None  # of the frame, as luch.scene.Film has it
    corner: tuple[float, float]  # of the frame in the region
    extent: tuple[float, float]  # of the frame in the region
    origin: tuple[float, float, float]  # Scene.origin: what is seen lies near it

    def place(self, width: int, height: int, border: tuple[int, int, int, int] | None) -> tuple[float, ...]:
        """x, y, width, height in the region of a picture of this view with so many pixels, or of its border's part."""
        x0, y0, x1, y1 = border or (0, 0, width, height)
        across, up = self.extent[0] / width, self.extent[1] / height
        return (self.corner[0] + x0 * across, self.corner[1] + y0 * up, (x1 - x0) * across, (y1 - y0) * up)


def read_view(region: Any, space: Any, context: ExportContext) -> View:
    """The view of a region of a 3D viewport. Raises ValueError where it has no area or its camera is not one."""
    width, height = region.width, region.height
    if width < 1 or height < 1:
        raise ValueError("The viewport has no pixels.")
    view = region.data
    through = _camera_object(view, space, context)
    if through is None:
        camera, origin = _free_camera(view, space)
    else:
        camera = export_camera(through, context, None)
        origin = _place(camera.matrix, "The camera's transform is not finite: clear it with Object > Clear.")
    panorama = camera.kind not in ("PERSP", "ORTHO")
    frame = (0.0, 0.0, float(width), float(height))
    if through is not None and (context.scene.render.use_border or panorama):
        frame = _camera_frame(through, view, context, width, height)
    if panorama:
        return _panorama(camera, frame, _camera_border(context), (width, height), origin)
    aspect = _fit(camera, np.array(view.window_matrix, dtype=np.float64), width, height)
    border = _border(through, space, context, frame, width, height)
    return View(camera, width, height, aspect, border, (0.0, 0.0), (float(width), float(height)), origin)


def view_state(region: Any) -> tuple[object, ...]:
    """What changes when the view does."""
    view = region.data
    matrices = (bytes(np.array(matrix, np.float32)) for matrix in (view.view_matrix, view.window_matrix))
    return (region.width, region.height, view.view_perspective, *matrices)


def _camera_object(view: Any, space: Any, context: ExportContext) -> Any:
    """The camera that the view looks through, evaluated; None: none."""
    if view.view_perspective != "CAMERA":
        return None
    chosen = space.camera if space.use_local_camera else context.scene.camera
    if chosen is None:
        return None
    return chosen if chosen.is_evaluated else chosen.evaluated_get(context.depsgraph)


def _place(matrix: F64, otherwise: str) -> tuple[float, float, float]:
    if not np.isfinite(matrix).all():
        raise ValueError(otherwise)
    return (float(matrix[0, 3]), float(matrix[1, 3]), float(matrix[2, 3]))


def _free_camera(view: Any, space: Any) -> tuple[Camera, tuple[float, float, float]]:
    """Of a view that looks through no camera. Orthographic views see as far behind their place as before it."""
    matrix = np.linalg.inv(np.array(view.view_matrix, dtype=np.float64))[:3]
    matrix[:, :3] /= np.linalg.norm(matrix[:, :3], axis=0)
    origin = _place(matrix, "The view's transform is not finite: reset it with View > Frame All.")
    camera = Camera(matrix=matrix, lens_mm=space.lens, clip_start=space.clip_start, clip_end=space.clip_end)
    if not view.is_perspective:
        camera.kind = "ORTHO"
        camera.clip_start = 0.0
        camera.matrix[:, 3] += camera.matrix[:, 2] * (0.5 * space.clip_end)
        pivot = view.view_location
        origin = (float(pivot[0]), float(pivot[1]), float(pivot[2]))
    return camera, origin


def _fit(camera: Camera, projection: F64, width: int, height: int) -> tuple[float, float]:
    """Let the camera see what the projection (OpenGL's, 4 x 4) maps to the region. Returns the pixels' aspect.

    The sensor grows or shrinks, not the lens: depth of field stays as it is.
    """
    across, up = float(projection[0, 0]), float(projection[1, 1])
    if not (math.isfinite(across) and math.isfinite(up) and across > 0.0 and up > 0.0):
        raise ValueError("The view's projection is not finite: reset it with View > Frame All.")
    # The centre of the region, in halves of its width and height.
    column, sign = (2, 1.0) if projection[3, 2] != 0.0 else (3, -1.0)
    x, y = sign * float(projection[0, column]), sign * float(projection[1, column])
    camera.sensor_fit = "HORIZONTAL"
    if camera.kind == "ORTHO":
        camera.ortho_scale = 2.0 / across
    else:
        camera.sensor_width_mm = 2.0 * camera.lens_mm / across
    camera.shift_x = 0.5 * x
    camera.shift_y = 0.5 * y * across / up
    return (1.0, across / up * width / height)


def _camera_frame(
    through: Any, view: Any, context: ExportContext, width: int, height: int
) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of the camera's frame in the region, in pixels."""
    projection = np.array(view.window_matrix, dtype=np.float64)
    corners = np.array([(*corner, 1.0) for corner in through.data.view_frame(scene=context.scene)])
    clip = corners @ projection.T
    place = (clip[:, :2] / clip[:, 3:] + 1.0) * 0.5 * (width, height)
    low, high = place.min(axis=0), place.max(axis=0)
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def _camera_border(context: ExportContext) -> tuple[float, float, float, float]:
    """Of the render border, in fractions of the camera's frame."""
    render = context.scene.render
    if not render.use_border:
        return (0.0, 0.0, 1.0, 1.0)
    return (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)


def _border(
    through: Any, space: Any, context: ExportContext, frame: tuple[float, ...], width: int, height: int
) -> tuple[int, int, int, int] | None:
    """Pixels of the region that are rendered: of the camera's render border, else of the view's own; None: all."""
    if through is not None:
        if not context.scene.render.use_border:
            return None
        x0, y0, x1, y1 = _camera_border(context)
    elif space.use_render_border:
        x0, y0 = space.render_border_min_x, space.render_border_min_y
        x1, y1 = space.render_border_max_x, space.render_border_max_y
    else:
        return None
    left, bottom, right, top = frame
    return _pixels(
        (left + x0 * (right - left), bottom + y0 * (top - bottom), left + x1 * (right - left),
         bottom + y1 * (top - bottom)), width, height,
    )  # fmt: skip


def _pixels(edges: tuple[float, ...], width: int, height: int) -> tuple[int, int, int, int]:
    """Whole pixels of a rectangle, at least one, inside a frame: fractions are cut off, as by Cycles."""
    x0 = min(max(int(edges[0]), 0), width - 1)
    y0 = min(max(int(edges[1]), 0), height - 1)
    return (x0, y0, min(max(int(edges[2]), x0 + 1), width), min(max(int(edges[3]), y0 + 1), height))


def _panorama(
    camera: Camera,
    frame: tuple[float, float, float, float],
    shown: tuple[float, float, float, float],
    region: tuple[int, int],
    origin: tuple[float, float, float],
) -> View:
    """A panorama fills the camera's frame; of it, what lies in the region is rendered."""
    left, bottom, right, top = frame
    width, height = max(1, round(right - left)), max(1, round(top - bottom))
    edges = (
        max(shown[0] * width, -left), max(shown[1] * height, -bottom),
        min(shown[2] * width, region[0] - left), min(shown[3] * height, region[1] - bottom),
    )  # fmt: skip
    border = _pixels(edges, width, height)
    return View(camera, width, height, (1.0, 1.0), border, (left, bottom), (right - left, top - bottom), origin)
