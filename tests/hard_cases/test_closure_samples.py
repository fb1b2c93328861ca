"""Closure samples follow the density they claim: chi-square over the sphere, and sample against eval.

Numbers: the rows of the list of hard cases.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from luch import core
from scipy import stats
from support.closures import BACKFACING, CAMERA, Floats
from support.fibres import sphere, view

SAMPLES = 60_000
LATITUDES, LONGITUDES = 16, 24  # bins
FINE_Z, FINE_PHI = 32, 12  # Gauss-Legendre points per bin

GLOSSY = {"roughness": 0.5}
TANGENT = {"tangent": (0.8, 0.6, 0.0)}
LOBES: dict[str, tuple[str, dict[str, Any], int]] = {
    "lambert": ("diffuse", {}, CAMERA),
    "oren-nayar": ("diffuse", {"roughness": 0.7}, CAMERA),
    "translucent": ("translucent", {}, CAMERA),
    "ggx": ("glossy", {**GLOSSY, "distribution": "GGX"}, CAMERA),
    "ggx rough": ("glossy", {"roughness": 1.0, "distribution": "GGX"}, CAMERA),
    "ggx anisotropic": ("glossy", {"roughness": 0.6, "anisotropy": 0.5, "distribution": "GGX", **TANGENT}, CAMERA),
    "beckmann": ("glossy", {**GLOSSY, "distribution": "BECKMANN"}, CAMERA),
    "beckmann anisotropic": (
        "glossy",
        {"roughness": 0.6, "anisotropy": -0.4, "distribution": "BECKMANN", **TANGENT},
        CAMERA,
    ),
    "ashikhmin-shirley": ("glossy", {**GLOSSY, "distribution": "ASHIKHMIN_SHIRLEY"}, CAMERA),
    "ashikhmin-shirley anisotropic": (
        "glossy",
        {"roughness": 0.6, "anisotropy": 0.5, "distribution": "ASHIKHMIN_SHIRLEY", **TANGENT},
        CAMERA,
    ),
    "glass": ("glass", {**GLOSSY}, CAMERA),
    "glass from inside": ("glass", {**GLOSSY}, CAMERA | BACKFACING),
    "glass beckmann": ("glass", {**GLOSSY, "distribution": "BECKMANN"}, CAMERA),
    "refraction": ("refraction", {"roughness": 0.6, "distribution": "GGX"}, CAMERA),
    "refraction beckmann": ("refraction", {"roughness": 0.6, "distribution": "BECKMANN"}, CAMERA),
    "sheen": ("sheen", {"roughness": 0.5}, CAMERA),
    "velvet": ("velvet", {"roughness": 0.5}, CAMERA),
    "toon": ("toon", {"size": 0.4, "smooth": 2 / 3 - 0.4}, CAMERA),  # its rim lies on a bin edge
    "toon glossy": ("toon", {"size": 0.3, "smooth": 0.2, "glossy": True}, CAMERA),
    "conductor": ("metallic", {"physical": True}, CAMERA),
    "metal of edge tints": ("metallic", {"roughness": 0.4, "edge_tint": 0.3}, CAMERA),
    "film on metal": ("metallic", {"roughness": 0.4, "thin_film_thickness": 400.0}, CAMERA),
    "film on glass": ("glass", {**GLOSSY, "thin_film_thickness": 400.0}, CAMERA),
    "principled": ("principled", {"coat_weight": 0.5, "coat_roughness": 0.4, "sheen_weight": 0.5}, CAMERA),
    "principled glass": ("principled", {"transmission_weight": 1.0, "roughness": 0.5}, CAMERA),
    "principled metal": ("principled", {"metallic": 1.0, "anisotropic": 0.5, "roughness": 0.6, **TANGENT}, CAMERA),
    "thin glass": ("principled", {"thin_wall": True, "transmission_weight": 1.0}, CAMERA),
    "thin subsurface": (
        "principled",
        {"thin_wall": True, "subsurface_weight": 1.0, "diffuse_roughness": 0.5, "roughness": 0.6},
        CAMERA,
    ),
}
ANGLES = (0.0, 45.0, 80.0, 89.5, 89.9)


def closures(name: str, degrees: float) -> Any:
    node, inputs, flags = LOBES[name]
    a = math.radians(degrees)
    return core.bsdf.Closures(node, inputs, wo=(math.sin(a), 0.0, math.cos(a)), path_flags=flags)


def expected_counts(c: Any) -> Floats:
    """SAMPLES times the density's integral over each bin of cos(theta) and phi."""
    (at_z, weight_z), (at_phi, weight_phi) = (np.polynomial.legendre.leggauss(n) for n in (FINE_Z, FINE_PHI))
    z = ((np.arange(LATITUDES)[:, None] + 0.5 + 0.5 * at_z) / LATITUDES * 2.0 - 1.0).ravel()
    phi = ((np.arange(LONGITUDES)[:, None] + 0.5 + 0.5 * at_phi) / LONGITUDES * 2.0 * np.pi).ravel()
    grid_z, grid_phi = np.meshgrid(z, phi, indexing="ij")
    r = np.sqrt(1.0 - grid_z**2)
    w = np.stack([r * np.cos(grid_phi), r * np.sin(grid_phi), grid_z], axis=-1).reshape(-1, 3)
    pdf = c.eval(w.astype(np.float32))[1].astype(float)
    pdf = pdf.reshape(LATITUDES, FINE_Z, LONGITUDES, FINE_PHI)
    mass = np.einsum("azbp,z,p->ab", pdf, 0.5 * weight_z, 0.5 * weight_phi)
    return mass * 4.0 * np.pi / (LATITUDES * LONGITUDES) * SAMPLES


def observed_counts(drawn: dict[str, Any]) -> Floats:
    kept = drawn["pdf"] > 0.0
    d = drawn["direction"][kept]
    row = np.minimum(((d[:, 2] + 1.0) / 2.0 * LATITUDES).astype(int), LATITUDES - 1)
    turn = np.arctan2(d[:, 1], d[:, 0]) / (2.0 * np.pi) % 1.0
    column = np.minimum((turn * LONGITUDES).astype(int), LONGITUDES - 1)
    return np.bincount(row * LONGITUDES + column, minlength=LATITUDES * LONGITUDES).reshape(LATITUDES, LONGITUDES)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", LOBES)
def test_41_samples_of_a_closure_follow_their_density(name: str, degrees: float) -> None:
    c = closures(name, degrees)
    drawn = c.sample(np.random.default_rng(7).random((SAMPLES, 3), dtype=np.float32))
    expected, observed = expected_counts(c).ravel(), observed_counts(drawn).ravel()
    # What the density leaves over are draws that found no direction.
    expected = np.append(expected, max(SAMPLES - expected.sum(), 0.0))
    observed = np.append(observed, SAMPLES - observed.sum())
    order = np.argsort(expected)
    expected, observed = expected[order], observed[order]
    small = np.searchsorted(expected, 10.0)  # rare bins count together
    expected = np.append(expected[small:], expected[:small].sum())
    observed = np.append(observed[small:], observed[:small].sum())
    # Quadrature is good to a fraction of a percent per bin: that is no statistical difference.
    slack = 0.004 * expected + 0.004 * SAMPLES / len(expected)
    excess = np.maximum(np.abs(observed - expected) - slack, 0.0)
    chi2 = float((excess**2 / np.maximum(expected, 1.0)).sum())
    p = float(stats.chi2.sf(chi2, len(expected) - 1))
    assert p > 0.01 / (len(LOBES) * len(ANGLES)), (chi2, len(expected))  # Sidak's level for them all


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", LOBES)
def test_41_sampling_and_evaluation_of_a_closure_agree(name: str, degrees: float) -> None:
    c = closures(name, degrees)
    drawn = c.sample(np.random.default_rng(8).random((4000, 3), dtype=np.float32))
    kept = (drawn["pdf"] > 1e-4) & ~drawn["delta"] & (np.abs(drawn["direction"][:, 2]) > 1e-3)
    assert kept.sum() > 200
    light, pdf = c.eval(drawn["direction"][kept])
    assert np.quantile(np.abs(pdf / drawn["pdf"][kept] - 1.0), 0.99) < 2e-3
    sent = light.sum(axis=1) / pdf[:, None]
    assert np.quantile(np.abs(sent - drawn["throughput"][kept]), 0.99) < 2e-3


HAIR_SAMPLES, ROWS, COLUMNS = 40_000, 16, 24
HAIRS: dict[str, tuple[str, dict[str, Any]]] = {
    "fibre": ("principled_hair", {"absorption": (0.2, 0.5, 1.3)}),
    "rough fibre": ("principled_hair", {"roughness": 0.7, "radial_roughness": 0.8, "coat": 0.6, "pigments": True}),
    "tilted fibre": ("principled_hair", {"offset": 0.2, "ior": 1.3, "roughness": 0.4, "radial_roughness": 0.5}),
    "reflection": ("hair", {"offset": 0.1, "roughness_along": 0.3, "roughness_around": 0.6}),
    "transmission": ("hair", {"transmission": True, "roughness_along": 0.4, "roughness_around": 0.5}),
}


@pytest.mark.parametrize("lean", [5.0, 70.0])
@pytest.mark.parametrize("degrees", [0.0, 40.0])
@pytest.mark.parametrize("name", HAIRS)
def test_41_samples_of_hair_follow_their_density(name: str, degrees: float, lean: float) -> None:
    node, inputs = HAIRS[name]
    c = core.bsdf.Closures(node, inputs, **view(degrees, lean))
    drawn = c.sample(np.random.default_rng(7).random((HAIR_SAMPLES, 3), dtype=np.float32))
    fine = 12
    w, solid_angle = sphere(ROWS * fine, COLUMNS * fine)
    mass = (c.eval(w)[1].astype(float) * solid_angle).reshape(ROWS, fine, COLUMNS, fine)
    expected = mass.sum(axis=(1, 3)).ravel() * HAIR_SAMPLES
    d = drawn["direction"][drawn["pdf"] > 0.0]
    row = np.clip(((np.arcsin(np.clip(d[:, 0], -1.0, 1.0)) / np.pi + 0.5) * ROWS).astype(int), 0, ROWS - 1)
    column = (np.arctan2(d[:, 2], d[:, 1]) / (2.0 * np.pi) % 1.0 * COLUMNS).astype(int) % COLUMNS
    observed = np.bincount(row * COLUMNS + column, minlength=ROWS * COLUMNS)
    expected = np.append(expected, max(HAIR_SAMPLES - expected.sum(), 0.0))  # draws that found no direction
    observed = np.append(observed, HAIR_SAMPLES - observed.sum())
    order = np.argsort(expected)
    expected, observed = expected[order], observed[order]
    small = int(np.searchsorted(expected, 10.0))
    expected = np.append(expected[small:], expected[:small].sum())
    observed = np.append(observed[small:], observed[:small].sum())
    slack = 0.01 * expected + 0.004 * HAIR_SAMPLES / len(expected)  # of the midpoint rule
    chi2 = float((np.maximum(np.abs(observed - expected) - slack, 0.0) ** 2 / np.maximum(expected, 1.0)).sum())
    assert stats.chi2.sf(chi2, len(expected) - 1) > 0.01 / 20, (chi2, len(expected))


@pytest.mark.parametrize("name", HAIRS)
def test_41_sampling_and_evaluation_of_hair_agree(name: str) -> None:
    node, inputs = HAIRS[name]
    c = core.bsdf.Closures(node, inputs, **view(20.0, 40.0))
    drawn = c.sample(np.random.default_rng(8).random((3000, 3), dtype=np.float32))
    kept = drawn["pdf"] > 1e-3
    light, pdf = c.eval(drawn["direction"][kept])
    assert np.quantile(np.abs(pdf / drawn["pdf"][kept] - 1.0), 0.98) < 5e-3
    assert np.quantile(np.abs(light.sum(axis=1) / pdf[:, None] - drawn["throughput"][kept]), 0.98) < 5e-3
