"""Builds shader programs: a list of operations in SSA form, folded, shared, pruned and given registers.

A *value* is one float of the program (``Value``); a vector or colour is a tuple of three values.
Operations are named as in ``native/include/luch/shade/ops.inc``; what they compute is written there,
once, for the interpreter and for CUDA, and constant folding runs the very same code.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from luch.scene import F32, Program
from luch.shader_code import (
    ATTRIBUTE_COLOR,
    ATTRIBUTE_GENERATED,
    ATTRIBUTE_TANGENT,
    ATTRIBUTE_UV,
    CONSTANT_EMISSION,
    EMISSION,
    EMISSION_BACK,
    EMISSION_FRONT,
    HOLDOUT,
    LIGHT_PATH,
    OPS,
    SURFACE,
    TRANSPARENT,
    Node,
    OpInfo,
    Value,
    Vector,
    constant_emission,
    emits,
    encode,
    float_word,
    program_flags,
    run_constant,
    schedule,
    word_float,
)

__all__ = [
    "ATTRIBUTE_COLOR",
    "ATTRIBUTE_GENERATED",
    "ATTRIBUTE_TANGENT",
    "ATTRIBUTE_UV",
    "CONSTANT_EMISSION",
    "EMISSION",
    "EMISSION_BACK",
    "EMISSION_FRONT",
    "HOLDOUT",
    "LIGHT_PATH",
    "OPS",
    "SURFACE",
    "TRANSPARENT",
    "OpInfo",
    "ProgramBuilder",
    "Value",
    "Vector",
    "float_word",
]


class ProgramBuilder:
    """Collects operations; ``finish`` makes the program. Raises KeyError for an unknown operation."""

    def __init__(self) -> None:
        self._constants: dict[int, Value] = {}  # bits -> value
        self._constant_of: dict[int, float] = {}  # value -> float
        self._made_by: dict[int, Node] = {}  # value -> operation
        self._shared: dict[tuple[str, tuple[int, ...], tuple[int, ...]], tuple[Value, ...]] = {}
        self._closures: list[Node] = []
        self._tables: list[F32] = []
        self._table_offsets: dict[bytes, int] = {}
        self._table_size = 0
        self._images: list[int] = []
        self._attributes: list[str] = []
        self._aovs: list[str] = []
        self._next = 0

    # -- values -------------------------------------------------------------------------------

    def constant(self, x: float) -> Value:
        """A value known now (rounded to float32)."""
        bits = float_word(x)
        if bits not in self._constants:
            value = self._new(1)
            self._constants[bits] = value
            self._constant_of[value] = word_float(bits)
        return self._constants[bits]

    def vector(self, x: float, y: float, z: float) -> Vector:
        """Three constants."""
        return self.constant(x), self.constant(y), self.constant(z)

    def known(self, value: Value) -> float | None:
        """The number behind a constant value, None if it is computed at render time."""
        return self._constant_of.get(value)

    def known_vector(self, vector: Sequence[Value]) -> tuple[float, ...] | None:
        """The numbers behind a vector, None unless all are known."""
        numbers = tuple(self._constant_of.get(value) for value in vector)
        return None if None in numbers else numbers  # type: ignore[return-value]

    def op(self, name: str, inputs: Iterable[Value] = (), params: Iterable[int] = ()) -> tuple[Value, ...]:
        """Outputs of an operation; folded if its inputs are known, shared if it was asked before."""
        info, read, words = OPS[name], tuple(inputs), tuple(int(word) for word in params)
        if len(read) != info.inputs or len(words) < info.params:
            raise ValueError(
                f"operation {name} takes {info.inputs} inputs and {info.params} params, got {len(read)} and {len(words)}"
            )
        simple = self._simplify(name, read)
        if simple is not None:
            return (simple,)
        if info.constant and all(value in self._constant_of for value in read):
            return self._fold(info, read, words)
        key = (name, read, words)
        if key not in self._shared:
            first = self._new(info.outputs)
            node = Node(info, read, words, first)
            outputs = tuple(Value(first + k) for k in range(info.outputs))
            for value in outputs:
                self._made_by[value] = node
            self._shared[key] = outputs
        return self._shared[key]

    def op1(self, name: str, inputs: Iterable[Value] = (), params: Iterable[int] = ()) -> Value:
        """The single output of an operation."""
        (value,) = self.op(name, inputs, params)
        return value

    def op3(self, name: str, inputs: Iterable[Value] = (), params: Iterable[int] = ()) -> Vector:
        """The vector that an operation gives."""
        x, y, z = self.op(name, inputs, params)
        return x, y, z

    def each(self, name: str, *vectors: Vector, params: Iterable[int] = ()) -> Vector:
        """A scalar operation on each component."""
        words = tuple(params)
        x, y, z = (self.op1(name, [vector[k] for vector in vectors], words) for k in range(3))
        return x, y, z

    def multiply(self, a: Value, b: Value) -> Value:
        """a * b"""
        return self.op1("MATH_MULTIPLY", (a, b))

    def scale(self, a: Vector, s: Value) -> Vector:
        """a * s"""
        return self.multiply(a[0], s), self.multiply(a[1], s), self.multiply(a[2], s)

    def modulate(self, a: Vector, b: Vector) -> Vector:
        """a * b, component by component"""
        return self.each("MATH_MULTIPLY", a, b)

    def closure(
        self, name: str, weight: Vector | None, inputs: Iterable[Value] = (), params: Iterable[int] = ()
    ) -> None:
        """Adds a closure. One whose weight is known to be zero vanishes; weight None: an AOV store."""
        if weight is not None and all(self.known(value) == 0.0 for value in weight):
            return
        info = OPS[name]
        read = (*(weight or ()), *inputs)
        words = tuple(int(word) for word in params)
        if len(read) != info.inputs or len(words) < info.params:
            raise ValueError(f"closure {name} takes {info.inputs} inputs (weight included), got {len(read)}")
        self._closures.append(Node(info, read, words, -1))

    # -- slots --------------------------------------------------------------------------------

    def table(self, data: F32) -> int:
        """Offset of a table of floats; equal tables are stored once."""
        flat = np.ascontiguousarray(data, np.float32).ravel()
        key = flat.tobytes()
        if key not in self._table_offsets:
            self._table_offsets[key] = self._table_size
            self._tables.append(flat)
            self._table_size += flat.size
        return self._table_offsets[key]

    def image(self, index: int) -> int:
        """Slot of an image of the scene."""
        return _slot(self._images, index)

    def attribute(self, name: str) -> int:
        """Slot of a mesh attribute."""
        return _slot(self._attributes, name)

    def aov(self, name: str) -> int:
        """Slot of an AOV of the film."""
        return _slot(self._aovs, name)

    # -- the program --------------------------------------------------------------------------

    def emission(self) -> tuple[float, float, float] | None:
        """Summed emission if it is the same everywhere, else None."""
        return constant_emission(self._closures, self._constant_of)

    def emission_bound(self) -> tuple[float, float, float]:
        """Summed emission with 1 in place of every factor that is not known: a guess of its size."""
        total = np.zeros(3)
        for node in self._closures:
            if node.op.name == "CLOSURE_EMISSION":
                total += [self._guess(value) for value in node.inputs[:3]]
            elif emits(node):  # inputs: weight, ..., emission colour and strength, film
                glow = zip(node.inputs[:3], node.inputs[-6:-3], strict=True)
                total += [self._guess(weight) * self._guess(color) for weight, color in glow]
        return float(total[0]), float(total[1]), float(total[2])

    def finish(self) -> Program:
        """Schedules, allocates registers and encodes. The builder may go on being used."""
        order = schedule(self._closures, self._made_by)
        code, constants, register_count = encode(order, self._constant_of)
        tables = self._all_tables()
        return Program(
            code=code,
            constants=constants,
            register_count=register_count,
            flags=program_flags(order, self._constant_of, tables),
            tables=tables,
            images=list(self._images),
            attributes=list(self._attributes),
            aovs=list(self._aovs),
        )

    # -- inside -------------------------------------------------------------------------------

    def _new(self, count: int) -> Value:
        first = self._next
        self._next += count
        return Value(first)

    def _simplify(self, name: str, read: tuple[Value, ...]) -> Value | None:
        """x * 1, x * 0, x + 0, x - 0; None if there is nothing to see."""
        if name not in ("MATH_MULTIPLY", "MATH_ADD", "MATH_SUBTRACT"):
            return None
        a, b = (self.known(value) for value in read)
        if name == "MATH_MULTIPLY":
            if a == 0.0 or b == 0.0:
                return self.constant(0.0)
            return read[1] if a == 1.0 else read[0] if b == 1.0 else None
        if b == 0.0:
            return read[0]
        return read[1] if a == 0.0 and name == "MATH_ADD" else None

    def _fold(self, info: OpInfo, read: tuple[Value, ...], words: tuple[int, ...]) -> tuple[Value, ...]:
        numbers = [self._constant_of[value] for value in read]
        return tuple(self.constant(number) for number in run_constant(info, numbers, words, self._all_tables()))

    def _all_tables(self) -> F32:
        return np.concatenate(self._tables) if self._tables else np.zeros(0, np.float32)

    def _guess(self, value: Value) -> float:
        known = self.known(value)
        if known is not None:
            return known
        node = self._made_by[value]
        if node.op.name == "MATH_MULTIPLY":
            return self._guess(node.inputs[0]) * self._guess(node.inputs[1])
        return 1.0


def _slot[T](slots: list[T], item: T) -> int:
    if item not in slots:
        slots.append(item)
    return slots.index(item)
