"""Errors of single pixels and where they are not to be believed, against noise whose size is known."""

from __future__ import annotations

import numpy as np
import pytest
from luch import pixel_error
from luch.scene import Film

SIZE = 72
RARE = 1 / 4000  # samples of a caustic's pixel that find its light


def test_a_pixels_own_deviation_counts_where_it_is_larger() -> None:
    deviation = np.full((SIZE, SIZE, 3), 0.01, np.float32)
    deviation[30, 30] = 1.0
    error = pixel_error.standard_error(deviation, 0.5)
    assert error[30, 30, 0] == pytest.approx(0.5) and error[30, 33, 0] < 0.1
    assert error[60, 60, 0] == pytest.approx(0.005)


def test_even_noise_is_reliable_and_unknown_is_not() -> None:
    rng = np.random.default_rng(1)
    deviation = rng.normal(size=(SIZE, SIZE, 3)).astype(np.float32)
    told = pixel_error.reliability(deviation)
    assert told.shape == (SIZE, SIZE, 1) and told.min() > 0.75
    deviation[:30] = np.nan
    told = pixel_error.reliability(deviation)
    assert (told[:24] == 0.0).all() and (told[35:] > 0.5).all()
    assert (pixel_error.reliability(np.zeros((8, 8, 3), np.float32)) == 1.0).all()


def test_pixels_that_missed_what_their_neighbours_found_are_flagged() -> None:
    """A caustic's patch, whose light one sample in thousands finds, in a quiet picture."""
    rng = np.random.default_rng(2)
    missed = flagged = quiet = 0
    for _ in range(6):
        patch = np.zeros((SIZE, SIZE))
        patch[20:50, 20:50] = 1.0
        hits = rng.binomial(64, RARE, (2, SIZE, SIZE)) / (64 * RARE) * patch
        a, b = hits + 0.002 * rng.normal(size=hits.shape)
        deviation = np.repeat(((a - b) / 2)[..., None], 3, axis=2).astype(np.float32)
        error = pixel_error.standard_error(deviation)[..., 0]
        out = np.abs((a + b) / 2 - patch) > 1.96 * error
        low = pixel_error.reliability(deviation)[..., 0] < 0.5
        wrong = out & (patch > 0.0)
        missed, flagged = missed + int(wrong.sum()), flagged + int((wrong & low).sum())
        quiet += int(low[:, 68:].sum())
    assert missed > 200 and flagged >= 0.8 * missed
    assert quiet == 0, "far from the patch nothing is flagged"


@pytest.mark.parametrize("shape", [(1, 1), (3, 40), (17, 5)])
def test_windows_hold_the_largest_neighbour(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(3)
    image, far = rng.random(shape), pixel_error.FAR
    ours = pixel_error._window_max(pixel_error._window_max(image, far, 0), far, 1)
    for y in range(shape[0]):
        for x in range(shape[1]):
            assert ours[y, x] == image[max(0, y - far) : y + far + 1, max(0, x - far) : x + far + 1].max()


def test_an_aov_may_have_a_passes_name() -> None:
    film = Film(passes=["Combined", "Error", "Reliability"], aovs=[("Error", "COLOR")])
    assert pixel_error.wanted(film) == ["Reliability"]
