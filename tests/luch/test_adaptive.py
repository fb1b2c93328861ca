"""Samples where the error is: decided by nobody for himself, the same for any threads, and only where it pays."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.adaptive import LEAST_PART, TILE, Regions, Shares, line, parts
from luch.render import render
from luch.scene import Film
from numpy.typing import NDArray
from support import synthetic
from support.everything import everything

SIZE = synthetic.SIZE
Counts = NDArray[np.uint32]


def grown(sums: synthetic.F64, counts: Counts, truth: synthetic.F64) -> tuple[synthetic.F32, synthetic.F32]:
    """Mean and deviation of a film whose pixels have so many samples each. sums: (MOST, H, W), relative."""
    before = np.exp2(np.ceil(np.log2(counts)) - 1).astype(np.uint32)

    def at(many: Counts) -> synthetic.F64:
        return np.asarray(np.take_along_axis(sums, many[None].astype(np.intp) - 1, axis=0)[0])

    first, all_of_them = at(before), at(counts)
    rest = counts - before
    gap = (first / before - (all_of_them - first) / rest) * np.sqrt(before * rest.astype(np.float64)) / counts
    pictures = truth * (1.0 + (all_of_them / counts)[..., None]), truth * gap[..., None]
    return pictures[0].astype(np.float32), pictures[1].astype(np.float32)


def adaptive_picture(
    sums: synthetic.F64, truth: synthetic.F64, samples: int, decide: Any = None
) -> tuple[synthetic.F32, Counts]:
    """With so many samples on average; decided at 32, 64, 128, ... as a render does."""
    regions = Regions(*sums.shape[1:])
    counts = np.full(regions.count, 32, np.uint32)
    done = 32
    while done < samples:
        mean, deviation = grown(sums, regions.pixel_counts(counts), truth)
        variances = regions.variances(mean, deviation, 0.5, counts)
        shares = regions.shares(variances) if decide is None else decide(regions, variances)
        done = min(2 * done, samples)
        counts = regions.targets(shares.weights, counts, done, synthetic.MOST)
    return grown(sums, regions.pixel_counts(counts), truth)[0], counts


def uneven(rng: np.random.Generator) -> synthetic.F64:
    """A third of the picture is eight times as noisy as the rest."""
    noise = np.where(np.arange(SIZE) < TILE, 1.6, 0.2)
    return np.asarray(np.cumsum(noise * rng.normal(size=(synthetic.MOST, SIZE, SIZE)), axis=0))


def test_regions_get_samples_in_proportion_to_the_root_of_their_variance() -> None:
    regions = Regions(2 * TILE, 4 * TILE)
    variances = np.repeat([1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0], 2)  # two rows of tiles
    shares = regions.shares(variances)
    low, high = shares.weights[0], shares.weights[-1]
    # A region's own part and its neighbourhood's.
    assert high / low == pytest.approx(np.sqrt((0.5 * 4 + 0.5 * 2.5) / (0.5 + 0.5 * 2.5)))
    assert np.average(shares.weights, weights=regions.pixels) == pytest.approx(1.0)
    assert shares.samples_part < 1.0
    assert regions.shares(np.ones(16)).samples_part == pytest.approx(1.0)


def test_a_region_that_shows_no_error_still_gets_its_part() -> None:
    regions = Regions(TILE, 8 * TILE)
    variances = np.zeros(16)
    variances[:2] = 1.0
    shares = regions.shares(variances)
    assert shares.weights.min() >= 0.8 * LEAST_PART
    assert regions.shares(np.zeros(16)).weights.tolist() == [1.0] * 16


def test_what_a_half_found_never_decides_about_itself() -> None:
    rng = np.random.default_rng(1)
    regions, counts = Regions(37, 43), np.full(18, 64, np.uint32)
    mean, deviation = rng.gamma(1.0, 1.0, (2, 37, 43, 3)).astype(np.float32)
    before = regions.variances(mean, deviation, 0.5, counts)
    white = regions.of_pixel % 2 == 0
    mean[white] *= 3.0
    deviation[white] = 7.0
    after = regions.variances(mean, deviation, 0.5, counts)
    assert np.array_equal(before[1::2], after[1::2]) and not np.isclose(before[::2], after[::2]).any()
    weights = [regions.shares(told).weights for told in (before, after)]
    whole = [w / w[::2].mean() for w in weights]
    np.testing.assert_allclose(whole[0][::2], whole[1][::2], rtol=1e-12, err_msg="white fields, by black ones alone")


def test_targets_are_met_on_average_and_the_way_there_does_not_matter() -> None:
    regions = Regions(5 * TILE, 6 * TILE + 5)
    rng = np.random.default_rng(2)
    shares = regions.shares(rng.pareto(1.5, regions.count) + 0.01)
    start = np.full(regions.count, 32, np.uint32)
    straight = regions.targets(shares.weights, start, 96, 1 << 12)
    by_steps = start
    for samples in (33, 40, 47, 80, 81, 96):
        following = regions.targets(shares.weights, by_steps, samples, 1 << 12)
        assert (following >= by_steps).all()
        by_steps = following
    assert np.array_equal(straight, by_steps)
    mean = np.average(straight, weights=regions.pixels)
    assert 96 <= mean <= 1.05 * 96 and straight.min() >= 32
    assert regions.targets(shares.weights, start, 96, 100).max() <= 100


def test_less_error_with_the_same_samples_where_noise_is_uneven() -> None:
    rng = np.random.default_rng(3)
    truth = np.full((SIZE, SIZE, 3), 0.5)
    gains = []
    for _ in range(4):
        sums = uneven(rng)
        picture, counts = adaptive_picture(sums, truth, 256)
        spent = round(float(np.average(counts, weights=Regions(SIZE, SIZE).pixels)))
        uniform = truth * (1.0 + (sums[spent - 1] / spent)[..., None])
        gains.append(np.mean((picture - truth) ** 2) / np.mean((uniform - truth) ** 2))
    assert np.mean(gains) < 0.75  # Neyman's bound for these shares: 0.54


def by_itself(regions: Regions, variances: synthetic.F64) -> Shares:
    """As engines do that stop where a pixel looks good: a region decides about itself, however it errs."""
    wanted = np.maximum(np.sqrt(variances), 1e-3)
    return Shares(wanted / np.average(wanted, weights=regions.pixels), 0.5)


def test_no_light_is_lost_that_few_samples_find() -> None:
    """A rare path's light, in many small pictures: all of it, as with the same samples everywhere."""
    rng = np.random.default_rng(4)
    size, truth = 2 * TILE, np.ones((2 * TILE, 2 * TILE, 3))
    ours, greedy = [], []
    for _ in range(40):
        hits = rng.random((synthetic.MOST, size, size), np.float32) < 1 / 2000
        sums = np.cumsum(2000.0 * hits - 1.0, axis=0)
        ours.append(adaptive_picture(sums, truth, 128)[0].mean() - 1.0)
        greedy.append(adaptive_picture(sums, truth, 128, by_itself)[0].mean() - 1.0)
    error = np.std(ours) / np.sqrt(len(ours))
    assert abs(np.mean(ours)) <= 2.5 * error and error < 0.03
    assert np.mean(greedy) < -0.05, "a rule that looks at itself loses light: this test would see it"


@pytest.fixture(scope="module")
def wide() -> Any:
    scene = everything()
    scene.camera.lens_mm = 5.0  # the floor in the middle, the sky around it
    scene.film = Film(width=40, height=24, passes=["Combined", "Sample Count"])
    settings = replace(scene.settings, error_limit=0.002, adaptive=True, samples=4096)
    return replace(scene, settings=settings)


def test_the_picture_is_the_same_for_any_threads_and_its_counts_are_true(wide: Any) -> None:
    one, three = (render(replace(wide, settings=replace(wide.settings, threads=count))) for count in (1, 3))
    assert one.stats["adaptive"] and one.stats["stopped_by"] == "error"
    for name, image in one.passes.items():
        assert np.array_equal(image.view(np.uint32), three.passes[name].view(np.uint32)), name
    counts = one.passes["Sample Count"]
    assert (counts.min(), counts.max()) == (one.stats["samples_least"], one.stats["samples_most"])
    assert counts.max() >= 2 * counts.min()
    assert counts.mean() == pytest.approx(one.stats["samples_mean"])
    assert counts.sum() == one.stats["paths"]
    assert line(one.stats).startswith(f"{counts.min():.0f} to {counts.max():.0f} samples")


def test_even_noise_is_sampled_evenly_and_the_reader_is_told(wide: Any) -> None:
    plain = replace(wide, settings=replace(wide.settings, adaptive=False, error_limit=0.2))
    even = replace(plain, settings=replace(plain.settings, adaptive=True))
    found, other = render(even), render(plain)
    assert not found.stats["adaptive"]
    assert np.array_equal(found.passes["Combined"], other.passes["Combined"])
    assert line(found.stats).startswith("the same samples everywhere") and line(other.stats) == ""


def test_merged_pictures_stay_uniform_and_say_so(wide: Any) -> None:
    kept = render(replace(wide, settings=replace(wide.settings, mergeable=True, samples=8)))
    assert "adaptive" not in kept.stats and any("Adaptive Sampling is left out" in w for w in kept.stats["warnings"])


def test_parts_hold_every_pixel_that_takes_samples_once() -> None:
    regions = Regions(20, 33)
    rng = np.random.default_rng(5)
    begins = rng.integers(0, 3, regions.count).astype(np.uint32)
    ends = begins + rng.integers(0, 3, regions.count).astype(np.uint32)
    taken = np.zeros(20 * 33, np.uint32)
    for pixels, first, count in parts(regions, begins, ends):
        assert (begins[regions.of_pixel.ravel()[pixels]] == first).all()
        taken[pixels] += count
    assert np.array_equal(taken.reshape(20, 33), regions.pixel_counts(ends - begins))
