"""The program builder: folding, sharing, pruning, registers, flags; and programs over many lanes."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core
from luch.scene import Program
from luch.shader import (
    CONSTANT_EMISSION,
    EMISSION,
    EMISSION_BACK,
    EMISSION_FRONT,
    LIGHT_PATH,
    SURFACE,
    TRANSPARENT,
    ProgramBuilder,
    Vector,
)


def position(b: ProgramBuilder) -> Vector:
    return b.op3("POINT_POSITION", (), (0, 0))


def run(program: Program, positions: np.ndarray) -> dict[str, np.ndarray]:
    points = {"position": np.asarray(positions, np.float32)}
    result: dict[str, np.ndarray] = core.shade.run_program(
        program.code, program.constants, program.register_count, program.tables, len(positions), points
    )
    return result


def instructions(program: Program) -> list[str]:
    from luch.shader import OPS

    by_code = {info.code: info for info in OPS.values()}
    names, at = [], 0
    while at < len(program.code):
        info = by_code[int(program.code[at])]
        names.append(info.name)
        at += 2 + info.outputs + info.inputs + int(program.code[at + 1])
    return names


def test_constants_fold_into_one_number() -> None:
    b = ProgramBuilder()
    x = b.op1("MATH_SINE", (b.multiply(b.constant(2.0), b.constant(3.0)),))
    assert b.known(x) == pytest.approx(np.sin(6.0), abs=1e-6)
    b.closure("CLOSURE_EMISSION", (x, x, x))
    assert instructions(b.finish()) == ["CLOSURE_EMISSION"]


def test_equal_operations_are_computed_once() -> None:
    b = ProgramBuilder()
    first, second = (b.op1("VECTOR_LENGTH", position(b)) for _ in range(2))
    assert first == second


def test_what_no_closure_reads_vanishes() -> None:
    b = ProgramBuilder()
    b.op1("MATH_SINE", (position(b)[0],))
    b.closure("CLOSURE_EMISSION", b.vector(1.0, 1.0, 1.0))
    assert instructions(b.finish()) == ["CLOSURE_EMISSION"]


def test_a_closure_of_zero_weight_vanishes_with_all_it_reads() -> None:
    b = ProgramBuilder()
    b.closure("CLOSURE_TRANSPARENT", b.scale(position(b), b.constant(0.0)))
    program = b.finish()
    assert len(program.code) == 0 and program.flags == 0


def test_registers_are_reused() -> None:
    b = ProgramBuilder()
    x = position(b)[0]
    for _ in range(50):
        x = b.op1("MATH_COSINE", (x,))
    b.closure("CLOSURE_EMISSION", (x, x, x))
    assert b.finish().register_count <= 4


def test_a_program_gives_the_same_for_any_number_of_points() -> None:
    b = ProgramBuilder()
    x, y, z = position(b)
    value = b.op1("MATH_MULTIPLY_ADD", (x, y, b.op1("MATH_SINE", (z,))))
    b.closure("CLOSURE_EMISSION", (value, x, b.constant(2.0)))
    program = b.finish()
    points = np.random.default_rng(0).uniform(-2, 2, (200, 3)).astype(np.float32)
    emission = run(program, points)["emission"]
    expected = points[:, 0].astype(float) * points[:, 1] + np.sin(points[:, 2].astype(float))
    np.testing.assert_allclose(emission[:, 0], expected, atol=1e-6)
    np.testing.assert_array_equal(emission[:, 1], points[:, 0])
    np.testing.assert_array_equal(emission[:, 2], 2.0)
    for count in (1, 63, 64, 65):
        np.testing.assert_array_equal(run(program, points[:count])["emission"], emission[:count])


def test_random_programs_survive_register_allocation() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (40, 3)).astype(np.float32)
    for _ in range(20):
        b = ProgramBuilder()
        values = list(position(b))
        numbers = [points[:, k].astype(np.float32) for k in range(3)]
        for _ in range(60):
            i, j = rng.integers(0, len(values), 2)
            name = ("MATH_ADD", "MATH_SUBTRACT", "MATH_MINIMUM")[rng.integers(3)]
            operation = {"MATH_ADD": np.add, "MATH_SUBTRACT": np.subtract, "MATH_MINIMUM": np.minimum}[name]
            values.append(b.op1(name, (values[i], values[j])))
            numbers.append(operation(numbers[i], numbers[j]).astype(np.float32))
        chosen = rng.integers(0, len(values), 3)
        b.closure("CLOSURE_EMISSION", tuple(values[k] for k in chosen))  # type: ignore[arg-type]
        got = run(b.finish(), points)["emission"]
        np.testing.assert_array_equal(got, np.stack([numbers[k] for k in chosen], 1))


def test_flags_say_what_a_program_may_do() -> None:
    b = ProgramBuilder()
    b.closure("CLOSURE_EMISSION", b.vector(1.0, 2.0, 3.0))
    assert b.finish().flags == EMISSION | CONSTANT_EMISSION
    assert b.emission() == (1.0, 2.0, 3.0)
    camera = b.op1("LIGHT_PATH_FLAG", (), (1,))
    b.closure("CLOSURE_TRANSPARENT", (camera, camera, camera))
    b.closure("CLOSURE_DIFFUSE", b.vector(1.0, 1.0, 1.0), [b.constant(0.5)] * 7, (1,))
    assert b.finish().flags == EMISSION | CONSTANT_EMISSION | TRANSPARENT | LIGHT_PATH | SURFACE


@pytest.mark.parametrize(("front", "flag"), [(True, EMISSION_FRONT), (False, EMISSION_BACK)])
def test_emission_on_one_side_is_found(front: bool, flag: int) -> None:
    b = ProgramBuilder()
    side = b.op1("POINT_BACKFACING")
    if front:
        side = b.op1("MATH_SUBTRACT", (b.constant(1.0), side))
    b.closure("CLOSURE_EMISSION", b.scale(position(b), side))
    assert b.finish().flags == EMISSION | flag


def test_light_comes_first_so_that_shadow_rays_stop_early() -> None:
    b = ProgramBuilder()
    b.closure("CLOSURE_DIFFUSE", b.vector(1.0, 1.0, 1.0), [*position(b), *[b.constant(0.0)] * 4], (1,))
    b.closure("CLOSURE_TRANSPARENT", b.vector(0.5, 0.5, 0.5))
    assert instructions(b.finish())[0] == "CLOSURE_TRANSPARENT"


def test_an_operation_with_too_few_inputs_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="MATH_ADD takes 2 inputs"):
        ProgramBuilder().op("MATH_ADD", (ProgramBuilder().constant(1.0),))


def test_a_program_that_names_a_missing_register_is_refused() -> None:
    from luch.shader import OPS

    code = np.array([OPS["MATH_ADD"].code, 0, 9, 0, 1], np.uint32)
    with pytest.raises(ValueError, match="names a register that does not exist"):
        core.shade.run_program(code, np.zeros(2, np.float32), 3, np.zeros(0, np.float32), 1)
