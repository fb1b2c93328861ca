"""The dial: each step reaches its error, by settings that pay on the scene; denoising as an option of a render."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch import denoise, quality, record
from luch._native import core
from luch.identity import identity_of
from luch.render import render
from luch.report.files import write
from luch.report.plan import AS_SET, EXACT
from luch.report.results import Point, Report, Row
from luch.report.tally import Measured, NoiseLine
from luch.scene import Scene
from luch.stopping import CUSTOM, STEPS, UNLIMITED_SAMPLES
from support.everything import everything


def row(name: str, noise: float, cost: float = 1.0, bias: float = 0.0, **fields: Any) -> Row:
    """noise: of one sample. A sample takes 1 s times cost."""
    settings = fields.pop("settings", {})
    return Row(name, "Settings", "", bias > 0.0, "", settings, 3, 16, 0.0, cost, cost, cost, cost,
               [Point(16, 16.0 * cost, noise / 4.0, noise / 4.0)], NoiseLine(noise**2, 1.0),
               Measured(bias**2, 0.01 * bias**2), 0.0, 0.0, **fields)  # fmt: skip


def report(*rows: Row) -> Report:
    return Report("s", 10, 10, 10, 10, 64, "CPU", 60.0, 59.0, 1024, 0.001, list(rows), AS_SET)


EXACT_ROW = row(EXACT, 1.0, 1.2, settings={"clamp_indirect": 0.0})


def test_the_choice_that_reaches_the_error_soonest_is_taken() -> None:
    rows = [EXACT_ROW, row(AS_SET, 1.0), row("no light tree", 0.5, 1.1, settings={"light_tree": False})]
    choice = quality.choose(report(*rows), "GOOD")
    assert choice.name == "no light tree" and choice.settings["light_tree"] is False
    assert choice.settings["error_limit"] == STEPS["GOOD"]
    assert choice.seconds == pytest.approx(100.0 * 1.1)


def test_a_gain_that_is_small_is_not_worth_other_settings() -> None:
    rows = [EXACT_ROW, row(AS_SET, 1.0), row("no light tree", 0.97, settings={"light_tree": False})]
    assert quality.choose(report(*rows), "GOOD").name == AS_SET


def test_bias_is_allowed_as_far_as_the_error_bears_it_and_noise_makes_room() -> None:
    rows = [EXACT_ROW, row(AS_SET, 1.0), row("clamp", 0.3, bias=0.03, settings={"clamp_indirect": 1.0})]
    choice = quality.choose(report(*rows), "GOOD")
    assert choice.name == "clamp"
    assert math.hypot(choice.settings["error_limit"], rows[2].floor.high) == pytest.approx(STEPS["GOOD"])
    assert quality.choose(report(*rows), "HIGH").name == AS_SET  # 2 % cannot hold 3 %


def test_a_scene_whose_settings_forbid_the_error_gets_those_that_take_nothing() -> None:
    biased = row(AS_SET, 0.2, bias=0.1)
    choice = quality.choose(report(EXACT_ROW, biased), "HIGH")
    assert choice.settings["clamp_indirect"] == 0.0


def test_a_reference_takes_nothing_from_the_light() -> None:
    rows = [EXACT_ROW, row(AS_SET, 1.0), row("clamp", 0.1, bias=1e-4, settings={"clamp_indirect": 1.0})]
    choice = quality.choose(report(*rows), "REFERENCE")
    assert choice.name == EXACT and choice.settings["clamp_indirect"] == 0.0


def test_denoising_is_chosen_only_where_its_error_was_measured() -> None:
    filtered = row("denoised", 0.2, denoised=True)
    choice = quality.choose(report(EXACT_ROW, row(AS_SET, 1.0), filtered), "PREVIEW")
    assert choice.settings == {"denoise": True, "samples": 5, "error_limit": 0.0}
    assert quality.choose(report(EXACT_ROW, row(AS_SET, 1.0), filtered), "HIGH").name == AS_SET  # 100 samples


def small(**settings: Any) -> Scene:
    scene = everything(**settings)
    scene.camera.use_dof = False
    scene.settings.samples = 16
    return scene


def test_a_step_ends_the_render_at_its_error_and_says_so() -> None:
    result = render(small(quality="PREVIEW"))
    told = result.stats["quality"]
    assert told["step"] == "PREVIEW" and told["pilot_seconds"] < 5.0
    assert result.stats["error"] <= STEPS["PREVIEW"] or told["settings"].get("denoise")
    assert "Preview: 10 % by" in told["reason"] and "10 % by" in record.line(result.stats)


def test_custom_leaves_the_settings_alone() -> None:
    with_dial, without = render(small(quality=CUSTOM)), render(small())
    assert "quality" not in with_dial.stats and with_dial.stats["samples"] == 16
    assert np.array_equal(with_dial.passes["Combined"], without.passes["Combined"])


def test_a_report_decides_instead_of_a_pilot(tmp_path: Path) -> None:
    kept = report(EXACT_ROW, row(AS_SET, 1.0), row("4 bounces", 0.1, settings={"max_bounces": 4}))
    scene = small(quality="DRAFT", quality_report=str(tmp_path / "report.json"))
    kept.identity = identity_of(scene)
    write(kept, {}, tmp_path)
    result = render(scene)
    assert result.stats["quality"]["choice"] == "4 bounces"
    with pytest.raises(ValueError, match="nowhere"):
        render(replace(scene, settings=replace(scene.settings, quality_report="nowhere.json")))


@pytest.mark.parametrize("identity", ["", "0123456789abcdef"])
def test_a_report_of_another_scene_is_told_and_a_pilot_chooses(tmp_path: Path, identity: str) -> None:
    kept = report(EXACT_ROW, row(AS_SET, 1.0), row("4 bounces", 0.1, settings={"max_bounces": 4}))
    kept.identity = identity
    write(kept, {}, tmp_path)
    result = render(small(quality="DRAFT", quality_report=str(tmp_path / "report.json")))
    told = [text for text in result.stats["warnings"] if "report" in text]
    assert len(told) == 1 and "a pilot chose" in told[0] and ("another scene" in told[0]) == bool(identity)
    assert result.stats["quality"]["pilot_seconds"] > 0.1 and result.stats["error"] < 0.2


def test_a_scene_stays_the_same_in_other_frames_sizes_and_settings() -> None:
    scene, other = small(), small(max_bounces=2, quality="GOOD")
    other.film.width, other.frame = 64, 7
    other.lights[0].power *= 2.0
    assert other.instances is not None
    other.instances.matrix[0, 2, 3] += 0.5
    assert identity_of(scene) == identity_of(other)
    other.materials[0].surface = other.materials[1].surface
    assert identity_of(scene) != identity_of(other)
    renamed = small()
    renamed.lights[0].name = "Moon"
    assert identity_of(scene) != identity_of(renamed)


def test_a_step_that_there_is_not_is_told() -> None:
    with pytest.raises(ValueError, match=r"SUPERB.*DRAFT"):
        render(small(quality="SUPERB"))


@pytest.mark.parametrize(
    ("foretold", "looks"),
    [((200.0, 30.0), [0.4, 1.6]), ((200.0,) * 4, [0.4, 1.6, 6.4, 11.6]), ((3.9,), [0.4]), ((np.inf,) * 4, [0.4, 1.6, 6.4, 21.6])],
)  # fmt: skip
def test_a_pilot_grows_as_long_as_what_it_foretells_is_worth_it(
    foretold: tuple[float, ...], looks: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A look of a second foretold 214 s of a render of 29; a tenth of that was a pilot of 22 s."""
    taken: list[float] = []

    class Look:
        cancelled = False

        def __init__(self, scene: Scene, seconds: float, *_: object, **__: object) -> None:
            taken.append(seconds)

        def run(self) -> float:
            return foretold[len(taken) - 1]

    monkeypatch.setattr(quality, "Session", Look)
    monkeypatch.setattr(quality, "choose", lambda told, step: quality.Choice("as set", seconds=told))
    assert quality.pilot(small(), "GOOD").seconds == foretold[-1]
    assert taken == pytest.approx(looks)


def test_cancelling_the_pilot_ends_the_render() -> None:
    result = render(small(quality="HIGH"), progress=lambda progress: False)
    assert result.cancelled


def test_the_dial_keeps_to_a_time_limit() -> None:
    result = render(small(quality="REFERENCE", time_limit=1.5))
    assert result.stats["total_seconds"] < 3.0
    assert result.stats["samples_asked"] == UNLIMITED_SAMPLES


def test_a_denoised_render_differs_in_combined_alone() -> None:
    plain, clean = render(small()), render(small(denoise=True))
    assert not np.array_equal(plain.passes["Combined"], clean.passes["Combined"])
    assert set(plain.passes) == set(clean.passes)
    assert clean.stats["denoised"] and clean.stats["error"] == pytest.approx(plain.stats["error"], rel=0.2)
    assert "the error is that of the picture before" in record.line(clean.stats)


def test_without_the_library_the_render_goes_on_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise ImportError("Open Image Denoise is not here")

    monkeypatch.setattr(denoise, "library", missing)
    result = render(small(denoise=True))
    assert np.array_equal(result.passes["Combined"], render(small()).passes["Combined"])
    assert result.stats["warnings"] == ["The picture is not denoised: Open Image Denoise is not here."]


def test_what_a_pilot_builds_serves_the_render(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of its renders built anew: in a scene of 439,000 triangles a pilot took 8 s of 27."""
    made: list[object] = []
    real = core.render.Renderer
    monkeypatch.setattr(core.render, "Renderer", lambda *given: made.append(given) or real(*given))
    scene = small()
    scene.settings = replace(scene.settings, quality="DRAFT")
    result = render(scene)
    assert result.stats["quality"]["pilot_seconds"] > 0.0 and result.stats["reused"]
    assert len(made) == 1 and result.stats["stopped_by"] == "error"
