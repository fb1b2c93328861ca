"""Figures of rows 38 and 39 of the hard cases: what white surfaces send back of a white world."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from luch.scene import Camera, Material

from support.accel_meshes import icosphere
from support.closures import closures, reflectance
from support.hard_geometry import quad
from support.hard_scenes import glass, looking, mesh_of, picture, scene_of


def plane_energy(material: Material, degrees: float, samples: int = 64, **settings: Any) -> float:
    """Mean of a plane in a furnace, seen under an angle to its normal."""
    a = math.radians(degrees)
    eye = looking((10.0 * math.sin(a), 0.0, 10.0 * math.cos(a)), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    camera = Camera(kind="ORTHO", matrix=eye, ortho_scale=1.0)
    scene = scene_of([quad(2e3)], [material], camera=camera, samples=samples, size=(12, 12), bounces=512, **settings)
    return float(picture(scene).mean(dtype=np.float64))


def closed_glass_energy(roughness: float, samples: int = 48, **settings: Any) -> float:
    """Mean of a ball of glass that fills the picture, in a furnace."""
    eye = looking((0.0, 0.0, 10.0), (0.0, 0.0, 0.0))
    camera = Camera(kind="ORTHO", matrix=eye, ortho_scale=1.2)
    scene = scene_of([mesh_of("Ball", icosphere(3))], [glass(1.5, roughness)], camera=camera, samples=samples,
                     size=(12, 12), bounces=512, **settings)  # fmt: skip
    return float(picture(scene).mean(dtype=np.float64))


def closure_energy(node: str, inputs: dict[str, Any], degrees: float, count: int = 1 << 16) -> float:
    """The same of a node's closures alone, by a lattice of samples: the channel that is farthest from 1."""
    energy = reflectance(closures(node, inputs, degrees), count)
    return float(energy[np.argmax(np.abs(energy - 1.0))])
