"""Traps into which measures of accuracy fall, each with what keeps Luch out of it.

Others stand where they belong: stopping by the data that are averaged in test_stopping.py and test_adaptive.py,
fireflies in test_accuracy.py and test_pixel_error.py, samplers whose parts complement each other in test_curve.py,
headers that arrive in test_engine.py, counts that are absolute in test_adaptive.py, kernels of many variants in
test_effect_pairs.py.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import accuracy, record
from luch._native import core
from luch.cuda.host import DEVICE_BUILDS_FROM
from luch.cuda.programs import INSTRUCTION, Linked, operations, source
from luch.effects import effects_of
from luch.report import tally
from luch.scene import Scene
from support import synthetic
from support.everything import everything
from support.races import Truth, in_turns, products_ratio

SIZE = synthetic.SIZE


def noisy(rng: np.random.Generator, samples: int, size: float = 0.8) -> synthetic.F64:
    noise = size * rng.normal(size=(SIZE, SIZE, 3)) / np.sqrt(samples)
    return synthetic.truth() * (1.0 + noise)


def test_the_noise_of_a_reference_is_not_counted_as_the_pictures() -> None:
    rng, right = np.random.default_rng(1), synthetic.truth()
    true, naive, ours = [], [], []
    for _ in range(8):
        picture, reference = noisy(rng, 256), noisy(rng, 512)
        weight = 1.0 / (right + accuracy.DARK) ** 2
        true.append(np.sqrt(np.mean((picture - right) ** 2 * weight)))
        naive.append(np.sqrt(np.mean((picture - reference) ** 2 * weight)))
        ours.append(Truth(reference, 512).error(picture, 256))
    assert np.mean(naive) > 1.15 * np.mean(true)
    assert np.mean(ours) == pytest.approx(np.mean(true), rel=0.03)


def test_a_picture_that_lost_its_light_may_show_less_error_but_its_brightness_tells() -> None:
    rng = np.random.default_rng(2)
    film = synthetic.Picture(synthetic.fireflies, rng).film(32)
    whole = accuracy.estimate(*film[:2])
    limit = 1.2 * synthetic.truth().astype(np.float32)  # as clamping would have it
    mean = np.minimum(film[0], limit)
    deviation = np.where(film[0] > limit, 0.0, film[1]).astype(np.float32)
    clamped = accuracy.estimate(mean, deviation)
    assert whole is not None and clamped is not None
    assert clamped.error < 0.7 * whole.error, "by its error alone it would be the better one"
    assert clamped.brightness_high < whole.brightness
    told = {**clamped.statistics(), "clamped_share": 0.05, "samples": 128}
    assert {"brightness", "brightness_low", "brightness_high"} <= set(told)
    assert "clamping took 5.0 % of the light" in record.line(told)


def test_halves_of_a_filtered_picture_do_not_tell_its_error() -> None:
    """A filter's halves agree on what it got wrong: its error is measured against the truth, or not told."""
    rng, right = np.random.default_rng(3), synthetic.truth()
    halves = [noisy(rng, 64) for _ in range(2)]
    filtered = [accuracy.box_sum(half) / accuracy.box_sum(np.ones_like(half)) for half in halves]
    by_halves = np.mean(((filtered[0] - filtered[1]) / 2) ** 2 * tally.weights(right))
    true = tally.relative_error((filtered[0] + filtered[1]) / 2, right, tally.weights(right))
    assert true > 10.0 * by_halves


def test_a_machine_that_slows_down_does_not_decide_a_race() -> None:
    """A third slower from one render to the next of a long bench, as measured on busy machines."""
    now, pace = [0.0], [1.0]

    def work(seconds: float) -> Callable[[int], None]:
        def run(_: int) -> None:
            now[0] += seconds * pace[0]
            pace[0] *= 1.03

        return run

    one, other = work(1.0), work(1.0)
    ratios = in_turns(one, other, 11, lambda: now[0])
    assert np.median(ratios) == pytest.approx(1.0, abs=0.04)
    assert pace[0] > 1.8
    slower = in_turns(work(1.1), other, 11, lambda: now[0])
    assert np.median(slower) == pytest.approx(1.1, abs=0.04)


def test_products_of_error_and_time_are_compared_turn_by_turn_and_their_interval_holds() -> None:
    rng, turns, held, off = np.random.default_rng(3), 8, 0, []
    for _ in range(200):
        machine = np.exp(rng.normal(0.0, 0.3, turns))  # what else it does, for both engines alike
        theirs = rng.normal(0.03, 0.003, turns), 2.0 * machine * rng.normal(1.0, 0.02, turns)
        ours = rng.normal(0.02, 0.002, turns), 1.0 * machine * rng.normal(1.0, 0.02, turns)
        ratio, low, high = products_ratio(theirs, ours)  # type: ignore[arg-type]
        held += low <= 3.0 <= high
        off.append(ratio / 3.0 - 1.0)
    assert np.std(off) < 0.06, "the machine's moods, 30 %, are gone"
    assert abs(np.mean(off)) < 0.015
    assert held >= 170  # 95 % of endless turns; eight make the interval a little narrow


def test_an_engine_whose_pixels_lie_elsewhere_is_judged_by_its_own_reference() -> None:
    rng, right = np.random.default_rng(4), synthetic.truth()
    shifted = np.roll(right, 1, axis=0)
    picture = noisy(rng, 4096)
    theirs = np.roll(picture, 1, axis=0)
    own = Truth(right, 1 << 20).error(picture, 4096)
    assert Truth(shifted, 1 << 20).error(theirs, 4096) == pytest.approx(own, rel=1e-6)
    assert Truth(right, 1 << 20).error(theirs, 4096) > 5.0 * own
    assert Truth(right, 1).brightness(shifted) == pytest.approx(0.0, abs=1e-9), "the energy must agree"


def test_errors_of_highlights_count_like_those_of_any_pixel() -> None:
    """Neither clipped by a display nor hidden by what else is bright; nor do dark rooms have none."""
    rng = np.random.default_rng(5)
    d = (0.05 * rng.normal(size=(SIZE, SIZE, 3))).astype(np.float32)
    found = [accuracy.estimate(level * (1.0 + d), level * d) for level in np.float32([1.0, 200.0])]
    assert found[0] is not None and found[1] is not None
    assert found[1].error == pytest.approx(found[0].error, rel=0.02)
    dark = accuracy.estimate(np.float32(0.1) * (1.0 + d), np.float32(0.1) * d)
    assert dark is not None and dark.error > 0.85 * found[0].error


def code_of(scene: Scene) -> tuple[str, Any]:
    """What the kernels of a scene are compiled from: the text of its programs, and what decides its plan."""
    renderer = core.render.Renderer(scene, True, DEVICE_BUILDS_FROM)
    assert renderer.prepare()
    facts, arrays = renderer.device_facts(), dict(renderer.device_images()[0][0])
    programs = [Linked(*row) for row in facts["programs"]]
    instructions = np.frombuffer(arrays["instructions"], INSTRUCTION)
    effects = effects_of(scene)
    told = [(name, effects[name].on) for name in effects]
    text = source(programs, facts["materials"], instructions, np.frombuffer(arrays["operands"], np.uint32))
    return text, (told, operations(programs, instructions), {k: v for k, v in facts.items() if k != "programs"})


def test_each_kernel_function_holds_the_programs_that_it_may_be_asked_for_and_no_others() -> None:
    """Surfaces are shaded by all of their programs; of the world and of lamps nobody asks more than light."""
    renderer = core.render.Renderer(everything(), True, DEVICE_BUILDS_FROM)
    assert renderer.prepare()
    facts, text = renderer.device_facts(), code_of(everything())[0]
    programs, materials = [Linked(*row) for row in facts["programs"]], facts["materials"]
    assert 0 < materials < len(programs)

    def called(name: str) -> set[int]:
        function = text[text.index(f" {name}(") :]
        return {int(first) for first in re.findall(r"case (\d+)u:", function[: function.index("\n}")])}

    surfaces, lights = programs[:materials], programs[materials:]
    assert called("run_program") == {p.first_instruction for p in surfaces if p.instruction_count}
    assert called("run_surface_light") == {p.first_instruction for p in surfaces if p.light_instruction_count}
    assert called("run_light_program") == {p.first_instruction for p in lights if p.light_instruction_count}
    assert called("run_light_program"), "the scene has a world or a lamp of nodes"


def test_what_changes_from_frame_to_frame_is_no_part_of_the_kernels() -> None:
    """Literals that change would defeat every cache of compiled code."""
    scene = everything()
    moved = everything(seed=9)
    moved.settings.samples, moved.frame = 77, 5
    moved.camera = replace(moved.camera, lens_mm=30.0, matrix=moved.camera.matrix + 0.1)
    moved.film = replace(moved.film, width=33, exposure=2.0)
    for lamp in moved.lights:
        lamp.power *= 1.7
    assert code_of(moved) == code_of(scene)
    fewer = everything()
    fewer.lights = fewer.lights[:1]
    assert code_of(fewer) != code_of(scene)
