"""Merges renders of one picture: other parts of one seed's samples, or other seeds.

A mergeable picture carries the film's sums, every double as three floats that add up to it exactly. Merged sums are
what one render of all those samples would have added up, in another order; its marks (luch/film/film.h), which its
error is told by, are found among those of the parts.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from luch import accuracy, curve, samplers
from luch._native import core
from luch.scene import F32, F64, Film

FIELD = "luch.sums"  # header: what a mergeable file says of its sums
COUNT_LAYER = "Luch Count"  # two floats: 65,536s and ones
SUM_LAYER = "Luch Sum {:03d}"  # three floats a channel of the film
HALF_WORD = 1 << 16
MARK_CHANNELS = 4


class MergeError(ValueError):
    """Renders that are no parts of one. The message names the files, the fact and the remedy."""


@dataclass
class Sums:
    """The film of one render, or of several merged."""

    film: Film
    origin: tuple[float, float, float]
    rows: F64  # (pixels, channels)
    counts: NDArray[np.uint32]  # (pixels,)
    seed: int
    first_sample: int
    samples: int  # of every pixel
    rate: tuple[float, float]  # as luch.curve.Curve.rate has it
    independent: bool = False  # of several seeds: parts owe each other nothing
    name: str = "render"  # for messages
    sampler: str = samplers.DEFAULT  # whose sequence; "": of several

    @property
    def sequence(self) -> tuple[str, int]:
        """Samples of one sequence know of each other; no two of one may be the same."""
        return self.sampler, self.seed

    def native(self) -> Any:
        """A film of the core that holds these sums."""
        film = core.film.Film(self.film, self.origin, True)
        rows, counts = film.arrays()
        rows[...], counts[...] = self.rows, self.counts
        return film

    def estimate(self) -> accuracy.Estimate | None:
        """The error of the picture."""
        mean, deviation, share = self.native().deviations()
        found = accuracy.estimate(mean, deviation, share)
        return found and curve.corrected(found, 0.0 if self.independent else share, *self.rate)

    def error_passes(self, names: Sequence[str]) -> dict[str, F32]:
        """Those of luch.pixel_error that are among the names."""
        from luch.pixel_error import passes_of

        _, deviation, share = self.native().deviations()
        return passes_of(names, deviation, 0.0 if self.independent else share, self.rate[0])

    def layers(self) -> dict[str, F32]:
        """As images of a file, beside the passes."""
        shape = self.film.size[::-1]
        counts = np.stack([self.counts // HALF_WORD, self.counts % HALF_WORD], axis=-1)
        layers = {COUNT_LAYER: counts.reshape(*shape, 2).astype(np.float32)}
        for channel in range(self.rows.shape[1]):
            rest, parts = self.rows[:, channel], []
            for _ in range(3):
                parts.append(rest.astype(np.float32))
                rest = rest - parts[-1]
            layers[SUM_LAYER.format(channel)] = np.stack(parts, axis=-1).reshape(*shape, 3)
        return layers

    def header(self) -> dict[str, str]:
        """What else a file must say."""
        told = {
            "film": asdict(self.film), "origin": self.origin, "seed": self.seed, "first_sample": self.first_sample,
            "samples": self.samples, "rate": self.rate, "independent": self.independent,
            "channels": self.rows.shape[1], "sampler": self.sampler,
        }  # fmt: skip
        return {FIELD: json.dumps(told)}


def read_sums(path: str | os.PathLike[str]) -> tuple[Sums, dict[str, Any]]:
    """From a mergeable file; and its header. Raises ImageError, MergeError."""
    from luch import image

    layers, header = image.read_exr(path)
    name = os.fspath(path)
    if FIELD not in header:
        raise MergeError(f"{name}: holds no sums. Render it with --mergeable.")
    told = json.loads(header[FIELD])
    named = {group.rpartition(".")[2]: pixels for group, pixels in layers.items()}
    film = _film(told["film"])
    counts = named[COUNT_LAYER].astype(np.float64).reshape(-1, 2)
    channels = (named[SUM_LAYER.format(k)].astype(np.float64).reshape(-1, 3) for k in range(told["channels"]))
    rows = np.stack([parts[:, 0] + parts[:, 1] + parts[:, 2] for parts in channels], axis=1)
    return Sums(
        film, tuple(told["origin"]), rows, (counts[:, 0] * HALF_WORD + counts[:, 1]).astype(np.uint32), told["seed"],
        told["first_sample"], told["samples"], tuple(told["rate"]), told["independent"], name,
        told.get("sampler", samplers.DEFAULT),
    ), header  # fmt: skip


def _film(told: Mapping[str, Any]) -> Film:
    """JSON knows no tuples."""
    lists = {key: tuple(value) for key, value in told.items() if isinstance(value, list)}
    film = Film(**{**told, **lists})
    return replace(
        film, passes=list(film.passes), lightgroups=list(film.lightgroups), aovs=[(a, b) for a, b in film.aovs]
    )


def merge(parts: Sequence[Sums]) -> Sums:
    """One render of all the samples. Raises MergeError."""
    parts = sorted(parts, key=lambda part: (part.sequence, part.first_sample))
    first = parts[0]
    for one, following in itertools.pairwise(parts):
        _check(one, following)
    whole = first.native()
    for part in parts[1:]:
        whole.merge(part.native())
    rows, counts = (array.copy() for array in whole.arrays())
    one_seed = all(part.sequence == first.sequence and not part.independent for part in parts)
    ends = [part.first_sample + part.samples for part in parts]
    joined = one_seed and all(end == part.first_sample for end, part in zip(ends, parts[1:], strict=False))
    samples = sum(part.samples for part in parts)
    marks = whole.marks()
    rows[:, marks : marks + 2 * MARK_CHANNELS] = 0.0
    if joined:
        end = first.first_sample + samples
        power = 1 << max(0, (end - 1).bit_length() - 1)  # the last one before the end
        for sample in (power, power // 2):
            if sample > first.first_sample:
                _mark(rows, parts, sample, marks)
    if not rows[:, marks + MARK_CHANNELS - 1 : marks + 2 * MARK_CHANNELS : MARK_CHANNELS].any():
        _part_between(rows, parts, marks, samples)
    rate = max(parts, key=lambda part: part.samples).rate
    return Sums(
        first.film,
        first.origin,
        rows,
        counts,
        first.seed,
        first.first_sample,
        samples,
        rate,
        not one_seed,
        "merged",
        first.sampler if len({part.sampler for part in parts}) == 1 else "",
    )


def _check(one: Sums, following: Sums) -> None:
    where = f"{one.name} and {following.name}"
    if asdict(one.film) != asdict(following.film) or one.origin != following.origin:
        raise MergeError(f"{where}: their films differ. Render one scene with the same size and passes.")
    end = one.first_sample + one.samples
    if one.sequence == following.sequence and following.first_sample < end:
        raise MergeError(
            f"{where}: both hold sample {following.first_sample} of seed {one.seed}, which would count twice. "
            f"Render one with --first-sample {end}, or with another --seed."
        )


def _mark(rows: F64, parts: Sequence[Sums], sample: int, marks: int) -> None:
    """What lay in the film before that sample, as one render would have kept it, where a part knows it."""
    slot = marks + (0 if sample & 0x55555555 else MARK_CHANNELS)
    before = np.zeros((len(rows), MARK_CHANNELS))
    for part in parts:
        inside = sample - part.first_sample
        if inside <= 0:
            break
        if inside >= part.samples:
            before[:, :3] += part.rows[:, :3]
            before[:, 3] += part.counts
        elif part.rows[:, slot + 3].max() == inside:
            before += part.rows[:, slot : slot + MARK_CHANNELS]
        else:
            return
    rows[:, slot : slot + MARK_CHANNELS] = before


def _part_between(rows: F64, parts: Sequence[Sums], marks: int, samples: int) -> None:
    """The mark lies between two renders, as near to the middle as can be."""
    ends = np.cumsum([part.samples for part in parts])
    until = 1 + int(np.argmin(np.abs(ends[:-1] - samples / 2))) if len(parts) > 1 else 0
    for part in parts[:until]:
        rows[:, marks : marks + 3] += part.rows[:, :3]
        rows[:, marks + 3] += part.counts
