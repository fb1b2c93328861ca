"""Earth's atmosphere with multiple scattering, at 630, 560, 490 and 430 nm. Lengths in kilometres.

Source: Garcia Linan, "Physically based sky", 2023 (the model, the spectral quantities and the fit of the
later bounces); Hillaire, "Physically Based Sky, Atmosphere and Cloud Rendering in Frostbite", 2016 (the
integral over a step).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
Floats = NDArray[np.floating]
Densities = tuple[float, float, float]  # air, aerosol, ozone, relative to Earth's

EARTH_RADIUS_KM = 6371.0
THICKNESS_KM = 100.0
STEPS = 64  # along a ray
LUT_ALTITUDES, LUT_COSINES = 64, 256
AEROSOL_G = 0.8
GROUND_ALBEDO = 0.3

SUN_IRRADIANCE = np.array([1.679, 1.828, 1.986, 1.307], np.float32)  # W / m2 / nm, above the air
AIR_SCATTERING = np.array([6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2], np.float32)  # 1 / km at sea level
OZONE_CROSS_SECTION = np.array([3.472e-25, 3.914e-25, 1.349e-25, 11.03e-27], np.float32)  # m2 (x 1e4)
OZONE_DOBSON = 334.5
AEROSOL_ABSORPTION = np.array([2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23], np.float32)  # urban air
AEROSOL_SCATTERING = np.array([1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22], np.float32)
AEROSOL_DENSITY, AEROSOL_BACKGROUND, AEROSOL_HEIGHT_KM = 1.3681e20, 2e6, 0.73
LATER_BOUNCES = 0.02 * np.array([0.217, 0.347, 0.594, 1.0], np.float32)
SPECTRUM_TO_XYZ = np.array(
    [
        [53.386917738564668, 22.981337506691025, 0.0],
        [43.904844466369358, 71.347795700053394, 0.10250686796574131],
        [1.6137278251608962, 18.422960591455485, 31.742921188390806],
        [20.762668673810577, 2.3614213523314369, 110.48009643252140],
    ],
    np.float32,
)


def sky_radiance(columns: int, rows: int, elevation: float, altitude_m: float, densities: Densities) -> F32:
    """XYZ radiance (rows, columns, 3) over half a turn from the sun's opposite; rows are from nadir to zenith."""
    lut = _transmittance_lut(densities)
    height = _altitude_km(altitude_m)
    azimuth = (np.pi * (np.arange(columns) + 0.5) / columns).astype(np.float32)
    line = (np.arange(rows, dtype=np.float32) + np.float32(0.5)) / np.float32(rows) * 2 - 1
    up = np.copysign(line * line, line) * np.float32(np.pi / 2)  # finer towards the horizon
    up, azimuth = np.meshgrid(up, azimuth, indexing="ij")
    rays = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], -1).reshape(-1, 3)
    spectrum = _in_scattering(rays, _sun(np.sin(elevation)), height, lut, densities)
    return np.asarray((spectrum @ SPECTRUM_TO_XYZ).reshape(rows, columns, 3))


def sun_radiance(
    elevation: float, diameter: float, altitude_m: float, densities: Densities, end: float
) -> NDArray[np.float64]:
    """XYZ radiance of the sun's disc at its centre plus ``end`` diameters upwards."""
    cosine = np.array([np.sin(elevation + end * diameter)], np.float32)
    through = _transmittance(cosine, np.array([_altitude_km(altitude_m)], np.float32), densities)[0]
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(diameter / 2.0))
    return np.asarray((SUN_IRRADIANCE * through / solid_angle) @ SPECTRUM_TO_XYZ, np.float64)


def _altitude_km(metres: float) -> float:
    return float(np.clip(metres, 1.0, 99999.0)) / 1000.0


def _sun(cosine: float) -> F32:
    return np.array([-np.sqrt(max(1.0 - cosine * cosine, 0.0)), 0.0, cosine], np.float32)


def _distance_to_sphere(r: float | Floats, cosine: Floats, radius: float) -> F32:
    """Along a ray that starts at distance r from the centre; negative where it misses."""
    r = np.asarray(r, np.float64)
    b = r * cosine.astype(np.float64)
    c = r * r - radius * radius
    d = b * b - c
    root = np.sqrt(np.maximum(d, 0.0))
    miss = ((c > 0) & (b > 0)) | (d < 0)
    return np.where(miss, -1.0, np.where(c <= 0, root - b, -b - root)).astype(np.float32)


def _coefficients(altitude: F32, densities: Densities) -> tuple[F32, F32, F32]:
    """Scattering by air, by aerosol, and extinction, 1/km; (N,) -> (N, 4) each."""
    air, aerosol, ozone = densities
    h = altitude[:, None].astype(np.float32)
    by_air = AIR_SCATTERING * (np.exp(-0.07771971 * h**1.16364243) * air)
    log_h = np.log(np.maximum(h, 1e-4))
    ozone_profile = 3.78547397e20 * np.exp(-((log_h - 3.22261) ** 2) * 5.55555555 - log_h) * (ozone * OZONE_DOBSON)
    background = AEROSOL_BACKGROUND / AEROSOL_DENSITY
    particles = AEROSOL_DENSITY * aerosol * (np.exp(-h / AEROSOL_HEIGHT_KM) + background)
    by_aerosol = AEROSOL_SCATTERING * particles
    extinction = by_air + by_aerosol + AEROSOL_ABSORPTION * particles + OZONE_CROSS_SECTION * ozone_profile
    return by_air.astype(np.float32), by_aerosol.astype(np.float32), extinction.astype(np.float32)


def _transmittance(cosine: F32, altitude: Floats, densities: Densities) -> F32:
    """From altitudes out of the atmosphere towards the sun; (N,) each -> (N, 4)."""
    r = altitude.astype(np.float64) + EARTH_RADIUS_KM
    step = _distance_to_sphere(r, cosine, EARTH_RADIUS_KM + THICKNESS_KM) / np.float32(STEPS)
    depth = np.zeros((len(cosine), 4), np.float32)
    for k in range(STEPS):
        t = (k + 0.5) * step.astype(np.float64)
        h = np.sqrt(r * r + 2.0 * r * cosine * t + t * t) - EARTH_RADIUS_KM
        depth += _coefficients(np.maximum(h, 0.0), densities)[2] * step[:, None]
    return np.exp(-depth)


def _transmittance_lut(densities: Densities) -> F32:
    """(64 altitudes, 256 cosines from -1 to 1, 4)."""
    altitude, cosine = np.meshgrid(
        np.linspace(0.0, THICKNESS_KM, LUT_ALTITUDES), np.linspace(-1.0, 1.0, LUT_COSINES), indexing="ij"
    )
    flat = _transmittance(cosine.ravel().astype(np.float32), altitude.ravel(), densities)
    return flat.reshape(LUT_ALTITUDES, LUT_COSINES, 4)


def _interpolate(table: F32, at: F32) -> F32:
    """Along the first axis, at places in [0, len - 1]."""
    low = at.astype(np.int32)
    t = (at - low)[:, None]
    return table[low] * (1 - t) + table[np.minimum(low + 1, len(table) - 1)] * t


def _look_up(lut: F32, cosine: F32, height: F32) -> F32:
    """Transmittance to the sun by bilinear interpolation; height 0..1."""
    x = np.clip(cosine * 0.5 + 0.5, 0, 1) * (LUT_COSINES - 1)
    y = np.clip(height, 0, 1) * (LUT_ALTITUDES - 1)
    i, j = x.astype(np.int32), y.astype(np.int32)
    i2, j2 = np.minimum(i + 1, LUT_COSINES - 1), np.minimum(j + 1, LUT_ALTITUDES - 1)
    fx, fy = (x - i)[:, None], (y - j)[:, None]
    low = lut[j, i] * (1 - fx) + lut[j, i2] * fx
    high = lut[j2, i] * (1 - fx) + lut[j2, i2] * fx
    return np.asarray(low * (1 - fy) + high * fy)


def _later_bounces(lut: F32, cosine: F32, height: F32, r: F32) -> F32:
    """Light that arrives from the ground and from the air around, over the sun's irradiance."""
    solid_angle = 2.0 * np.pi * (1.0 - np.sqrt(np.maximum(1.0 - (EARTH_RADIUS_KM / r) ** 2, 0.0)))
    to_ground = _interpolate(lut[0], np.clip(cosine * 0.5 + 0.5, 0, 1) * (LUT_COSINES - 1))
    zenith = lut[:, -1]
    to_sample = zenith[0] / _interpolate(zenith, np.clip(height, 0, 1) * (LUT_ALTITUDES - 1))
    ground = to_ground * to_sample * (solid_angle * cosine * (GROUND_ALBEDO / np.pi / (4.0 * np.pi)))[:, None]
    air = LATER_BOUNCES * (1.0 / (1.0 + 5.0 * np.exp(-17.92 * cosine)))[:, None]
    return np.asarray((air + ground).astype(np.float32))


def _in_scattering(rays: F32, sun: F32, height: float, lut: F32, densities: Densities) -> F32:
    """Spectral radiance that arrives along rays; (N, 3) -> (N, 4)."""
    r0 = EARTH_RADIUS_KM + height
    ground = _distance_to_sphere(r0, rays[:, 2], EARTH_RADIUS_KM)
    end = np.where(ground < 0, _distance_to_sphere(r0, rays[:, 2], EARTH_RADIUS_KM + THICKNESS_KM), ground)
    step = (end / STEPS).astype(np.float32)
    along = -(rays @ sun)
    air_phase = 3.0 / (16.0 * np.pi) * (1.0 + along**2)
    width = 1.0 + AEROSOL_G**2 + 2.0 * AEROSOL_G * along
    aerosol_phase = (1.0 - AEROSOL_G**2) / (4.0 * np.pi * width * np.sqrt(width))
    light = np.zeros((len(rays), 4), np.float32)
    through = np.ones_like(light)
    cos_view, cos_sun = rays[:, 2].astype(np.float64), (rays @ sun).astype(np.float64)
    for k in range(STEPS):
        t = (k + 0.5) * step.astype(np.float64)
        r = np.sqrt(r0 * r0 + 2.0 * r0 * cos_view * t + t * t)
        altitude = np.maximum(r - EARTH_RADIUS_KM, 0.0).astype(np.float32)
        relative = altitude / np.float32(THICKNESS_KM)
        cosine = ((r0 * float(sun[2]) + cos_sun * t) / r).astype(np.float32)
        by_air, by_aerosol, extinction = _coefficients(altitude, densities)
        to_sun = _look_up(lut, cosine, relative)
        later = _later_bounces(lut, cosine, relative, r.astype(np.float32))
        source = by_air * (air_phase[:, None] * to_sun + later) + by_aerosol * (aerosol_phase[:, None] * to_sun + later)
        kept = np.exp(-step[:, None] * extinction)
        light += through * (SUN_IRRADIANCE * source) * (1 - kept) / np.maximum(extinction, 1e-7)
        through *= kept
    return light
