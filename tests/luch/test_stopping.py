"""Renders that end at an error: as asked, without losing light, and always."""

from __future__ import annotations

import numpy as np
import pytest
from luch.stopping import LEAST_SAMPLES, Stopping, looks_after, rounded_up
from support import synthetic

RENDERS = 16


@pytest.mark.parametrize(
    ("noise", "asked"),
    [
        (synthetic.normal, 0.08),
        (synthetic.pareto, 0.08),
        (synthetic.fireflies, 0.25),
        (synthetic.fireflies, 0.12),
        (synthetic.stratified, 0.04),
    ],
)
def test_the_error_asked_for_is_met_and_no_light_is_lost(noise: synthetic.Noise, asked: float) -> None:
    rng = np.random.default_rng(7)
    met, brightness, full = [], [], []
    for _ in range(RENDERS):
        picture = synthetic.Picture(noise, rng)
        samples, stopping, curve = picture.rendered_to(asked)
        assert stopping.reached and curve.last is not None and curve.last.error <= asked
        met.append(0.7 <= picture.error(samples) / asked <= 1.1)
        brightness.append(picture.at(samples).mean() / picture.truth.mean() - 1.0)
        full.append(picture.at(synthetic.MOST).mean() / picture.truth.mean() - 1.0)
    assert np.mean(met) >= 0.9
    # Within a thousandth, beside the noise that so few renders have.
    assert abs(np.mean(brightness)) <= 1e-3 + 3.0 * np.std(brightness) / np.sqrt(RENDERS)


def test_light_that_few_samples_find_is_not_left_out_for_being_looked_at_often() -> None:
    """Many small pictures that stop by themselves: together they are as bright as the truth."""
    rng = np.random.default_rng(11)
    stopped, counts = [], []
    for _ in range(60):
        picture = synthetic.Picture(synthetic.fireflies, rng)
        samples, _, _ = picture.rendered_to(0.3)
        counts.append(samples)
        stopped.append(picture.at(samples).mean() / picture.truth.mean() - 1.0)
    assert np.median(counts) < 64
    uncertainty = np.std(stopped) / np.sqrt(len(stopped))
    assert abs(np.mean(stopped)) <= 1e-3 + 2.0 * uncertainty and uncertainty < 2e-3


@pytest.mark.parametrize("black", [False, True])
def test_a_picture_without_noise_ends_at_the_least_samples(black: bool) -> None:
    picture = synthetic.Picture(synthetic.nothing, np.random.default_rng(0), black)
    samples, stopping, curve = picture.rendered_to(0.01)
    assert samples == LEAST_SAMPLES and stopping.reached
    assert curve.last is not None and curve.last.error == 0.0


def test_an_error_out_of_reach_ends_with_the_samples() -> None:
    picture = synthetic.Picture(synthetic.normal, np.random.default_rng(0))
    samples, stopping, _ = picture.rendered_to(1e-6)
    assert samples == synthetic.MOST and not stopping.reached


def test_another_error_may_be_asked_for_on_the_way() -> None:
    """One that the picture has reached already, or one that takes it on."""
    picture = synthetic.Picture(synthetic.normal, np.random.default_rng(0))
    _, stopping, curve = picture.rendered_to(0.08)
    assert stopping.reached
    stopping.ask(0.04, curve)
    assert not stopping.reached and stopping.error == 0.04
    stopping.ask(0.1, curve)
    assert stopping.reached


def test_looks_are_fixed_beforehand() -> None:
    looks, stopping = [0], Stopping(samples=200)
    while looks[-1] < 200:
        looks.append(stopping.next_look(looks[-1]))
    assert looks[1:] == [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 200]
    assert looks_after(7) == 8 and looks_after(96) == 128
    assert [rounded_up(n) for n in (9, 17, 33, 101, 1000)] == [9, 18, 36, 104, 1024]


def test_the_surer_an_estimate_the_nearer_it_aims() -> None:
    stopping = Stopping(samples=64, error=0.01)
    aims = [stopping.aim(spread) for spread in (0.0, 0.03, 0.08, 0.15, 0.5)]
    assert aims == sorted(aims, reverse=True) and aims[0] == 0.0097 and aims[-1] == 0.0087
