"""Files that other people made: each opens, and renders or names what it lacks; none crashes or turns NaN."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "scenes" / "compatibility"
INDEX = json.loads((FOLDER / "index.json").read_text()) if (FOLDER / "index.json").exists() else []


def test_compatibility_files_are_beside_the_checkout_or_said_to_be_missing() -> None:
    if not INDEX:
        pytest.skip(f"no compatibility files at {FOLDER}: they are not part of the repository")
    assert len(INDEX) == 32


@pytest.mark.parametrize("entry", INDEX, ids=lambda entry: str(entry["file"]))
def test_file_opens_and_renders_finite(entry: dict[str, object], render: Callable[..., NDArray[np.float32]]) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / str(entry["file"])))
    scene = bpy.context.scene
    scene.render.use_border = False
    picture = render("LUCH", width=48, height=32, samples=4)
    assert picture.shape == (32, 48, 4)
    assert np.isfinite(picture).all()
    # What is black in Cycles may be black here; what is lit there must not be black.
    if float(str(entry["cycles_mean_at_4spp"])) > 0.01:
        assert picture[..., :3].mean() > 1e-4, "a lit file came out black"
