"""Builds shader programs: a list of operations in SSA form, folded, shared, pruned and given registers.

A *value* is one float of the program (``Value``); a vector or colour is a tuple of three values.
Operations are named as in ``native/include/luch/shade/ops.inc``; what they compute is written there,
once, for the interpreter and for CUDA, and constant folding runs the very same code.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NewType

import numpy as np

from luch._native import core
from luch.scene import Program

Value = NewType("Value", int)
Vector = tuple[Value, Value, Value]

# ProgramFlag of shade/op.h
EMISSION = 1
TRANSPARENT = 2
SURFACE = 4
CONSTANT_EMISSION = 8
LIGHT_PATH = 16
HOLDOUT = 32
EMISSION_FRONT = 64
EMISSION_BACK = 128

# AttributeSlot of shade/op.h: defaults of the mesh
ATTRIBUTE_UV = 0xFFFFFFF0
ATTRIBUTE_COLOR = 0xFFFFFFF1
ATTRIBUTE_GENERATED = 0xFFFFFFF2
ATTRIBUTE_TANGENT = 0xFFFFFFF3

# Closures that light needs (emission, shadows); their operations come first in the program.
_LIGHT_CLOSURES = ("CLOSURE_EMISSION", "CLOSURE_TRANSPARENT", "CLOSURE_HOLDOUT")
_BACKFACING = "POINT_BACKFACING"


@dataclass(frozen=True)
class OpInfo:
    """One line of the native operation table."""

    name: str
    code: int
    inputs: int
    outputs: int
    params: int
    closure: bool
    constant: bool  # depends on inputs, params and tables alone


OPS: dict[str, OpInfo] = {row["name"]: OpInfo(**row) for row in core.shade.op_table()}


@dataclass(frozen=True)
class _Node:
    """One operation of the program; ``first`` is its first output value."""

    op: OpInfo
    inputs: tuple[Value, ...]
    params: tuple[int, ...]
    first: int


def float_word(x: float) -> int:
    """The 32 bits of a float, as a static word."""
    return int(struct.unpack("<I", struct.pack("<f", x))[0])


def _single(x: float) -> float:
    return float(np.float32(x))


class ProgramBuilder:
    """Collects operations; ``finish`` makes the program. Raises KeyError for an unknown operation."""

    def __init__(self) -> None:
        self._constants: dict[int, Value] = {}  # bits -> value
        self._constant_of: dict[int, float] = {}  # value -> float
        self._made_by: dict[int, _Node] = {}  # value -> operation
        self._shared: dict[tuple[str, tuple[int, ...], tuple[int, ...]], tuple[Value, ...]] = {}
        self._closures: list[_Node] = []
        self._tables: list[np.ndarray] = []
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
            self._constant_of[value] = _single(x)
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
            node = _Node(info, read, words, first)
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
        self._closures.append(_Node(info, read, words, -1))

    # -- slots --------------------------------------------------------------------------------

    def table(self, data: np.ndarray) -> int:
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
        total = np.zeros(3)
        for node in self._closures:
            if node.op.name == "CLOSURE_EMISSION":
                known = self.known_vector(node.inputs[:3])
                if known is None:
                    return None
                total += known
            elif _emits(node):  # attenuated by its coat
                return None
        return float(total[0]), float(total[1]), float(total[2])

    def emission_bound(self) -> tuple[float, float, float]:
        """Summed emission with 1 in place of every factor that is not known: a guess of its size."""
        total = np.zeros(3)
        for node in self._closures:
            if node.op.name == "CLOSURE_EMISSION":
                total += [self._guess(value) for value in node.inputs[:3]]
            elif _emits(node):  # inputs: weight, ..., emission colour and strength, film
                glow = zip(node.inputs[:3], node.inputs[-6:-3], strict=True)
                total += [self._guess(weight) * self._guess(color) for weight, color in glow]
        return float(total[0]), float(total[1]), float(total[2])

    def finish(self) -> Program:
        """Schedules, allocates registers and encodes. The builder may go on being used."""
        schedule = self._schedule()
        code, constants, register_count = self._encode(schedule)
        return Program(
            code=code,
            constants=constants,
            register_count=register_count,
            flags=self._flags(schedule),
            tables=np.concatenate(self._tables) if self._tables else np.zeros(0, np.float32),
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
        registers = [*range(len(numbers), len(numbers) + info.outputs), *range(len(numbers))]
        tables = np.concatenate(self._tables) if self._tables else np.zeros(0, np.float32)
        code = np.array([info.code, len(words), *registers, *words], np.uint32)
        count = len(numbers) + info.outputs
        result = core.shade.run_program(code, np.array(numbers, np.float32), count, tables, 1)["registers"]
        return tuple(self.constant(float(result[len(numbers) + k, 0])) for k in range(info.outputs))

    def _guess(self, value: Value) -> float:
        known = self.known(value)
        if known is not None:
            return known
        node = self._made_by[value]
        if node.op.name == "MATH_MULTIPLY":
            return self._guess(node.inputs[0]) * self._guess(node.inputs[1])
        return 1.0

    def _schedule(self) -> list[_Node]:
        """Every operation that a closure needs, once, before its first use; light's closures first."""
        order: list[_Node] = []
        done: set[int] = set()
        roots = sorted(self._closures, key=lambda node: not (node.op.name in _LIGHT_CLOSURES or _emits(node)))
        for root in roots:
            stack: list[tuple[_Node, bool]] = [(root, False)]
            while stack:
                node, ready = stack.pop()
                if id(node) in done:
                    continue
                if ready:
                    done.add(id(node))
                    order.append(node)
                    continue
                stack.append((node, True))
                parents = [self._made_by[value] for value in node.inputs if value in self._made_by]
                stack.extend((parent, False) for parent in reversed(parents) if id(parent) not in done)
        return order

    def _encode(self, schedule: list[_Node]) -> tuple[np.ndarray, np.ndarray, int]:
        """Registers by linear scan: a register is free again after its value's last use."""
        last_use: dict[int, int] = {}
        for at, node in enumerate(schedule):
            for value in node.inputs:
                last_use[value] = at
        used = [value for value in self._constant_of if value in last_use]
        register = {value: k for k, value in enumerate(used)}
        constants = np.array([self._constant_of[value] for value in used], np.float32)
        count, free, code = len(used), list[int](), list[int]()
        for at, node in enumerate(schedule):
            ending = {v for v in node.inputs if last_use[v] == at and v not in self._constant_of}
            read = [register[value] for value in node.inputs]
            free.extend(sorted({register[value] for value in ending}, reverse=True))
            written, unused = [], []
            for output in range(node.first, node.first + node.op.outputs):
                if not free:
                    free.append(count)
                    count += 1
                register[output] = free.pop()
                written.append(register[output])
                if output not in last_use:
                    unused.append(register[output])
            free.extend(unused)
            code.extend([node.op.code, len(node.params), *written, *read, *node.params])
        return np.array(code, np.uint32), constants, count

    def _flags(self, schedule: list[_Node]) -> int:
        flags = 0
        for node in schedule:
            name = node.op.name
            if name == "CLOSURE_EMISSION":
                flags |= EMISSION
            elif name == "CLOSURE_TRANSPARENT":
                flags |= TRANSPARENT
            elif name == "CLOSURE_HOLDOUT":
                flags |= HOLDOUT
            elif name.startswith("CLOSURE_"):
                flags |= SURFACE
                if name == "CLOSURE_PRINCIPLED":  # params: bump correction, multiscatter, emits, lets through
                    flags |= (EMISSION if node.params[2] else 0) | (TRANSPARENT if node.params[3] else 0)
            elif name.startswith("LIGHT_PATH"):
                flags |= LIGHT_PATH
        if flags & EMISSION:
            if self.emission() is not None:
                flags |= CONSTANT_EMISSION
            else:
                flags |= EMISSION_FRONT if self._dark_when(schedule, 1.0) else 0
                flags |= EMISSION_BACK if self._dark_when(schedule, 0.0) else 0
        return flags

    def _dark_when(self, schedule: list[_Node], backfacing: float) -> bool:
        """Whether emission is known to be zero when Geometry > Backfacing has the given value."""
        if not any(node.op.name == _BACKFACING for node in schedule):
            return False
        known = dict(self._constant_of)
        tables = np.concatenate(self._tables) if self._tables else np.zeros(0, np.float32)
        for node in schedule:
            if _emits(node):
                return False
            if node.op.name == "CLOSURE_EMISSION" and any(known.get(value) != 0.0 for value in node.inputs[:3]):
                return False
            if node.op.closure:
                continue
            numbers = [known.get(value) for value in node.inputs]
            if node.op.name == _BACKFACING:
                known[node.first] = backfacing
            elif node.op.name == "MATH_MULTIPLY" and 0.0 in numbers:
                known[node.first] = 0.0
            elif node.op.constant and None not in numbers:
                n = len(numbers)
                layout = [*range(n, n + node.op.outputs), *range(n), *node.params]
                code = np.array([node.op.code, len(node.params), *layout], np.uint32)
                count = n + node.op.outputs
                run = core.shade.run_program(code, np.array(numbers, np.float32), count, tables, 1)
                for k in range(node.op.outputs):
                    known[node.first + k] = float(run["registers"][n + k, 0])
        return True


def _emits(node: _Node) -> bool:
    """Whether a Principled closure carries its emission itself (see OpClosurePrincipled)."""
    return node.op.name == "CLOSURE_PRINCIPLED" and bool(node.params[2])


def _slot[T](slots: list[T], item: T) -> int:
    if item not in slots:
        slots.append(item)
    return slots.index(item)
