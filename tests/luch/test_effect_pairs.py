"""Any two effects, together and apart: what is spared for a scene's sake changes no bit of its picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from luch.effects import effects_of
from luch.render import render
from support.combinations import EFFECTS, covering_rows, scene_of

ROWS = covering_rows()
# Of combinations -> luch.effects, where one stands for the other.
TABLE = {
    "coat": "coat", "transparency": "transparency", "sheen": "sheen", "emissive mesh": "emissive meshes",
    "depth of field": "depth of field", "area lamp": "area lamps", "clamping": "clamping",
    "filter glossy": "filter glossy", "holdout": "holdout",
    "hair": "hair", "hair shading": "hair shading", "point cloud": "point clouds", "subsurface": "subsurface",
    "volume": "volumes", "moving object": "object motion", "moving camera": "camera motion",
}  # fmt: skip


def test_the_rows_show_every_pair_in_all_four_ways() -> None:
    for a in EFFECTS:
        for b in EFFECTS:
            assert a == b or {(a in row, b in row) for row in ROWS} == {(x, y) for x in (0, 1) for y in (0, 1)}
    assert len(ROWS) < 25


@pytest.mark.parametrize("effects", ROWS, ids=lambda row: f"{len(row)} of {len(EFFECTS)}")
def test_a_scene_draws_the_same_with_everything_simulated(effects: tuple[str, ...]) -> None:
    scene = scene_of(effects)
    lean = render(scene)
    full = render(replace(scene, settings=replace(scene.settings, force_effects=["ALL"])))
    assert set(lean.passes) == set(full.passes)
    table = effects_of(scene)
    missing = {name for name, told in TABLE.items() if (name in effects) != table[told].on}
    assert not missing, "the table of effects sees what the row has, and no more"
    for name, image in lean.passes.items():
        assert np.array_equal(image.view(np.uint32), full.passes[name].view(np.uint32)), name
    assert lean.passes["Combined"][..., :3].max() > 0.01
    assert np.isfinite(lean.passes["Combined"]).all()
