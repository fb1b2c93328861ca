"""What settings took from the light is counted and told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import ledger
from luch.render import Result, render
from luch.scene import Camera, Film, Instances, Light, Material, Mesh, Object, Scene
from support import effects

ALBEDO = 0.6


def closed_box() -> Scene:
    """The camera within a cube of one grey."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([half for a, b, c, d in quads for half in ((a, b, c), (a, c, d))], np.uint32)
    mesh = Mesh("Box", corners, triangles, np.zeros(12, np.uint16))
    one = Instances(np.zeros(1, np.uint32), np.eye(3, 4)[None], np.zeros(1, np.float32), np.zeros((1, 3), np.float32),
                    np.zeros((1, 2), np.float32))  # fmt: skip
    grey = effects.program(lambda builder: effects.closure(builder, "CLOSURE_DIFFUSE", {"color": (ALBEDO,) * 3}))
    lamp = Light("Bulb", "POINT", matrix=np.array([[1.0, 0, 0, 0.3], [0, 1.0, 0, 0.2], [0, 0, 1.0, 0.9]]), power=30.0)
    return Scene(
        meshes=[mesh], objects=[Object("Box", 0, [0])], instances=one, materials=[Material("Grey", grey)],
        lights=[lamp], camera=Camera(clip_start=0.01), film=Film(width=16, height=16),
    )  # fmt: skip


def shot(scene: Scene, **settings: Any) -> Result:
    asked = {"samples": 256, "threads": 2, "accelerator": "BVH", **settings}
    return render(replace(scene, settings=replace(scene.settings, **asked)))


def test_clamped_light_is_what_is_missing() -> None:
    scene = closed_box()
    whole, clamped = (shot(scene, clamp_direct=limit, clamp_indirect=limit) for limit in (0.0, 2.0))
    missing = 1.0 - clamped.passes["Combined"][..., :3].mean() / whole.passes["Combined"][..., :3].mean()
    assert missing > 0.02
    assert clamped.stats["clamped_share"] == pytest.approx(missing, rel=1e-3)
    assert whole.stats["clamped_share"] == 0.0 and whole.stats["refused_share"] == 0.0
    assert f"Clamping took {100 * missing:.2g}" in ledger.lines(clamped.stats)[0]


def test_limits_of_bounces_tell_what_the_paths_they_ended_carried() -> None:
    scene = closed_box()
    few, more = (shot(scene, max_bounces=n, diffuse_bounces=n).stats["cut_share_estimate"] for n in (2, 3))
    assert few == pytest.approx(ALBEDO**3, rel=0.03) and more == pytest.approx(ALBEDO**4, rel=0.03)
    many = shot(scene, max_bounces=40, diffuse_bounces=40).stats
    assert many["cut_share_estimate"] < 1e-6 and ledger.lines(many) == []


def test_what_is_taken_does_not_depend_on_threads() -> None:
    stats = [shot(closed_box(), samples=16, clamp_indirect=1.0, threads=threads).stats for threads in (1, 3)]
    for name in ("clamped_units", "cut_units"):
        assert stats[0][name] == stats[1][name] > 0
