"""The error of single pixels, and where it cannot be known yet: the passes Error and Reliability.

One deviation (luch.accuracy) is one draw: it says little of its own pixel, and next to nothing where a rare path was
missed. So pixels share variances, the larger of those of 7 x 7 and of 11 x 11 neighbours, and a pixel's own deviation
counts where it is larger yet. Measured in four scenes from 64 samples on, 95 % intervals so made hold for 93 to 98 % of
the pixels, and are at most 1.8 times as wide (median) as the pixel's true error asks for; in a box with a caustic, which
no pixel finds by itself, they hold for 93 %. Who has missed such paths stands next to others that found some: where the
shared variance jumps, nothing is sure, and Reliability says so.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from luch.accuracy import F64, box_sum
from luch.curve import correction
from luch.scene import F32, Film

ERROR_PASS = "Error"  # standard error of Combined, (H, W, 3), in its unit
RELIABILITY_PASS = "Reliability"  # (H, W, 1): below one half, the pixel's interval is not to be believed
# Where fewer than two samples tell nothing: files and compositors bear no infinity well.
UNKNOWN_ERROR = np.float32(1e10)
POOL_RADII = 3, 5  # pixels; whose neighbours share a variance
FAR = 8  # pixels; paths that were found so near by may have been missed here
# Variances of neighbours whose ratio may be chance or an edge; in the box with a caustic it leaves 4 to 15 % of the
# misses unflagged, and flags 5 to 25 % of the pixels of scenes without any.
JUMP = 16.0


def _shared(deviation: F32) -> tuple[F64, F64]:
    """Variances that neighbours share, (H, W, 3), NaN where none is known; and squares of the deviations."""
    known = np.isfinite(deviation).all(axis=2, keepdims=True)
    squares = np.where(known, deviation.astype(np.float64) ** 2, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        pools = [
            np.maximum(box_sum(squares, radius), 0.0) / box_sum(known.astype(np.float64), radius)
            for radius in POOL_RADII
        ]
    return np.fmax(*pools), squares


def standard_error(deviation: F32, factor: float = 1.0) -> F32:
    """Standard error of every pixel and channel: (H, W, 3) -> (H, W, 3); NaN where no neighbour is known.

    factor: what luch.curve takes out of deviations of one sequence's parts.
    """
    shared, squares = _shared(deviation)
    return np.asarray(factor * np.sqrt(np.maximum(shared, squares)), dtype=np.float32)


def reliability(deviation: F32) -> F32:
    """1 where the error is like that of its surroundings, towards 0 where these found what it may have missed.

    (H, W, 3) -> (H, W, 1); 0 where nothing is known.
    """
    shared = _shared(deviation)[0].mean(axis=2)
    known = np.isfinite(shared)
    own = np.where(known, shared, 0.0)
    around = _window_max(_window_max(own, FAR, 0), FAR, 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        told = JUMP * own / (JUMP * own + around)
    return np.where(known, np.where(around > 0.0, told, 1.0), 0.0).astype(np.float32)[..., None]


def _window_max(image: F64, radius: int, axis: int) -> F64:
    """Largest of up to 2 radius + 1 neighbours along an axis."""
    image = np.moveaxis(image, axis, 0)
    out = image.copy()
    reach = 0
    while reach < radius:  # what a window knows of its neighbours' windows doubles
        step = min(reach + 1, radius - reach)
        wider = out.copy()
        np.maximum(wider[step:], out[:-step], out=wider[step:])
        np.maximum(wider[:-step], out[step:], out=wider[:-step])
        out, reach = wider, reach + step
    return np.moveaxis(out, 0, axis)


def wanted(film: Film) -> list[str]:
    """Passes of a film that are read from deviations; an AOV may have the name of one."""
    aovs = {name for name, _ in film.aovs}
    return [name for name in film.passes if name in (ERROR_PASS, RELIABILITY_PASS) and name not in aovs]


def passes_of(names: Iterable[str], deviation: F32, share: float, rate: float) -> dict[str, F32]:
    """Those of `names` that are read from deviations. share 0: of independent parts; rate: as luch.curve found it."""
    asked, told = set(names), {}
    if ERROR_PASS in asked:
        error = standard_error(deviation, correction(share, rate))
        told[ERROR_PASS] = np.where(np.isfinite(error), error, UNKNOWN_ERROR)
    if RELIABILITY_PASS in asked:
        told[RELIABILITY_PASS] = reliability(deviation)
    return told
