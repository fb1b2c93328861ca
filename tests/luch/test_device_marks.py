"""Marks of a film on devices: the same arithmetic as luch/film/film.h, on whole arrays. No GPU is needed."""

from __future__ import annotations

import numpy as np
import pytest
from luch._native import core
from luch.cuda.memory import MARK_CHANNELS, NONE, Memory
from luch.cuda.render import parted
from luch.scene import Film


class Device(Memory):
    """A film's sums in layers, without the rest."""

    def __init__(self, layers: int, pixels: int, stride: int, marks: int) -> None:
        self.rows = np.zeros((layers, pixels, stride))
        self.counts = np.zeros((layers, pixels), np.uint32)
        self._marks = marks

    def field(self, name: str, task: bytes | bytearray | None = None) -> int:
        assert (name, task) == ("film.layout.marks", None)
        return self._marks


@pytest.mark.parametrize(("first", "count", "most"), [(0, 1, 4), (0, 100, 7), (5, 60, 1000), (64, 64, 64), (100, 5, 2)])
def test_steps_are_parted_at_powers_of_two(first: int, count: int, most: int) -> None:
    parts = list(parted(first, count, most))
    samples = [sample for start, number in parts for sample in range(start, start + number)]
    assert samples == list(range(first, first + count)) and max(number for _, number in parts) <= most
    for start, number in parts:
        inside = range(start + 1, start + number)
        assert not any(sample & (sample - 1) == 0 for sample in inside), "a mark within a wave"


def test_layers_and_devices_mark_what_one_film_marks() -> None:
    film = core.film.Film(Film(width=2, height=1), marks=True)
    marks, stride = film.marks(), film.stride()
    devices = [Device(2, 2, stride, marks) for _ in range(2)]
    rng = np.random.default_rng(3)
    for sample in range(13):
        for device in devices:
            device.mark(sample)
        for pixel in range(2):
            if sample:
                film.mark(pixel, sample) if sample & (sample - 1) == 0 else None
            color = rng.integers(0, 9, 3).astype(np.float32)
            film.add_samples(pixel, film.channel("Combined"), color[None])
            film.count_samples(pixel, 1)
            device, layer = devices[sample % 2], rng.integers(2)
            device.rows[layer, pixel, :3] += color
            device.counts[layer, pixel] += 1
    rows, counts = film.arrays()
    assert np.array_equal(sum(device.rows.sum(axis=0) for device in devices), rows)
    assert np.array_equal(sum(device.counts.sum(axis=0) for device in devices), counts)
    assert rows[:, [marks + 3, marks + MARK_CHANNELS + 3]].tolist() == [[4, 8]] * 2


def test_without_an_estimate_nothing_is_marked() -> None:
    device = Device(1, 1, 4, NONE)
    device.rows[:] = 1.0
    device.mark(4)
    assert (device.rows == 1.0).all()
