"""Renders of other samples merge into the render of all of them; two halves hold a claimed error to account."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch import merge, verify
from luch.cli import main
from luch.image import read_exr
from luch.render import render
from luch.scene import Camera, Film, Light, Scene
from luch.scenefile import write_scene
from support import effects

WHOLE = 96


def shot(scene: Scene, **settings: Any) -> Any:
    asked = {"samples": WHOLE, "threads": 1, "accelerator": "BVH", "mergeable": True, "samples_in_all": WHOLE}
    return render(replace(scene, settings=replace(scene.settings, **{**asked, **settings})))


@pytest.fixture
def scene() -> Scene:
    """A triangle under an area lamp, out of focus."""
    lamp = Light("Panel", "AREA", matrix=np.array([[1.0, 0, 0, 0.3], [0, 1.0, 0, 0.3], [0, 0, 1.0, 3.0]]), power=60.0)
    camera = Camera(matrix=np.array([[1.0, 0, 0, 0.4], [0, 1.0, 0, 0.4], [0, 0, 1.0, 3.0]]), use_dof=True)
    camera.focus_distance, camera.fstop = 2.0, 0.5
    found = effects.scene(effects.principled, lights=[lamp], camera=camera, film=Film(width=24, height=16))
    found.film.passes = ["Combined", "Depth", "Normal", "Diffuse Direct", "Sample Count"]
    return found


@pytest.mark.parametrize("cuts", [[32], [10, 50, 77], [64], [33, 34]])
def test_parts_of_one_sequence_merge_into_it(scene: Scene, cuts: list[int]) -> None:
    whole = shot(scene).sums
    ends = [0, *cuts, WHOLE]
    parts = [shot(scene, first_sample=start, samples=end - start).sums for start, end in itertools.pairwise(ends)]
    merged = merge.merge(parts[::-1])
    one, other = whole.native(), merged.native()
    for name, picture in one.resolve().items():
        assert np.array_equal(picture, other.resolve()[name]), name
    for ours, theirs in zip(one.deviations(), other.deviations(), strict=True):
        assert np.array_equal(ours, theirs)
    assert merged.samples == WHOLE and not merged.independent
    assert merged.estimate().error == pytest.approx(whole.estimate().error, rel=0.1)  # rates fitted apart


def test_other_seeds_merge_into_parts_that_owe_each_other_nothing(scene: Scene) -> None:
    parts = [shot(scene, seed=seed, samples=32, samples_in_all=0).sums for seed in (1, 2, 3)]
    merged = merge.merge(parts)
    pictures = [part.native().resolve()["Combined"] for part in parts]
    np.testing.assert_allclose(merged.native().resolve()["Combined"], np.mean(pictures, axis=0), rtol=1e-5, atol=1e-6)
    assert merged.independent and merged.samples == 96
    assert merged.native().deviations()[2] == pytest.approx(1 / 3)


def test_what_does_not_belong_together_is_told(scene: Scene) -> None:
    one = shot(scene, samples=8).sums
    with pytest.raises(
        merge.MergeError, match=r"both hold sample 4 of seed 0, which would count twice.*--first-sample 8"
    ):
        merge.merge([one, shot(scene, first_sample=4, samples=8).sums])
    scene.film.passes = ["Combined"]
    with pytest.raises(merge.MergeError, match="their films differ"):
        merge.merge([one, shot(scene, first_sample=8, samples=8).sums])


def test_files_merge_from_the_command_line(scene: Scene, tmp_path: Path) -> None:
    write_scene(scene, tmp_path / "room.luch")
    common = ["render", str(tmp_path / "room.luch"), "--mergeable", "--quiet", "--samples-in-all", "48"]
    assert main([*common, "--samples", "48", "-o", str(tmp_path / "all.exr")]) == 0
    assert main([*common, "--samples", "20", "-o", str(tmp_path / "a.exr")]) == 0
    assert main([*common, "--samples", "28", "--first-sample", "20", "-o", str(tmp_path / "b.exr")]) == 0
    assert main(["merge", *(str(tmp_path / name) for name in ("a.exr", "b.exr")), "-o", str(tmp_path / "c.exr")]) == 0
    (whole, _), (merged, header) = read_exr(tmp_path / "all.exr"), read_exr(tmp_path / "c.exr")
    for name in ("Combined", "Depth", "Normal", "Sample Count"):
        assert np.array_equal(whole[f"ViewLayer.{name}"], merged[f"ViewLayer.{name}"]), name
    assert header["luch.samples"] == 48 and header["luch.stopped_by"] == "merged" and header["luch.error"] > 0.0
    assert merged["ViewLayer.Error"].shape == (*merged["ViewLayer.Combined"].shape[:2], 3)
    assert main(["merge", str(tmp_path / "c.exr"), "-o", str(tmp_path / "d.exr")]) == 1, "c holds no sums"


def test_two_halves_verify_what_is_claimed(scene: Scene, tmp_path: Path) -> None:
    result = shot(scene, samples=64, verify=True, mergeable=False)
    found = result.stats["verified"]
    assert found["holds"] and found["ratio_low"] < found["ratio"] < found["ratio_high"]
    assert result.stats["samples"] == 64 and (result.passes["Sample Count"] == 64).all() and result.sums is None
    write_scene(scene, tmp_path / "room.luch")
    arguments = ["--verify", "--samples", "16", "--json", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.exr")]
    assert main(["render", str(tmp_path / "room.luch"), "--quiet", *arguments]) == 0
    told = json.loads((tmp_path / "a.json").read_text())
    assert told["verified"]["holds"] in (True, False) and told["stopped_by"] == "samples"


def test_a_false_claim_does_not_hold() -> None:
    claim = {"error": 0.02, "error_low": 0.019, "error_high": 0.021}
    whole = 0.02 / np.sqrt(2)
    seen = {"error": whole, "error_low": 0.95 * whole, "error_high": 1.05 * whole}
    assert verify.verdict([claim, claim], seen)["holds"]
    assert not verify.verdict([{**claim, "error": 0.01, "error_low": 0.0095, "error_high": 0.0105}] * 2, seen)["holds"]
