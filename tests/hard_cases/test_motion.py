"""Shutters at their limits, through whole renders. Numbers: the rows of the list of hard cases.

Of Blender's own scenes: tests/addon/test_hard_cases.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from luch.render import Result, render
from luch.scene import Scene, Shutter
from support.asked import every_device
from support.everything import everything
from support.moving_square import EVEN, WAYS, WIDTH, expected, square

SPEED = 3.0  # metres a frame
every_way = pytest.mark.parametrize("way", WAYS)


def rendered(scene: Scene, device: str) -> Result:
    result = render(replace(scene, settings=replace(scene.settings, device=device)))
    assert result.stats["device"].startswith(device), result.stats["warnings"]
    assert result.stats["non_finite_samples"] == 0
    assert all(np.isfinite(picture).all() for picture in result.passes.values())
    return result


def opened(scene: Scene, way: str, length: float, keys: int = 3) -> Scene:
    """What moves by SPEED, while the shutter is open for so many frames."""
    return WAYS[way](replace(scene, shutter=Shutter(length=length)), SPEED * length, keys)


@every_device
@every_way
@pytest.mark.parametrize("make", [square, everything])
def test_58_a_shutter_of_no_time_is_none_bit_for_bit(make: Callable[[], Scene], way: str, device: str) -> None:
    still = rendered(replace(make(), shutter=None), device)
    assert still.passes["Combined"].max() > 0.0
    # As Blender hands it over, and with the keys that an open shutter has: all alike, and unread without a shutter.
    for shut in (opened(make(), way, 0.0), replace(opened(make(), way, 1.0), shutter=None)):
        result = rendered(shut, device)
        assert result.stats["time_samples"] == 0 and set(result.passes) == set(still.passes)
        for name, picture in still.passes.items():
            assert np.array_equal(result.passes[name].view(np.uint32), picture.view(np.uint32)), name


@every_device
@every_way
def test_58_a_short_shutter_is_nearly_none_and_a_long_one_sees_the_way(way: str, device: str) -> None:
    still = rendered(replace(square(), shutter=None), device).passes["Combined"]
    short = rendered(opened(square(), way, 1e-6), device).passes["Combined"]
    # It moves by 1e-5 of a pixel: where its edges lie, that is one sample of 1,024, and one more for rounding.
    assert np.abs(short - still).max() <= 2.0 / 1024.0
    whole = rendered(opened(square(), way, 1.0), device).passes["Combined"]
    np.testing.assert_allclose(whole[..., 0].mean(axis=0), expected(SPEED, EVEN), atol=0.005)
    assert len(np.unique(np.round(whole[0, :, 0], 2))) > WIDTH // 4, "a ramp"
