"""Changes shader programs that are finished: closures left out, inputs set to numbers, everything else as it was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from luch.effects.closures import input_places
from luch.effects.programs import decode
from luch.scene import Program
from luch.shader_code import Node, Value, encode, program_flags, schedule


class Editor:
    """One program's values while it is changed."""

    def __init__(self, program: Program) -> None:
        self.nodes, self.constants = decode(program)
        self._next = max([len(self.constants), *(node.first + node.op.outputs for node in self.nodes)])

    def constant(self, number: float) -> Value:
        """A value that is this number."""
        value = Value(self._next)
        self._next += 1
        self.constants[value] = number
        return value

    def with_input(self, closure: Node, name: str, number: float) -> Node:
        """A closure one of whose inputs (every component of it) is the number now. Raises KeyError for another name."""
        first, count = input_places(closure.op.name)[name]
        return self.with_place(closure, first, count, number)

    def with_place(self, node: Node, first: int, count: int, number: float) -> Node:
        """An operation whose inputs [first, first + count) are the number now."""
        inputs = list(node.inputs)
        inputs[first : first + count] = [self.constant(number)] * count
        return replace(node, inputs=tuple(inputs))


# What is to become of an operation; None: it is left out, if it is a closure.
Change = Callable[[Editor, Node], Node | None]


def rewrite(program: Program, change: Change) -> Program:
    """The program with each of its operations changed. What no closure reads any more is gone, too.

    Raises ValueError if the words are no program.
    """
    editor = Editor(program)
    changed = [found for node in editor.nodes if (found := change(editor, node)) is not None]
    made_by: dict[int, Node] = {node.first + k: node for node in changed for k in range(node.op.outputs)}
    order = schedule([node for node in changed if node.op.closure], made_by)
    code, constants, register_count = encode(order, editor.constants)
    flags = program_flags(order, editor.constants, program.tables)
    return replace(program, code=code, constants=constants, register_count=register_count, flags=flags)
