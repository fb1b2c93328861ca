"""Cameras."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from luch.bounds import LEAST_CYLINDER_RADIUS
from luch.scene import F64, Camera

from .context import ExportContext

# Blender's names of panoramas -> Camera.kind.
PANORAMAS = {
    "EQUIRECTANGULAR": "EQUIRECTANGULAR",
    "FISHEYE_EQUIDISTANT": "FISHEYE_EQUIDISTANT",
    "FISHEYE_EQUISOLID": "FISHEYE_EQUISOLID",
    "FISHEYE_LENS_POLYNOMIAL": "FISHEYE_POLYNOMIAL",
    "MIRRORBALL": "MIRROR_BALL",
    "EQUIANGULAR_CUBEMAP_FACE": "CUBE_FACE",
    "CENTRAL_CYLINDRICAL": "CYLINDER",
}


def export_camera(subject: Any, context: ExportContext, engine: Any) -> Camera:
    """The camera of a render. Raises ValueError if there is none."""
    if subject is None or subject.type != "CAMERA":
        raise ValueError(
            f'Scene "{context.scene.name}" has no camera: add one with Add > Camera, or choose one in Scene properties.'
        )
    data: Any = subject.data
    camera = Camera(
        kind=_kind(data, context),
        matrix=camera_matrix(subject, engine if context.scene.render.use_multiview else None),
        lens_mm=data.lens,
        sensor_width_mm=data.sensor_width,
        sensor_height_mm=data.sensor_height,
        sensor_fit=data.sensor_fit,
        ortho_scale=data.ortho_scale,
        shift_x=engine.camera_shift_x(subject) if engine else data.shift_x,
        shift_y=data.shift_y,
        clip_start=data.clip_start,
        clip_end=data.clip_end,
    )
    add_panorama(camera, data)
    _add_depth_of_field(camera, data.dof, context)
    return camera


def _kind(data: Any, context: ExportContext) -> str:
    if data.type in ("PERSP", "ORTHO"):
        return str(data.type)
    if data.type == "PANO" and data.panorama_type in PANORAMAS:
        return PANORAMAS[data.panorama_type]
    name = data.panorama_type if data.type == "PANO" else data.type
    context.warn(f'Camera "{data.name}": type {name} is not supported and drawn as perspective.')
    return "PERSP"


def add_panorama(camera: Camera, data: Any) -> None:
    """What panoramas ask for."""
    camera.latitude = (data.latitude_min, data.latitude_max)
    camera.longitude = (data.longitude_min, data.longitude_max)
    camera.fisheye_fov = data.fisheye_fov
    camera.fisheye_lens_mm = data.fisheye_lens
    k0, k1, k2, k3, k4 = (getattr(data, f"fisheye_polynomial_k{power}") for power in range(5))
    camera.fisheye_polynomial = (k0, k1, k2, k3, k4)
    camera.cylinder_angle = (data.central_cylindrical_range_u_min, data.central_cylindrical_range_u_max)
    radius = max(data.central_cylindrical_radius, LEAST_CYLINDER_RADIUS)
    camera.cylinder_height = (
        data.central_cylindrical_range_v_min / radius,
        data.central_cylindrical_range_v_max / radius,
    )


def camera_matrix(subject: Any, views: Any = None) -> F64:
    """Camera to world, (3, 4), of an evaluated camera. views: the engine, which knows the eye that it renders now, where
    there are several."""
    seen = subject.matrix_world if views is None else views.camera_model_matrix(subject)
    return _rigid(np.array(seen, dtype=np.float64))[:3]


def _rigid(matrix: F64) -> F64:
    """The matrix with unit axes: a camera's scale changes nothing in Blender."""
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    matrix[:3, :3] /= np.where(lengths > 0.0, lengths, 1.0)
    return matrix


def _add_depth_of_field(camera: Camera, dof: Any, context: ExportContext) -> None:
    camera.use_dof = dof.use_dof
    camera.focus_distance = dof.focus_distance
    camera.fstop = dof.aperture_fstop
    camera.blades = dof.aperture_blades
    camera.blades_rotation = dof.aperture_rotation
    camera.aperture_ratio = dof.aperture_ratio
    if dof.focus_object is not None:
        target = context.object_matrix(dof.focus_object)
        bones = dof.focus_object.pose.bones if dof.focus_object.pose else {}
        if dof.focus_subtarget and dof.focus_subtarget in bones:
            target = target @ np.array(bones[dof.focus_subtarget].matrix, dtype=np.float64)
        to_target = target[:3, 3] - camera.matrix[:, 3]
        camera.focus_distance = abs(float(to_target @ camera.matrix[:, 2]))
    if not math.isfinite(camera.focus_distance):
        raise ValueError("The camera's focus object has a position that is not finite: move it.")
