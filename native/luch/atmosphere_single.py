"""Earth's atmosphere with one bounce of sunlight, at 21 wavelengths from 380 to 780 nm. Lengths in metres.

Source: Nishita et al., "Display of the Earth Taking into Account Atmospheric Scattering", 1993, in
spectral form; ozone as a layer around 25 km.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from luch.spectrum import OBSERVER

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Densities = tuple[float, float, float]  # air, aerosol, ozone, relative to Earth's

EARTH_RADIUS, ATMOSPHERE_RADIUS = 6360e3, 6420e3
HIGHEST = 59999.0
AIR_SCALE, AEROSOL_SCALE = 8000.0, 1200.0  # heights over which densities fall to 1/e
AEROSOL_SCATTERING, AEROSOL_EXTINCTION = 2e-5, 1.11 * 2e-5  # 1/m
AEROSOL_G = 0.76
STEPS = 32

WAVELENGTH_STEP_NM = 20.0
WAVELENGTHS_M = (380.0 + WAVELENGTH_STEP_NM * np.arange(21)) * 1e-9
_XYZ = OBSERVER[::4] * WAVELENGTH_STEP_NM
# The sun as a black body of 5778 K seen from Earth, W / m2 / nm.
_SUN_KELVIN, _SUN_SOLID_ANGLE = 5778.0, np.pi * (6.955e8 / 1.496e11) ** 2
SUN_IRRADIANCE = (
    (2.0 * 6.62607015e-34 * 299792458.0**2 * 1e-9)
    / WAVELENGTHS_M**5
    / np.expm1(6.62607015e-34 * 299792458.0 / (WAVELENGTHS_M * 1.380649e-23 * _SUN_KELVIN))
    * _SUN_SOLID_ANGLE
)
AIR_SCATTERING = 1.13115e-30 / WAVELENGTHS_M**4  # 1/m at sea level
# Absorption cross-sections of ozone (Serdyuchenko et al. 2014) times its density in the layer, 1e-10/m.
_OZONE = (
    "32.5126849861 58.5395365047 197.719115508 730.956876291 2008.45625142 4038.39580961 6355.13359123 9670.70411809"
    " 15479.7400424 20903.8647223 24612.8056164 27355.1299461 21512.5863128 15905.1840791 11235.6197979 7352.75514875"
    " 4645.01303578 3309.60799210 2251.26122926 1487.91292664 1682.86233641"
)
OZONE_ABSORPTION = np.array([float(word) for word in _OZONE.split()]) * 1e-10


def _quadrature() -> tuple[F64, F64]:
    """Gauss-Laguerre nodes and weights for depths that fall off along a ray of unit length."""
    nodes, weights = np.polynomial.laguerre.laggauss(8)
    longest = 25.0  # the last node, 22.9, stays inside
    return nodes / longest, weights * np.exp(nodes) / longest


_NODES, _WEIGHTS = _quadrature()


def sky_radiance(columns: int, rows: int, elevation: float, altitude_m: float, densities: Densities) -> F32:
    """XYZ radiance (rows, columns, 3) over half a turn from the sun's opposite; rows are from nadir to zenith."""
    sky = np.zeros((rows, columns, 3), np.float32)
    half = rows // 2
    angle = np.pi / 2.0 * ((np.arange(rows) / half) - 1.0) ** 2  # finer towards the horizon
    up = angle[half:]
    azimuth = np.pi * np.arange(columns) / columns - np.pi
    up, azimuth = np.meshgrid(up, azimuth, indexing="ij")
    rays = _direction(up, azimuth).reshape(-1, 3)
    spectrum = _in_scattering(rays, _direction(np.array(elevation), np.array(0.0)), _origin(altitude_m), densities)
    sky[half:] = (spectrum @ _XYZ).reshape(rows - half, columns, 3)
    # The ground shows the horizon, faded out: black from 0.4 below.
    fade = np.maximum(1.0 - 2.5 * np.sin(angle[:half]), 0.0) ** 3
    sky[:half] = sky[half] * fade[:, None, None]
    return sky


def sun_radiance(elevation: float, diameter: float, altitude_m: float, densities: Densities, end: float) -> F64:
    """XYZ radiance of the sun's disc at its centre plus ``end`` diameters upwards, none below the horizon."""
    if elevation + 0.5 * diameter <= 0.0:
        return np.zeros(3)
    direction = _direction(np.array(max(elevation + end * diameter, 0.0)), np.array(0.0))
    depth = _optical_depth(_origin(altitude_m)[None], direction[None])[0]
    air, aerosol, _ozone = densities
    attenuation = AIR_SCATTERING * depth[0] * air + AEROSOL_EXTINCTION * depth[1] * aerosol
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(diameter / 2.0))
    return np.asarray((SUN_IRRADIANCE * np.exp(-attenuation) / solid_angle) @ _XYZ)


def _origin(altitude_m: float) -> F64:
    return np.array([0.0, 0.0, EARTH_RADIUS + np.clip(altitude_m, 1.0, HIGHEST)])


def _direction(up: F64, azimuth: F64) -> F64:
    return np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], -1)


def _density(points: F64) -> F64:
    """Of air, aerosol and ozone relative to where each is densest; (..., 3) -> (..., 3)."""
    height = np.linalg.norm(points, axis=-1) - EARTH_RADIUS
    ozone = np.maximum(1.0 - np.abs(height - 25000.0) / 15000.0, 0.0)
    return np.stack([np.exp(-height / AIR_SCALE), np.exp(-height / AEROSOL_SCALE), ozone], -1)


def _distance_out(points: F64, directions: F64) -> F64:
    """To the top of the atmosphere, from inside."""
    b = np.sum(points * directions, -1)
    return np.asarray(np.sqrt(b * b - np.sum(points * points, -1) + ATMOSPHERE_RADIUS**2) - b)


def _optical_depth(points: F64, directions: F64) -> F64:
    """Of air, aerosol and ozone out of the atmosphere; (N, 3) each -> (N, 3), metres at full density."""
    length = _distance_out(points, directions)[:, None]
    depth = np.zeros_like(points)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        depth += weight * _density(points + node * length * directions)
    return np.asarray(depth * length)


def _in_scattering(rays: F64, sun: F64, origin: F64, densities: Densities) -> F32:
    """Spectral radiance that arrives along rays; (N, 3) -> (N, 21)."""
    scale = np.array(densities)
    step = _distance_out(np.broadcast_to(origin, rays.shape), rays)[:, None] / STEPS
    mu = rays @ sun
    g2 = AEROSOL_G**2
    air_phase = 3.0 / (16.0 * np.pi) * (1.0 + mu**2)
    aerosol_phase = (
        3.0 * (1.0 - g2) * (1.0 + mu**2) / (8.0 * np.pi * (2.0 + g2) * (1.0 + g2 - 2.0 * AEROSOL_G * mu) ** 1.5)
    )
    absorption = np.stack([AIR_SCATTERING, np.full(21, AEROSOL_EXTINCTION), OZONE_ABSORPTION]).astype(np.float32)
    spectrum = np.zeros((len(rays), 21), np.float32)
    depth = np.zeros_like(rays)
    for k in range(STEPS):
        points = origin + (k + 0.5) * step * rays
        density = _density(points) * scale
        depth += step * density
        along = np.sum(points * sun, -1)
        in_shadow = (sun[2] < 0.0) & (along**2 >= np.sum(points * points, -1) - EARTH_RADIUS**2)
        total = (depth + _optical_depth(points, np.broadcast_to(sun, points.shape)) * scale).astype(np.float32)
        by_air = (air_phase * density[:, 0] * step[:, 0])[:, None] * AIR_SCATTERING
        by_aerosol = (aerosol_phase * density[:, 1] * step[:, 0] * AEROSOL_SCATTERING)[:, None]
        lit = np.exp(-(total @ absorption)) * (by_air + by_aerosol).astype(np.float32)
        spectrum += np.where(in_shadow[:, None], np.float32(0.0), lit)
    return spectrum * SUN_IRRADIANCE.astype(np.float32)
