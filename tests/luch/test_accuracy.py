"""The error of a picture, told by its halves, against pictures whose truth is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from luch import accuracy, pixel_error
from luch._native import core
from luch.scene import F32
from support import error_oracle

SIZE = 40
TRIALS = 40
Noise = Callable[[np.random.Generator, int], np.ndarray]  # relative error of the mean of n samples, (SIZE, SIZE, 3)


def truth() -> np.ndarray:
    """A ramp, waves, and an edge a hundred times as bright on one side."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    return np.stack([0.05 + x, 0.3 + 0.2 * np.sin(9 * y), np.where(x > y, 0.02, 2.0)], axis=2)


def gaussian(rng: np.random.Generator, n: int) -> np.ndarray:
    return 0.5 * rng.normal(size=(SIZE, SIZE, 3)) / np.sqrt(n)


def pareto(rng: np.random.Generator, n: int) -> np.ndarray:
    """Tails so heavy that the fourth moment is infinite; the channels share a sample."""
    return 0.5 * (rng.pareto(2.2, (n, SIZE, SIZE, 1)).mean(axis=0) - 1 / 1.2) * np.ones(3)


def fireflies(rng: np.random.Generator, n: int) -> np.ndarray:
    """Light that one sample in 500 finds, over plain noise."""
    hits = rng.binomial(n, 0.002, (SIZE, SIZE, 1)) / (n * 0.002)
    return 0.15 * (hits - 1.0) * np.ones(3) + 0.2 * gaussian(rng, n)


def picture(noise: Noise, rng: np.random.Generator, n: int) -> tuple[F32, F32]:
    """Mean and deviation of two halves of n samples each."""
    a, b = (truth() * (1.0 + noise(rng, n)) for _ in range(2))
    return ((a + b) / 2).astype(np.float32), ((a - b) / 2).astype(np.float32)


def error_of(mean: F32, right: np.ndarray) -> float:
    return float(np.sqrt(np.mean((mean - right) ** 2 / (right + 0.01) ** 2)))


@pytest.mark.parametrize(("noise", "n"), [(gaussian, 2), (gaussian, 64), (pareto, 4), (pareto, 64), (fireflies, 64)])
def test_the_estimate_holds_against_a_known_truth(noise: Noise, n: int) -> None:
    rng = np.random.default_rng(n)
    right = truth()
    covered, close, bright, width = [], [], [], []
    for _ in range(TRIALS):
        mean, deviation = picture(noise, rng, n)
        found = accuracy.estimate(mean, deviation)
        assert found is not None
        error = error_of(mean, right)
        covered.append(found.error_low <= error <= found.error_high)
        close.append(0.8 <= (found.error / error) ** 2 <= 1.25)
        bright.append(found.brightness_low <= right.mean() <= found.brightness_high)
        width.append(found.error_high / found.error_low)
    assert np.mean(covered) >= 0.9 and np.median(width) < 1.5
    assert np.mean(close) >= 0.9
    assert np.mean(bright) >= 0.85  # 9 tiles of 40 x 40 pixels


def test_the_share_of_fireflies_tells_even_noise_from_a_few_bright_pixels() -> None:
    rng = np.random.default_rng(1)
    mean, deviation = picture(gaussian, rng, 16)
    even = accuracy.estimate(mean, deviation)
    mean[20, 20] += 50.0
    deviation[20, 20] += 50.0  # one half found it
    one = accuracy.estimate(mean, deviation)
    assert even is not None and one is not None
    assert even.fireflies_share < 0.03 and one.fireflies_share > 0.9
    assert one.error_high / one.error_low > 1.5 * even.error_high / even.error_low


def test_standard_errors_cover_the_truth_pixel_by_pixel() -> None:
    rng = np.random.default_rng(3)
    right = truth()
    for noise, most in ((gaussian, 0.99), (pareto, 0.995)):  # heavy tails make them careful
        mean, deviation = picture(noise, rng, 32)
        error = pixel_error.standard_error(deviation)
        inside = (np.abs(mean - right) <= 1.96 * error)[..., :2]  # the edge of the third mixes two brightnesses
        assert 0.93 <= inside.mean() <= most


def test_a_picture_without_noise_has_no_error() -> None:
    found = accuracy.estimate(truth().astype(np.float32), np.zeros((SIZE, SIZE, 3), np.float32))
    assert found is not None
    assert (found.error, found.error_low, found.error_high, found.fireflies_share) == (0.0, 0.0, 0.0, 0.0)


def test_pixels_that_one_half_has_not_reached_are_left_out() -> None:
    mean, deviation = picture(gaussian, np.random.default_rng(4), 32)
    whole = accuracy.estimate(mean, deviation)
    deviation[:10] = np.nan
    mean[:10] = 1e6
    part = accuracy.estimate(mean, deviation)
    assert whole is not None and part is not None
    assert part.error == pytest.approx(whole.error, rel=0.1) and part.brightness < 2.0
    assert np.isfinite(pixel_error.standard_error(deviation)[12:]).all()
    assert accuracy.estimate(mean, np.full_like(deviation, np.nan)) is None


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (3, 2)])
def test_tiny_pictures_have_an_error_too(size: tuple[int, int]) -> None:
    mean = np.ones((*size, 3), np.float32)
    found = accuracy.estimate(mean, mean * 0.1)
    held = 0.99  # harmonic mean of 0.9 and 1.1: what a pixel without neighbours is divided by
    assert found is not None and 0.1 / 1.01 < found.error < 0.1 / held
    assert size != (1, 1) or found.error == pytest.approx(0.1 / (held + 0.01), rel=1e-5)


def test_a_lamps_edge_is_no_firefly() -> None:
    """A pixel that one sample in a hundred sees bright, beside a bright lamp: its truth is bright, not dark."""
    mean = np.full((SIZE, SIZE, 3), 0.05, np.float32)
    mean[:, 20:] = 100.0
    deviation = 0.02 * mean
    mean[10, 19] = deviation[10, 19] = 2.0
    edge = accuracy.estimate(mean, deviation)
    mean[10, 19], deviation[10, 19] = 0.05, 0.001
    mean[10, 9] = deviation[10, 9] = 2.0
    firefly = accuracy.estimate(mean, deviation)
    assert edge is not None and firefly is not None
    assert edge.error < 0.05 and firefly.error > 0.3


def test_parts_of_one_sequence_overstate_by_their_rate() -> None:
    assert all(accuracy.overstated(share, 1.0) == pytest.approx(1.0) for share in (0.1, 0.5, 0.7))
    assert accuracy.overstated(0.5, 1.1) == pytest.approx(2.0**1.1 - 1.0)
    assert accuracy.overstated(0.0, 1.2) == 1.0  # independent parts


@pytest.mark.parametrize(("first", "count"), [(32, 64), (64, 96), (32, 56), (16, 64)])
def test_parts_of_scrambled_nets_overstate_as_nested_nets_do(first: int, count: int) -> None:
    """Edges at random, and what the net does not know, as noise: the rate lies between theirs."""
    rng = np.random.default_rng(1)
    grid = (np.arange(256) + 0.5) / 256 - 0.5
    values = []
    for seed in range(1500):
        points = core.sampling.sample_2d(seed, np.arange(96, dtype=np.uint32), 11).astype(np.float64) - 0.5
        turn, off = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.2, 0.2)
        truth = np.mean(grid * np.cos(turn) + grid[:, None] * np.sin(turn) > off)
        seen = points[:, 0] * np.cos(turn) + points[:, 1] * np.sin(turn) > off
        values.append(seen - truth + 0.1 * rng.normal(size=96))
    drawn = np.array(values)

    def squared(n: int) -> float:
        return float(np.mean(drawn[:, :n].mean(axis=1) ** 2))

    share, rate = first / count, float(np.log2(squared(32) / squared(64)))
    assert 1.2 < rate < 1.5
    apart = drawn[:, :first].mean(axis=1) - drawn[:, first:count].mean(axis=1)
    told = share * (1.0 - share) * float(np.mean(apart**2))
    assert told / squared(count) == pytest.approx(accuracy.overstated(share, rate), rel=0.12)


@pytest.mark.parametrize("share", [0.5, 0.7])
def test_the_cores_sums_are_those_of_the_rule_spelled_out(share: float) -> None:
    """Pixel by pixel: guesses at the truth, squares by them, and what the estimate is made of."""
    mean, deviation = error_oracle.film(np.random.default_rng(6))
    right = error_oracle.relative_squares(mean, deviation, share)
    found = accuracy.relative_squares(mean, deviation, share)
    assert len(found) == len(right) == accuracy.GUIDE_RADIUS
    for squares, wanted in zip(found, right, strict=True):
        np.testing.assert_allclose(squares, wanted, rtol=2e-5)
    assert np.array_equal(accuracy.relative_squares(mean, deviation, share, radius=1), found[:1])
    estimated, wanted = accuracy.estimate(mean, deviation, share), error_oracle.estimate(mean, deviation, share)
    assert estimated is not None and estimated.statistics() == pytest.approx(wanted, rel=1e-5)


def test_the_cores_sums_are_the_same_with_any_number_of_threads() -> None:
    rng = np.random.default_rng(8)
    mean = rng.gamma(1.0, 1.0, (75, 130, 3)).astype(np.float32)
    deviation = (0.3 * mean * rng.normal(size=mean.shape)).astype(np.float32)
    one, three = (core.film.error_sums(mean, deviation, 0.4, accuracy._rules(), threads) for threads in (1, 3))
    assert np.array_equal(one.pop("tiles"), three.pop("tiles")) and one == three
    planes = [core.film.relative_squares(mean, deviation, 0.4, accuracy._rules(), threads) for threads in (1, 3)]
    assert np.array_equal(*planes)


def test_images_of_different_shapes_are_refused() -> None:
    image = np.ones((4, 5, 3), np.float32)
    for wrong in (image[:3], image[..., :2], image[0]):
        with pytest.raises(ValueError, match="one shape"):
            accuracy.relative_squares(image, wrong, 0.5)


@pytest.mark.parametrize("share", [0.5, 1.0 / 3.0, 2.0 / 3.0])
def test_a_firefly_is_not_borne_out_and_parts_that_agree_are(share: float) -> None:
    """Whichever part found it, however many samples that part has; deviations as the film writes them. A pixel alone is
    divided by what is borne out of it.
    """
    for first, rest in ((9.0, 0.0), (0.0, 9.0), (3.0, 3.0), (2.0, 4.0)):
        mean = np.full((1, 1, 3), share * first + (1.0 - share) * rest, np.float32)
        deviation = np.full((1, 1, 3), (first - rest) * np.sqrt(share * (1.0 - share)), np.float32)
        right = 1.0 / (share / first + (1.0 - share) / rest) if first and rest else 0.0
        square = accuracy.relative_squares(mean, deviation, share)[0][0, 0]
        assert np.sqrt(square) == pytest.approx(abs(deviation[0, 0, 0]) / (right + accuracy.DARK), rel=1e-4)
