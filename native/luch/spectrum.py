"""Colours from spectra: the CIE 1931 observer, black bodies, single wavelengths. Scene-linear Rec.709."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

# XYZ (D65 white) to linear Rec.709; IEC 61966-2-1 with the digits that renderers share.
XYZ_TO_REC709: F64 = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)

FIRST_NM, STEP_NM = 380, 5
# CIE 1931 2-degree colour matching functions at 380, 385, ... 780 nm, in ten-thousandths (CIE 015).
_X = (
    "14 22 42 76 143 232 435 776 1344 2148 2839 3285 3483 3481 3362 3187 2908 2511 1954 1421 956 580 320 147 49 24 93"
    " 291 633 1096 1655 2257 2904 3597 4334 5121 5945 6784 7621 8425 9163 9786 10263 10567 10622 10456 10026 9384 8544"
    " 7514 6424 5419 4479 3608 2835 2187 1649 1212 874 636 468 329 227 158 114 81 58 41 29 20 14 10 7 5 3 2 2 1 1 1 0"
)
_Y = (
    "0 1 1 2 4 6 12 22 40 73 116 168 230 298 380 480 600 739 910 1126 1390 1693 2080 2586 3230 4073 5030 6082 7100 7932"
    " 8620 9149 9540 9803 9950 10000 9950 9786 9520 9154 8700 8163 7570 6949 6310 5668 5030 4412 3810 3210 2650 2170"
    " 1750 1382 1070 816 610 446 320 232 170 119 82 57 41 29 21 15 10 7 5 4 2 2 1 1 1 0 0 0 0"
)
_Z = (
    "65 105 201 362 679 1102 2074 3713 6456 10391 13856 16230 17471 17826 17721 17441 16692 15281 12876 10419 8130 6162"
    " 4652 3533 2720 2123 1582 1117 782 573 422 298 203 134 87 57 39 27 21 18 17 14 11 10 8 6 3 2 2 1 0 0 0 0 0 0 0 0 0"
    " 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0"
)
OBSERVER: F64 = np.array([[int(word) for word in row.split()] for row in (_X, _Y, _Z)]).T * 1e-4  # (81, 3)

COLDEST_K, HOTTEST_K = 800.0, 12000.0
TABLE_STEPS = 512
_SECOND_RADIATION_CONSTANT = 1.4388e-2  # m K


def blackbody(temperature_k: float | F64) -> F64:
    """Colour of black bodies, luminance 1; not clamped to the gamut. (N,) or a number -> (N, 3) or (3,).

    Below 800 K and above 12000 K the colour at that end, as in Blender.
    """
    kelvin = np.clip(np.asarray(temperature_k, np.float64), COLDEST_K, HOTTEST_K)[..., None]
    metres = (FIRST_NM + STEP_NM * np.arange(len(OBSERVER))) * 1e-9
    radiance = metres**-5.0 / np.expm1(_SECOND_RADIATION_CONSTANT / (metres * kelvin))
    xyz = radiance @ OBSERVER
    return np.asarray((xyz @ XYZ_TO_REC709.T) / xyz[..., 1:2])


def blackbody_table() -> F32:
    """What operation BLACKBODY interpolates: (512, 3), even steps of 1/T from 12000 K to 800 K."""
    inverse = np.linspace(1.0 / HOTTEST_K, 1.0 / COLDEST_K, TABLE_STEPS)
    return np.asarray(blackbody(1.0 / inverse), np.float32)


def wavelength_table() -> F32:
    """What operation WAVELENGTH interpolates: (81, 3) from 380 nm by 5 nm, scaled so that none exceeds 1."""
    return np.asarray(OBSERVER @ XYZ_TO_REC709.T / 2.52, np.float32)
