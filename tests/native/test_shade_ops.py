"""Shader operations against numpy in double precision."""

from __future__ import annotations

import colorsys
from collections.abc import Callable

import numpy as np
import pytest
from luch import core
from luch.shader import OPS
from numpy.typing import NDArray

F64 = NDArray[np.float64]
LANES = core.shade.LANES


def run_op(name: str, inputs: F64, params: tuple[int, ...] = (), tables: F64 | None = None) -> F64:
    """Outputs (outputs, N) of an operation that reads no point; inputs: (inputs, N), one run a column."""
    info = OPS[name]
    columns = []
    registers = [*range(len(inputs), len(inputs) + info.outputs), *range(len(inputs))]
    code = np.array([info.code, len(params), *registers, *params], np.uint32)
    table = np.zeros(0, np.float32) if tables is None else np.asarray(tables, np.float32)
    for column in inputs.T:
        run = core.shade.run_program(code, column.astype(np.float32), len(registers), table, 1)
        columns.append(run["registers"][len(inputs) :, 0])
    return np.array(columns, np.float64).T


def samples(count: int, low: float = -3.0, high: float = 3.0, rows: int = 1) -> F64:
    rng = np.random.default_rng(1)
    return rng.uniform(low, high, (rows, count)).astype(np.float32).astype(np.float64)


UNARY: dict[str, Callable[[F64], F64]] = {
    "SQRT": lambda a: np.sqrt(np.maximum(a, 0)),
    "INVERSE_SQRT": lambda a: np.where(a > 0, 1 / np.sqrt(np.maximum(a, 1e-30)), 0),
    "EXPONENT": np.exp,
    "SIGN": np.sign,
    "ROUND": lambda a: np.floor(a + 0.5),
    "TRUNC": np.trunc,
    "FRACT": lambda a: a - np.floor(a),
    "SINE": np.sin,
    "COSINE": np.cos,
    "TANGENT": np.tan,
    "ARCSINE": lambda a: np.arcsin(np.clip(a, -1, 1)),
    "ARCCOSINE": lambda a: np.arccos(np.clip(a, -1, 1)),
    "ARCTANGENT": np.arctan,
    "SINH": np.sinh,
    "COSH": np.cosh,
    "TANH": np.tanh,
    "DEGREES": np.degrees,
}
BINARY: dict[str, Callable[[F64, F64], F64]] = {
    "DIVIDE": lambda a, b: a / b,
    "MODULO": np.fmod,
    "FLOORED_MODULO": np.mod,
    "SNAP": lambda a, b: np.floor(a / b) * b,
    "ARCTAN2": np.arctan2,
    "PINGPONG": lambda a, b: np.abs(np.mod((a - b) / (2 * b), 1.0) * 2 * b - b),
}


@pytest.mark.parametrize("mode", UNARY)
def test_math_of_one_number_is_what_numpy_computes(mode: str) -> None:
    a = samples(40)
    expected = UNARY[mode](a[0])
    np.testing.assert_allclose(run_op(f"MATH_{mode}", a)[0], expected, rtol=3e-6, atol=3e-6)


@pytest.mark.parametrize("mode", BINARY)
def test_math_of_two_numbers_is_what_numpy_computes(mode: str) -> None:
    a = samples(40, rows=2)
    jumps = mode in ("MODULO", "FLOORED_MODULO", "SNAP")
    expected, got = BINARY[mode](*a), run_op(f"MATH_{mode}", a)[0]
    close = np.isclose(got, expected, rtol=3e-6, atol=2e-6)
    assert close.mean() >= (0.95 if jumps else 1.0)


@pytest.mark.parametrize(
    ("mode", "inputs", "expected"),
    [
        ("DIVIDE", (1.0, 0.0), 0.0),
        ("SQRT", (-1.0,), 0.0),
        ("LOGARITHM", (-1.0, 2.0), 0.0),
        ("LOGARITHM", (2.0, 1.0), 0.0),
        ("POWER", (0.0, 0.0), 1.0),
        ("POWER", (-8.0, 3.0), -512.0),
        ("POWER", (-8.0, 0.5), 0.0),
        ("POWER", (0.0, -1.0), 0.0),
        ("MODULO", (1.0, 0.0), 0.0),
        ("WRAP", (1.0, 2.0, 2.0), 2.0),
        ("PINGPONG", (1.0, 0.0), 0.0),
        ("ARCTAN2", (0.0, 0.0), 0.0),
        ("COMPARE", (1.0, 1.0, 0.0), 1.0),
        ("ARCSINE", (2.0,), np.pi / 2),
    ],
)
def test_math_is_defined_everywhere(mode: str, inputs: tuple[float, ...], expected: float) -> None:
    got = run_op(f"MATH_{mode}", np.array([inputs]).T)[0, 0]
    assert got == pytest.approx(expected, rel=1e-6)


def test_hue_saturation_value_goes_there_and_back() -> None:
    colors = samples(60, 0.0, 1.0, rows=3)
    there = run_op("RGB_TO_HSV", colors)
    expected = np.array([colorsys.rgb_to_hsv(*color) for color in colors.T]).T
    np.testing.assert_allclose(there, expected, atol=2e-6)
    np.testing.assert_allclose(run_op("HSV_TO_RGB", there), colors, atol=3e-6)
    np.testing.assert_allclose(run_op("HSL_TO_RGB", run_op("RGB_TO_HSL", colors)), colors, atol=3e-6)


def test_euler_matrix_turns_x_first_then_y_then_z() -> None:
    angles = np.array([[0.4], [-0.7], [1.1]])
    columns = run_op("EULER_MATRIX", angles)[:, 0].reshape(3, 3).T

    def turn(axis: int, angle: float) -> F64:
        matrix, (i, j) = np.eye(3), [(1, 2), (2, 0), (0, 1)][axis]
        matrix[i, i] = matrix[j, j] = np.cos(angle)
        matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
        return matrix

    expected = turn(2, angles[2, 0]) @ turn(1, angles[1, 0]) @ turn(0, angles[0, 0])
    np.testing.assert_allclose(columns, expected, atol=1e-6)


def test_a_table_is_linear_between_its_rows_and_goes_on_straight_outside() -> None:
    words = tuple(int(np.float32(x).view(np.uint32)) for x in (0.0, 1.0))
    table = np.array([0.0, 1.0, 4.0, 9.0])
    x = np.array([[-1.0, 0.0, 0.5, 1.0, 2.0], [1.0] * 5])
    straight = run_op("CURVE", x, (0, 4, 1, 0, 1, *words), table)[0]
    np.testing.assert_allclose(straight, [-3.0, 0.0, 2.5, 9.0, 24.0], rtol=1e-6)
    clamped = run_op("CURVE", x, (0, 4, 1, 0, 0, *words), table)[0]
    np.testing.assert_allclose(clamped, [0.0, 0.0, 2.5, 9.0, 9.0], rtol=1e-6)
    nothing = run_op("CURVE", np.array([[np.nan], [1.0]]), (0, 4, 1, 0, 0, *words), table)
    assert nothing.shape == (1, 1)  # not a number finds a row too, and no crash


def test_total_reflection_refracts_nowhere() -> None:
    grazing = np.array([[0.999, 0.0, -0.045, 0.0, 0.0, 1.0, 1.5]]).T
    np.testing.assert_array_equal(run_op("VECTOR_REFRACT", grazing)[:, 0], 0.0)
