"""The dial: each step reaches its error, by settings that pay on the scene; denoising as an option of a render."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from luch import denoise, quality, record
from luch._native import core
from luch.identity import identity_of
from luch.render import Progress, render
from luch.report.files import write
from luch.report.plan import AS_SET, EXACT
from luch.report.results import Point, Report, Row
from luch.report.schedule import Cancelled
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
def test_a_report_of_another_scene_is_told_and_not_used(tmp_path: Path, identity: str) -> None:
    kept = report(EXACT_ROW, row(AS_SET, 1.0), row("4 bounces", 0.1, settings={"max_bounces": 4}))
    kept.identity = identity
    write(kept, {}, tmp_path)
    result = render(small(quality="DRAFT", quality_report=str(tmp_path / "report.json")))
    told = [text for text in result.stats["warnings"] if "report" in text]
    assert len(told) == 1 and "is not used" in told[0] and ("another scene" in told[0]) == bool(identity)
    assert result.stats["quality"]["choice"] == "as set" and result.stats["error"] < 0.2


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


class Pilot:
    """In the place of Session: its report is told, what it was asked for is kept."""

    asked: ClassVar[list[float]] = []
    found: ClassVar[Report | Exception] = LookupError()
    takes = 0.0  # seconds
    cancelled = False

    def __init__(self, scene: Scene, seconds: float, watch: Any, **_: object) -> None:
        self.asked.append(seconds)
        self._watch = watch

    def run(self) -> Report:
        time.sleep(self.takes)
        if self._watch is not None and not self._watch(None):
            self.cancelled = True
            raise Cancelled
        if isinstance(self.found, Exception):
            raise self.found
        return self.found


@pytest.fixture
def pilot(monkeypatch: pytest.MonkeyPatch) -> type[Pilot]:
    """Flown however short the render."""
    monkeypatch.setattr(quality, "Session", Pilot)
    monkeypatch.setattr(quality, "LEAST_PILOT", 0.0)
    monkeypatch.setattr(quality, "SEEN_SHARE", 0.0)
    monkeypatch.setattr(Pilot, "asked", [])
    monkeypatch.setattr(Pilot, "takes", 0.0)
    return Pilot


def test_a_short_render_flies_no_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    """It took 5 s where the picture as it is set took 2.5."""
    made: list[object] = []
    real = core.render.Renderer
    monkeypatch.setattr(core.render, "Renderer", lambda *given: made.append(given) or real(*given))
    stats = render(small(quality="PREVIEW")).stats
    assert stats["quality"]["pilot_seconds"] == 0.0 and stats["quality"]["choice"] == "as set"
    assert len(made) == 1 and stats["stopped_by"] == "error" and stats["error"] <= STEPS["PREVIEW"]


def test_a_long_render_flies_a_pilot_of_a_tenth_and_goes_on(pilot: type[Pilot]) -> None:
    """Nothing of the picture is lost, and the time of the pilot is not the picture's."""
    pilot.found, pilot.takes = report(EXACT_ROW, row(AS_SET, 1.0)), 0.7
    own = small(error_limit=STEPS["GOOD"])
    own.settings.samples = UNLIMITED_SAMPLES
    plain = render(own)
    result = render(small(quality="GOOD"))
    assert len(pilot.asked) == 1 and 0.0 < pilot.asked[0] < 0.2 * plain.stats["total_seconds"] + 0.5
    assert np.array_equal(result.passes["Combined"], plain.passes["Combined"])
    told = result.stats
    assert "found nothing sooner" in told["quality"]["reason"]
    assert told["quality"]["pilot_seconds"] >= 0.7 and told["quality"]["lost_seconds"] == 0.0
    assert told["total_seconds"] - told["render_seconds"] > 0.69
    assert told["error_asked"] == pytest.approx(STEPS["GOOD"])


def test_a_bias_that_a_pilot_finds_leaves_less_room_for_noise(pilot: type[Pilot]) -> None:
    pilot.found = report(EXACT_ROW, row(AS_SET, 1.0, bias=0.025))
    stats = render(small(quality="GOOD")).stats
    floor = pilot.found.rows[-1].floor
    assert math.hypot(stats["error_asked"], floor.error) == pytest.approx(STEPS["GOOD"]) and floor.error > 0.0
    assert stats["error"] <= stats["error_asked"]


def test_a_bias_that_a_short_pilot_cannot_tell_from_noise_costs_no_samples(pilot: type[Pilot]) -> None:
    """A pilot of 2 s could not rule out 3 %; a lamp that took 21 s took 29."""
    unsure = replace(row(AS_SET, 1.0, bias=0.01), floor=Measured(1e-4, 5e-4))
    pilot.found = report(EXACT_ROW, unsure)
    assert unsure.floor.high > 0.03
    assert render(small(quality="GOOD")).stats["error_asked"] == STEPS["GOOD"]


def test_a_pilot_that_could_not_measure_the_scene_as_it_is_set_chooses_nothing() -> None:
    """A room was begun anew with 64 bounces, "by the scene as it is set"."""
    found = replace(report(EXACT_ROW), base=EXACT)
    assert quality.choose(found, "GOOD") == quality.as_set("GOOD")


def test_a_choice_that_is_sooner_begins_the_picture_anew(pilot: type[Pilot]) -> None:
    pilot.found = report(EXACT_ROW, row(AS_SET, 1.0), row("1 bounce", 0.1, settings={"max_bounces": 1}))
    result = render(small(quality="GOOD"))
    told = result.stats["quality"]
    assert told["choice"] == "1 bounce" and told["lost_seconds"] > 0.0
    assert result.stats["total_seconds"] >= told["lost_seconds"] + result.stats["render_seconds"]
    one = small(max_bounces=1, error_limit=STEPS["GOOD"])
    one.settings.samples = UNLIMITED_SAMPLES
    assert np.array_equal(result.passes["Combined"], render(one).passes["Combined"])


def test_a_pilot_that_has_no_room_is_told_and_the_picture_goes_on(pilot: type[Pilot]) -> None:
    pilot.found = MemoryError("it would take 40 GiB")
    result = render(small(quality="GOOD"))
    assert result.stats["stopped_by"] == "error"
    assert [text for text in result.stats["warnings"] if "no room for a pilot" in text and "40 GiB" in text]


def test_what_is_there_of_the_picture_counts_against_another_choice() -> None:
    found = report(EXACT_ROW, row(AS_SET, 1.0), row("4 bounces", 0.6, settings={"max_bounces": 4}))
    assert quality.choose(found, "GOOD").name == "4 bounces"
    assert quality.choose(found, "GOOD", begun=0.6).name == AS_SET


def test_settings_that_take_too_much_light_are_lifted_however_short_the_render() -> None:
    """The error of a picture tells its noise alone; what clamping took shows in the picture's ledger."""
    result = render(small(quality="PREVIEW", clamp_direct=0.05, clamp_indirect=0.05))
    told = result.stats["quality"]
    assert told["pilot_seconds"] > 0.0 and told["settings"]["clamp_direct"] == 0.0
    assert result.stats["clamped_share"] == 0.0 and result.stats["error"] <= STEPS["PREVIEW"]


def test_cancelling_ends_the_render_at_once() -> None:
    result = render(small(quality="HIGH"), progress=lambda progress: False)
    assert result.cancelled


def test_cancelling_the_pilot_keeps_the_picture_so_far(pilot: type[Pilot]) -> None:
    pilot.found = report(EXACT_ROW, row(AS_SET, 1.0))
    steps: list[int] = []

    def goes_on(told: Progress) -> bool:
        steps.append(told.samples)
        return not pilot.asked

    result = render(small(quality="GOOD"), progress=goes_on)
    assert result.cancelled and result.stats["samples"] == max(steps) > 0


def test_a_reference_takes_nothing_from_the_light_and_says_so() -> None:
    told = render(small(quality="REFERENCE", time_limit=0.5, clamp_indirect=2.0)).stats["quality"]
    assert told["choice"] == EXACT and told["settings"]["clamp_indirect"] == 0.0 and told["pilot_seconds"] == 0.0
    assert told["reason"] == 'Reference: 0.50 % by "exact"'


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


def test_a_pilot_builds_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of its renders built anew: in a scene of 439,000 triangles a pilot took 8 s of 27."""
    made: list[object] = []
    real = core.render.Renderer
    monkeypatch.setattr(core.render, "Renderer", lambda *given: made.append(given) or real(*given))
    monkeypatch.setattr(quality, "LOST_SHARE", -1.0)
    result = render(small(quality="DRAFT"))
    assert result.stats["quality"]["pilot_seconds"] > 0.0
    assert len(made) == 2 and result.stats["stopped_by"] == "error"
