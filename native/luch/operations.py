"""Names for the operations of a shader program, so that a stored program means the same to every core.

A program's words number its operations by their place in ``native/include/luch/shade/ops.inc``, which changes from
version to version. A scene file therefore keeps the signature of each number, and a reader renumbers by it.
"""

from __future__ import annotations

from collections.abc import Sequence

from luch.scene import U32
from luch.shader_code import OPS

Signature = tuple[str, int, int, int]  # name, inputs, outputs, least params


def signatures() -> list[Signature]:
    """Of every operation of this core, in the order of their numbers."""
    table = sorted(OPS.values(), key=lambda op: op.code)
    return [(op.name, op.inputs, op.outputs, op.params) for op in table]


def renumber(code: U32, stored: Sequence[Signature]) -> U32:
    """A program's words in this core's numbers; ``stored[k]`` is what number k meant where the program was made.

    Raises ValueError if an operation is not known here, was changed since, or if the words are no program.
    """
    here = {signature: number for number, signature in enumerate(signatures())}
    result = code.copy()
    at = 0
    while at < len(code):
        number = int(code[at])
        if number >= len(stored) or at + 2 > len(code):
            raise ValueError(f"word {at} of a shader program is no operation")
        name, inputs, outputs, _ = stored[number]
        if stored[number] not in here:
            changed = "has changed since" if name in OPS else "is not known to this Luch"
            raise ValueError(f"the shader operation {name} {changed}")
        result[at] = here[stored[number]]
        at += 2 + outputs + inputs + int(code[at + 1])
    if at != len(code):
        raise ValueError("a shader program ends within an operation")
    return result
