"""Computes the directional albedos that closures compensate with, and writes luch/bsdf/tables.h.

Run by hand after a change of the microfacet model: python native/tools/make_albedo_tables.py

Every entry is a mean over samples of the distribution of visible normals (Dupuy and Benyoub 2023),
whose weight is the masking-shadowing ratio G2 / G1 times the Fresnel factor; the samples are one
rank-1 lattice. Axes, fastest first: roughness (square root of alpha), cosine to the normal, and
z = F0^(1/4), which spans every index of refraction and is finest around glass.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

OUT = Path(__file__).parents[1] / "include" / "luch" / "bsdf" / "tables.h"
MIN_AXIS = 1e-4  # the axes' ends that have no finite model are taken just inside


def lattice(count: int) -> tuple[Array, Array]:
    """Rank-1 lattice of `count` points of the unit square (Roberts' R2 constants)."""
    i = np.arange(count) + 0.5
    return (i * 0.7548776662466927) % 1.0, (i * 0.5698402909980532) % 1.0


def axis(size: int) -> Array:
    """Sample positions of a table axis."""
    return np.clip(np.linspace(0.0, 1.0, size), MIN_AXIS, 1.0)


def ior_of_z(z: float) -> float:
    """Inverse of z = F0^(1/4); F0 stops at 0.99 as wherever an IOR is found from F0."""
    root = np.sqrt(min(np.clip(z, 1e-3, 0.999) ** 4, 0.99))
    return float((1.0 + root) / (1.0 - root))


def smith_lambda(alpha: float, cosine: Array) -> Array:
    """Smith's lambda for GGX; a zero cosine gives infinity."""
    with np.errstate(divide="ignore"):
        return 0.5 * (np.sqrt(1.0 + alpha**2 * np.maximum(1.0 / cosine**2 - 1.0, 0.0)) - 1.0)


def visible_normals(alpha: float, mu: float, u: tuple[Array, Array]) -> tuple[Array, Array, Array]:
    """Normals seen from (sqrt(1 - mu^2), 0, mu): their x, z and cosine to that direction."""
    sin_i = np.sqrt(1.0 - mu * mu)
    length = np.hypot(alpha * sin_i, mu)
    sx, sz = alpha * sin_i / length, mu / length
    phi = np.pi * u[0]  # the other half of the circle is its mirror image
    z = (1.0 - u[1]) * (1.0 + sz) - sz
    sin_t = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
    hx, hy, hz = alpha * (sin_t * np.cos(phi) + sx), alpha * sin_t * np.sin(phi), np.maximum(z + sz, 0.0)
    norm = np.sqrt(hx**2 + hy**2 + hz**2)
    hx, hz = hx / norm, hz / norm
    return hx, hz, hx * sin_i + hz * mu


def dielectric(cosine: Array, eta: float) -> tuple[Array, Array]:
    """Fresnel reflectance of an unpolarised ray and the cosine (positive) of the refracted one."""
    t2 = (eta - 1.0) * (eta + 1.0) + cosine**2
    t = np.sqrt(np.maximum(t2, 0.0))  # eta times the cosine of the refracted ray
    with np.errstate(divide="ignore", invalid="ignore"):
        r_s = (cosine - t) / (cosine + t)
        r_p = (t / eta - eta * cosine) / (t / eta + eta * cosine)
    return np.where(t2 > 0.0, 0.5 * (r_s**2 + r_p**2), 1.0), t / eta


def reflection_weight(alpha: float, mu: float, hz: Array, hi: Array) -> Array:
    """G2 / G1 of the mirrored direction, 0 below the horizon."""
    cos_o = 2.0 * hi * hz - mu
    lambda_i = smith_lambda(alpha, np.array(mu))
    above = cos_o > 0.0
    lambda_o = smith_lambda(alpha, np.where(above, cos_o, 1.0))
    return np.where(above, (1.0 + lambda_i) / (1.0 + lambda_i + lambda_o), 0.0)


def albedo_reflection(rough: float, mu: float, u: tuple[Array, Array]) -> float:
    """Directional albedo of a white GGX reflection."""
    alpha = rough * rough
    _, hz, hi = visible_normals(alpha, mu, u)
    return float(np.mean(reflection_weight(alpha, mu, hz, hi)))


def albedo_glass(rough: float, mu: float, eta: float, u: tuple[Array, Array]) -> float:
    """Directional albedo of a white GGX dielectric, reflection and refraction together."""
    alpha = rough * rough
    _, hz, hi = visible_normals(alpha, mu, u)
    fresnel, cos_t = dielectric(hi, eta)
    reflected = fresnel * reflection_weight(alpha, mu, hz, hi)
    cos_o = (hi / eta - cos_t) * hz - mu / eta  # below the surface: negative
    below = cos_o < 0.0
    lambda_i = smith_lambda(alpha, np.array(mu))
    lambda_o = smith_lambda(alpha, np.where(below, cos_o, 1.0))
    refracted = (1.0 - fresnel) * np.where(below, (1.0 + lambda_i) / (1.0 + lambda_i + lambda_o), 0.0)
    return float(np.mean(reflected + refracted))


def schlick_dielectric(rough: float, mu: float, eta: float, u: tuple[Array, Array]) -> float:
    """Mean position of the reflectance between F0 and 1 over the visible normals that reflect upwards."""
    alpha = rough * rough
    _, hz, hi = visible_normals(alpha, mu, u)
    f0 = ((eta - 1.0) / (eta + 1.0)) ** 2
    s = np.clip((dielectric(hi, eta)[0] - f0) / (1.0 - f0), 0.0, 1.0)
    return float(np.mean(np.where(2.0 * hi * hz - mu > 0.0, s, 0.0)))


def schlick_power(rough: float, mu: float, exponent: float, u: tuple[Array, Array]) -> float:
    """As schlick_dielectric, for Schlick's (1 - cos)^exponent."""
    _, hz, hi = visible_normals(rough * rough, mu, u)
    return float(np.mean(np.where(2.0 * hi * hz - mu > 0.0, (1.0 - hi) ** exponent, 0.0)))


def mean_over_hemisphere(albedo: Callable[[float], float]) -> float:
    """Integral of 2 mu albedo(mu) over mu in 0..1 by Gauss-Legendre."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    mus, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    return float(sum(2.0 * m * albedo(m) * w for m, w in zip(mus, weights, strict=True)))


def declaration(name: str, comment: str, values: list[float]) -> str:
    """One constant array, twelve numbers a line."""
    words = [f"{v if abs(v) > 1e-9 else 0.0:.6g}" for v in values]
    words = [(w if any(c in w for c in ".e") else w + ".0") + "f" for w in words]
    lines = [", ".join(words[i : i + 12]) for i in range(0, len(words), 12)]
    body = ",\n    ".join(lines)
    return f"// {comment}\nLUCH_CONST float {name}[{len(words)}] = {{\n    {body}}};\n"


def main() -> None:
    fine, coarse = lattice(1 << 15), lattice(1 << 13)
    r32, r16 = axis(32), axis(16)
    iors = [ior_of_z(z) for z in axis(16)]
    parts = [
        declaration("GGX_ALBEDO", "[mu 32][roughness 32]", [albedo_reflection(r, m, fine) for m in r32 for r in r32]),
        declaration(
            "GGX_MEAN_ALBEDO",
            "[roughness 32]",
            [mean_over_hemisphere(lambda m, r=r: albedo_reflection(r, m, fine)) for r in r32],
        ),
    ]
    for name, etas in (("GLASS", iors), ("GLASS_INSIDE", [1.0 / e for e in iors])):
        parts.append(
            declaration(
                f"{name}_ALBEDO",
                "[z 16][mu 16][roughness 16]",
                [albedo_glass(r, m, e, coarse) for e in etas for m in r16 for r in r16],
            )
        )
        parts.append(
            declaration(
                f"{name}_MEAN_ALBEDO",
                "[z 16][roughness 16]",
                [mean_over_hemisphere(lambda m, r=r, e=e: albedo_glass(r, m, e, coarse)) for e in etas for r in r16],
            )
        )
    parts.append(
        declaration(
            "SCHLICK_DIELECTRIC",
            "[z 16][mu 16][roughness 16]: mean place of the dielectric reflectance between F0 and 1",
            [schlick_dielectric(r, m, e, coarse) for e in iors for m in r16 for r in r16],
        )
    )
    # Metals ask for Schlick's own exponent, 5, at z = 1/2 of an axis 5 (1 - z) / z: between two entries.
    exponents = [5.0 * (1.0 - z) / z for z in (7 / 15, 8 / 15)]
    parts.append(
        declaration(
            "SCHLICK_FIFTH",
            "[mu 16][roughness 16]: the same for (1 - cos)^5",
            [float(np.mean([schlick_power(r, m, e, coarse) for e in exponents])) for m in r16 for r in r16],
        )
    )
    head = (
        "// Directional albedos of the microfacet lobes. Written by native/tools/make_albedo_tables.py; do not edit.\n"
        '#pragma once\n#include "luch/platform.h"\n\nnamespace luch {\n\n// clang-format off\n'
    )
    OUT.write_text(head + "\n".join(parts) + "// clang-format on\n\n}  // namespace luch\n")


if __name__ == "__main__":
    main()
