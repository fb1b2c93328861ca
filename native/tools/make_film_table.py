"""Computes how each colour channel sees interference, and writes luch/bsdf/film_table.h.

Run by hand: python native/tools/make_film_table.py

A wave whose path is longer by d lags by 2 pi d / wavelength. A channel integrates it over the
wavelengths it is sensitive to: S(d) = sum_w rgb(w) exp(-i 2 pi d / w) / sum_w rgb(w), so that S(0) = 1.
rgb(w) are the CIE 1931 colour matching functions (2 degrees) in linear Rec.709 with its white point;
they are read, in steps of 5 nm, from the copy that the `bpy` package carries.
"""

import re
from pathlib import Path

import bpy
import numpy as np

OUT = Path(__file__).parents[1] / "include" / "luch" / "bsdf" / "film_table.h"
SIZE = 512
LONGEST_NM = 60000.0 / (2.0 * np.pi)
XYZ_TO_REC709 = np.array(
    [[3.2409699, -1.5373832, -0.4986108], [-0.9692436, 1.8759675, 0.0415551], [0.0556301, -0.2039770, 1.0569715]]
)


def colour_matching() -> np.ndarray:
    """CIE 1931 x, y, z at 380, 385, ... 780 nm: (81, 3)."""
    source = Path(bpy.utils.resource_path("LOCAL")) / "scripts/addons_core/cycles/source/kernel/tables.h"
    text = source.read_text()
    block = text[text.index("cie_color_match") :]
    rows = re.findall(r"\{\s*([\d.]+)f?,\s*([\d.]+)f?,\s*([\d.]+)f?\s*\}", block)[:81]
    return np.array(rows, dtype=float)


def main() -> None:
    rgb = colour_matching() @ XYZ_TO_REC709.T
    nm = 380.0 + 5.0 * np.arange(81)
    fine = np.linspace(380.0, 780.0, 4001)
    rgb = np.stack([np.interp(fine, nm, rgb[:, i]) for i in range(3)], axis=1)
    path = np.linspace(0.0, LONGEST_NM, SIZE)
    wave = np.exp(-2j * np.pi * path[:, None] / fine[None, :])
    seen = wave @ rgb / rgb.sum(axis=0)
    words = [f"{v:.6g}" for i in range(3) for part in (seen[:, i].real, seen[:, i].imag) for v in part]
    words = [(w if any(c in w for c in ".e") else w + ".0") + "f" for w in words]
    body = ",\n    ".join(", ".join(words[i : i + 10]) for i in range(0, len(words), 10))
    OUT.write_text(
        "// Interference as the colour channels see it. Written by native/tools/make_film_table.py; do not edit.\n"
        '#pragma once\n#include "luch/platform.h"\n\nnamespace luch {\n\n'
        f"inline constexpr int FILM_TABLE_SIZE = {SIZE};\n"
        f"inline constexpr float FILM_TABLE_LONGEST_NM = {LONGEST_NM:.6f}f;\n"
        "// clang-format off\n"
        f"// [red, green, blue][real, imaginary][path difference]\nLUCH_CONST float FILM_SENSITIVITY[{len(words)}] = {{\n"
        f"    {body}}};\n// clang-format on\n\n}}  // namespace luch\n"
    )


if __name__ == "__main__":
    main()
