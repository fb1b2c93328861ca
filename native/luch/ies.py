"""IES photometric files (ANSI/IES LM-63): text -> the table that operation IES reads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

# Candela -> what lamps of 1 W show per W: 4 pi sr over the 177.83 lm/W of daylight (D65), as in Blender.
CANDELA_TO_WATT = 4.0 * np.pi / 177.83
UNREADABLE = 100.0  # what Blender shows for a file that it cannot read


class IesError(ValueError):
    """The text is no IES file that Luch understands; says what and where."""


def parse_ies(text: str) -> F32:
    """The table of a luminaire: [H, V, H angles, V angles (radians), H rows of V values] as one float32 array.

    Raises IesError for a text that is not an IES file of photometric type B or C.
    """
    numbers = _numbers(text)
    count = [int(numbers[k]) for k in (3, 4, 5)]
    v_count, h_count, kind = count
    factor = numbers[2] * numbers[10] * numbers[11] * CANDELA_TO_WATT
    need = 13 + v_count + h_count + v_count * h_count
    if v_count < 1 or h_count < 1 or len(numbers) < need:
        raise IesError(f"IES file: {v_count} x {h_count} values are announced, {len(numbers)} numbers of {need} found.")
    v_angles = numbers[13 : 13 + v_count]
    h_angles = numbers[13 + v_count : 13 + v_count + h_count]
    rows = numbers[13 + v_count + h_count : need].reshape(h_count, v_count) * factor
    if kind == 2:
        h_angles, v_angles, rows = _from_type_b(h_angles, v_angles, rows)
    elif kind == 1:
        h_angles, v_angles, rows = _from_type_c(h_angles, v_angles, rows)
    else:
        raise IesError(f"IES file: photometric type {kind} is not supported; types B (2) and C (1) are.")
    size = [float(len(h_angles)), float(len(v_angles))]
    return np.concatenate([size, np.radians(h_angles), np.radians(v_angles), rows.ravel()]).astype(np.float32)


def constant_ies(value: float = UNREADABLE) -> F32:
    """A luminaire of equal brightness in every direction."""
    beyond = 4.0  # radians: past every angle
    return np.array([2, 2, -1.0, 7.0, -1.0, beyond, value, value, value, value], np.float32)


def _numbers(text: str) -> F64:
    """Everything after the TILT line (and its block, if included)."""
    text = text.replace("\r\n", "\n").replace(",", " ")
    start = text.find("\nTILT=")
    if start < 0:
        raise IesError("IES file: there is no TILT= line.")
    line, _, rest = text[start + 1 :].partition("\n")
    try:
        numbers = np.array([float(word) for word in rest.split()])
    except ValueError as error:
        raise IesError(f"IES file: {error} after the TILT line.") from None
    if line.startswith("TILT=INCLUDE"):
        if len(numbers) < 2:
            raise IesError("IES file: the TILT block is missing.")
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    if len(numbers) < 13:
        raise IesError(f"IES file: 13 numbers must follow the TILT line, {len(numbers)} do.")
    return numbers


def _require(holds: bool, fact: str) -> None:
    if not holds:
        raise IesError(f"IES file: {fact}.")


def _from_type_b(h_angles: F64, v_angles: F64, rows: F64) -> tuple[F64, F64, F64]:
    """Type B turns about the horizontal axis: exchange the angles, mirror to the full range."""
    h_angles, v_angles, rows = v_angles, h_angles, rows.T
    _require(h_angles[-1] == 90.0, f"vertical angles of type B end at {h_angles[-1]}, not 90")
    if h_angles[0] == 0.0:
        h_angles = np.concatenate([90.0 - h_angles[:0:-1], 90.0 + h_angles])
        rows = np.concatenate([rows[:0:-1], rows])
    elif h_angles[0] == -90.0:
        h_angles = h_angles + 90.0
    h_angles = np.append(h_angles, 360.0)
    rows = np.concatenate([rows, rows[:1]])
    _require(v_angles[-1] == 90.0, f"horizontal angles of type B end at {v_angles[-1]}, not 90")
    if v_angles[0] == 0.0:
        v_angles = np.concatenate([90.0 - v_angles[:0:-1], 90.0 + v_angles])
        # Blender repeats values 0 .. V - 2 backwards, then all: the same here, so that lamps look the same.
        rows = np.concatenate([rows[:, -2::-1], rows], axis=1)
    elif v_angles[0] == -90.0:
        v_angles = v_angles + 90.0
    return h_angles, v_angles, rows


def _from_type_c(h_angles: F64, v_angles: F64, rows: F64) -> tuple[F64, F64, F64]:
    """Type C turns about the vertical axis: mirror a quadrant or a half to the full turn."""
    if h_angles[0] == 90.0:
        h_angles = h_angles - 90.0
    _require(h_angles[0] == 0.0, f"horizontal angles of type C begin at {h_angles[0]}, not 0")
    if len(h_angles) == 1:
        h_angles, rows = np.array([0.0, 360.0]), np.concatenate([rows, rows])
    for half_turn in (90.0, 180.0):
        if h_angles[-1] == half_turn:
            h_angles = np.concatenate([h_angles, 2.0 * half_turn - h_angles[-2::-1]])
            rows = np.concatenate([rows, rows[-2::-1]])
    if h_angles[-1] != 360.0:
        gap = 360.0 - h_angles[-1]
        steps = (h_angles[1] - h_angles[0], h_angles[-1] - h_angles[-2])
        _require(gap in steps, f"horizontal angles of type C end at {h_angles[-1]}, not 90, 180 or 360")
        h_angles, rows = np.append(h_angles, 360.0), np.concatenate([rows, rows[:1]])
    first, last = v_angles[0], v_angles[-1]
    _require(first == 0.0 or (first == 90.0 and last == 180.0), f"vertical angles of type C span {first} to {last}")
    return h_angles, v_angles, rows
