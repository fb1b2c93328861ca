"""Tables of the Sky Texture (shade/textures/sky.h): what is computed once per sky instead of once per ray.

Two atmospheres (native/cpu/sky/): *single scattering* (Nishita et al. 1993: one bounce of sunlight on air
and dust, 21 wavelengths) and *multiple scattering* (Garcia Linan 2023: four wavelengths, later bounces by
a fit). All quantities are Blender's, so that a sky looks as it does in Cycles. Radiances are CIE XYZ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from luch._native import core
from luch.bounds import SMALLEST_SKY_SUN

F32 = NDArray[np.float32]

EARTH_RADIUS_M = 6371e3


@dataclass(frozen=True)
class Atmosphere:
    """Settings of a Sky Texture; angles in radians, altitude in metres, densities relative to Earth's."""

    multiple_scattering: bool
    sun_disc: bool
    sun_size: float  # angular diameter
    sun_intensity: float
    sun_elevation: float
    sun_rotation: float
    altitude: float
    air_density: float
    aerosol_density: float
    ozone_density: float


def wrap_sun(elevation: float, rotation: float) -> tuple[float, float]:
    """The same sun with its elevation in [-pi/2, pi/2] and its rotation, negated, in (0, 2 pi]."""
    elevation = float(np.fmod(elevation, 2.0 * np.pi))
    if abs(elevation) >= np.pi:
        elevation -= float(np.copysign(2.0 * np.pi, elevation))
    if abs(elevation) >= np.pi / 2.0:
        elevation = float(np.copysign(np.pi, elevation)) - elevation
        rotation += np.pi
    return elevation, 2.0 * np.pi - float(np.mod(rotation, 2.0 * np.pi))


def sun_direction(elevation: float, rotation: float) -> tuple[float, float, float]:
    """Unit vector towards the sun of a Sky Texture."""
    elevation, rotation = wrap_sun(elevation, rotation)
    theta, phi = elevation - np.pi / 2.0, rotation - np.pi / 2.0
    return float(np.sin(theta) * np.cos(phi)), float(np.sin(theta) * np.sin(phi)), float(np.cos(theta))


@lru_cache(maxsize=4)
def atmosphere_table(a: Atmosphere) -> F32:
    """SkyAtmosphere as float32: 14 numbers of the sun, then (256, 256, 3) of the sky's left half."""
    elevation, rotation = wrap_sun(a.sun_elevation, a.sun_rotation)
    diameter = max(a.sun_size, SMALLEST_SKY_SUN)
    bottom, top = (_disc_radiance(a, elevation + end * diameter, diameter) for end in (-0.5, 0.5))
    densities = (a.air_density, a.aerosol_density, a.ozone_density)
    radiance = core.sky.radiance(a.multiple_scattering, elevation, a.altitude, *densities)
    horizon = np.arcsin(EARTH_RADIUS_M / (EARTH_RADIUS_M + a.altitude)) - np.pi / 2.0
    disc = diameter if a.sun_disc else -1.0
    direction = sun_direction(a.sun_elevation, a.sun_rotation)
    sun = [*bottom, *top, *direction, elevation, rotation, disc, a.sun_intensity, horizon]
    return np.concatenate([np.array(sun, np.float32), radiance.ravel()])


def _disc_radiance(a: Atmosphere, elevation: float, diameter: float) -> NDArray[np.float64]:
    """XYZ radiance of the sun's disc where it stands at an elevation."""
    if not a.multiple_scattering:
        if wrap_sun(a.sun_elevation, 0.0)[0] + 0.5 * diameter <= 0.0:
            return np.zeros(3)
        elevation = max(elevation, 0.0)
    densities = (a.air_density, a.aerosol_density, a.ozone_density)
    irradiance = core.sky.sun_irradiance(a.multiple_scattering, elevation, a.altitude, *densities)
    return np.asarray(np.array(irradiance) / (2.0 * np.pi * (1.0 - np.cos(diameter / 2.0))))


def preetham_table(direction: tuple[float, float, float], turbidity: float) -> F32:
    """SkyPreetham as float32 (20,): angles of the sun, zenith, Perez coefficients of Y, x, y."""
    x, y, z = direction
    theta, phi = float(np.arccos(np.clip(z, -1.0, 1.0))), float(np.arctan2(x, y))
    t = turbidity
    perez = np.array([[0.1787, -0.3554, -0.0227, 0.1206, -0.0670], [-0.0193, -0.0665, -0.0004, -0.0641, -0.0033]])
    perez = np.vstack([perez, [-0.0167, -0.0950, -0.0079, -0.0441, -0.0109]]) * t
    perez += [
        [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703],
        [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452],
        [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529],
    ]
    chi = (4.0 / 9.0 - t / 120.0) * (np.pi - 2.0 * theta)
    luminance = 0.06 * ((4.0453 * t - 4.9710) * np.tan(chi) - 0.2155 * t + 2.4192)
    powers = np.array([theta**3, theta**2, theta, 1.0])
    turbid = np.array([t * t, t, 1.0])
    chroma_x = [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394]]
    chroma_y = [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516]]
    chroma_x.append([0.11693, -0.21196, 0.06052, 0.25886])
    chroma_y.append([0.15346, -0.26756, 0.06670, 0.26688])
    zenith = np.array([luminance, turbid @ np.array(chroma_x) @ powers, turbid @ np.array(chroma_y) @ powers])
    a, b, c, d, e = perez.T
    zenith /= (1.0 + a * np.exp(b)) * (1.0 + c * np.exp(d * theta) + e * np.cos(theta) ** 2)
    return np.concatenate([[theta, phi], zenith, perez.ravel()]).astype(np.float32)
