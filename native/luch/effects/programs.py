"""Reads a shader program back: which closures it ends in, and which operations they really depend on.

A program holds only what some closure reads; but a closure does not use all that it reads: the roughness of a
coat of weight 0 changes nothing, whatever texture feeds it. Such inputs are not followed here.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from luch.effects.closures import Closure
from luch.scene import Program
from luch.shader_code import OPS, Node, Value

_OP_OF = {op.code: op for op in OPS.values()}
# Operations without effect while their first input, a strength, is known to be 0.
_BY_STRENGTH = ("BUMP", "NORMAL_MAP")
TILED = 2  # ImageFlag of shade/textures/image_nodes.h


@dataclass
class Reading:
    """What a program does."""

    closures: list[Closure] = field(default_factory=list)  # of a weight that is not known to be 0
    nodes: list[Node] = field(default_factory=list)  # operations that those closures depend on
    images: list[int] = field(default_factory=list)  # indices into Scene.images that those operations read
    constants: dict[int, float] = field(default_factory=dict)

    def has(self, *prefixes: str) -> bool:
        """Whether one of the operations has a name that begins so."""
        return any(node.op.name.startswith(prefixes) for node in self.nodes)

    def emission(self) -> tuple[float, float, float] | None:
        """Summed weights of the emission closures; None if they are not known beforehand."""
        total = [0.0, 0.0, 0.0]
        for closure in self.closures:
            if closure.name == "CLOSURE_EMISSION":
                weight = closure.vector("weight")
                if weight is None:
                    return None
                total = [a + b for a, b in zip(total, weight, strict=True)]
        return total[0], total[1], total[2]


def decode(program: Program) -> tuple[list[Node], dict[int, float]]:
    """Operations in SSA form (each output a new value) and the values that are known.

    Raises ValueError if the words are no program.
    """
    constants = {k: float(x) for k, x in enumerate(program.constants)}
    held = {register: Value(register) for register in constants}  # register -> the value that it holds now
    words, at, fresh, nodes = program.code.tolist(), 0, len(constants), list[Node]()
    while at < len(words):
        op = _OP_OF.get(words[at])
        if op is None or at + 2 > len(words):
            raise ValueError(f"word {at} of a shader program is no operation")
        written = at + 2
        read = written + op.outputs
        params = read + op.inputs
        end = params + words[at + 1]
        if end > len(words):
            raise ValueError("a shader program ends within an operation")
        missing = [register for register in words[read:params] if register not in held]
        if missing:
            raise ValueError(f"a shader program reads register {missing[0]} before it is written")
        inputs = tuple(held[register] for register in words[read:params])
        nodes.append(Node(op, inputs, tuple(words[params:end]), fresh))
        for k, register in enumerate(words[written:read]):
            held[register] = Value(fresh + k)
        fresh += op.outputs
        at = end
    return nodes, constants


def read_program(program: Program, aovs: frozenset[str] = frozenset()) -> Reading:
    """Closures and live operations. aovs: names that the film stores; other AOV Outputs are dead."""
    nodes, constants = decode(program)
    made_by = {node.first + k: node for node in nodes for k in range(node.op.outputs)}
    reading = Reading(constants=constants)
    wanted: list[Value] = []
    for node in nodes:
        if node.op.name == "STORE_AOV":
            slot = node.params[0]
            if slot < len(program.aovs) and program.aovs[slot] in aovs:
                wanted.extend(node.inputs)
        elif node.op.closure:
            closure = Closure(node, constants)
            if not closure.is_nothing():
                reading.closures.append(closure)
                wanted.extend(closure.used_inputs())
    live: set[int] = set()
    while wanted:
        found = made_by.get(wanted.pop())
        if found is not None and found.first not in live:
            live.add(found.first)
            # The normal that a bump of strength 0 would have bent is all that is left of it.
            idle = found.op.name in _BY_STRENGTH and constants.get(found.inputs[0]) == 0.0
            wanted.extend(found.inputs[6:] if idle and found.op.name == "BUMP" else () if idle else found.inputs)
    reading.nodes = [node for node in nodes if node.first in live and node.op.outputs and not _idle(node, constants)]
    reading.images = _images(reading.nodes, program)
    return reading


def _idle(node: Node, constants: dict[int, float]) -> bool:
    return node.op.name in _BY_STRENGTH and constants.get(node.inputs[0]) == 0.0


def _images(nodes: list[Node], program: Program) -> list[int]:
    """Indices of the images that operations look up, each once, in order."""
    slots: list[int] = []
    for node in nodes:
        if node.op.name == "IMAGE" and node.params[4] & TILED:
            slots += node.params[6::2]
        elif node.op.name in ("IMAGE", "IMAGE_BOX", "ENVIRONMENT"):
            slots.append(node.params[0])
    return list(dict.fromkeys(program.images[slot] for slot in slots if slot < len(program.images)))
