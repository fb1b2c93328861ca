"""The compiler: walks a flattened node tree from its output and asks an emitter for every node it meets.

One emitter serves one kind of node::

    @emitter("ShaderNodeMath")
    def math(c: Compiler, node: bpy.types.Node) -> Outputs:
        a, b = c.float(node, "Value"), c.float(node, "Value_001")
        return {"Value": c.builder.op1("MATH_ADD", (a, b))}

- Sockets are named by *identifier*, never by name (names are translated and repeated).
- ``c.float``, ``c.vector``, ``c.color`` read an input: what is linked there, converted as Blender
  converts it, else the socket's own value as constants.
- An emitter returns every output it can, by identifier; operations that nobody uses vanish later.
- ``c.vector_or(node, "Vector", default)`` reads a vector whose unlinked value means something else
  than its numbers (texture coordinates, normals).
- An operation that looks at the point (position, UV, ...) takes ``c.offset_params()`` as its first two
  static words: which corner of the bump stencil is asked for (0: the point itself, 1: one step along
  x, 2: along y) and the filter width. Everything downstream is then emitted once per corner.
- ``c.warn(node, fact)`` tells the user once per material and node.

A closure emitter gets the weight of its closure and adds to the program::

    @closure_emitter("ShaderNodeEmission")
    def emission(c: Compiler, node: bpy.types.Node, weight: Vector) -> None: ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import bpy
from luch.shader import ProgramBuilder, Value, Vector, float_word

Output = Value | Vector
Outputs = dict[str, Output]
Emitter = Callable[["Compiler", Any], Outputs]
ClosureEmitter = Callable[["Compiler", bpy.types.Node, Vector], None]

EMITTERS: dict[str, Emitter] = {}
CLOSURE_EMITTERS: dict[str, ClosureEmitter] = {}

_SCALARS = frozenset({"VALUE", "INT", "BOOLEAN"})


class Context(Protocol):
    """What the compiler asks of the rest of the export."""

    def image_index(self, image: bpy.types.Image | None, user: Any = None, *, tile: int = 0) -> int:
        """Index into luch.Scene.images of an image's pixels at this frame; a magenta marker without pixels."""

    def warn(self, text: str, effect: str = "") -> None:
        """Adds one sentence to the scene's warnings. effect: of luch.effects, that is missing here."""

    scene: bpy.types.Scene
    view_layer: bpy.types.ViewLayer

    def object_matrix(self, obj: bpy.types.Object) -> Any:
        """World matrix of an object as evaluated, (4, 4) float64."""


def emitter(*kinds: str) -> Callable[[Emitter], Emitter]:
    """Registers a function for nodes of these bl_idnames."""

    def register(function: Emitter) -> Emitter:
        for kind in kinds:
            EMITTERS[kind] = function
        return function

    return register


def closure_emitter(*kinds: str) -> Callable[[ClosureEmitter], ClosureEmitter]:
    """Registers a function for closure nodes of these bl_idnames."""

    def register(function: ClosureEmitter) -> ClosureEmitter:
        for kind in kinds:
            CLOSURE_EMITTERS[kind] = function
        return function

    return register


class Compiler:
    """One node tree on its way to a program."""

    def __init__(self, tree: bpy.types.NodeTree, owner: str, context: Context) -> None:
        self.tree = tree
        self.owner = owner  # 'Material "Gold"', for warnings
        self.context = context
        self.builder = ProgramBuilder()
        self.pass_index = 0.0  # Object Info > Material Index
        self.bump_correction = True  # lifts bumped normals so that reflections leave the surface
        self.surface_normal: Vector | None = None  # where displacement is shown as bump
        self._links = {(link.to_node.name, link.to_socket.identifier): link for link in tree.links if link.is_valid}
        self._used = {(link.from_node.name, link.from_socket.identifier) for link in self._links.values()}
        self._outputs: dict[tuple[str, int, float], Outputs] = {}
        self._offset = 0  # corner of the bump stencil
        self._filter_width = 0.0
        self._warned: set[tuple[str, str]] = set()
        self._open: list[str] = []  # nodes being emitted, to find loops

    # -- reading inputs -----------------------------------------------------------------------

    def output_used(self, node: bpy.types.Node, identifier: str) -> bool:
        """Whether anything reads the output."""
        return (node.name, identifier) in self._used

    def is_linked(self, node: bpy.types.Node, identifier: str) -> bool:
        """Whether something feeds the input."""
        return self._link(node, identifier) is not None

    def source(self, node: bpy.types.Node, identifier: str) -> bpy.types.Node | None:
        """The node that feeds the input; None if nothing does."""
        link = self._link(node, identifier)
        return link.from_node if link is not None else None

    def float(self, node: bpy.types.Node, identifier: str) -> Value:
        """Input as one float: a colour gives its luminance, a vector its mean."""
        link = self._link(node, identifier)
        if link is None:
            return self._default(node, identifier)[0]
        return self._to_float(self._follow(link), link.from_socket.type)

    def vector(self, node: bpy.types.Node, identifier: str) -> Vector:
        """Input as three floats: a float is repeated."""
        link = self._link(node, identifier)
        if link is None:
            default = self._default(node, identifier)
            return (default * 3)[:3] if len(default) == 1 else default[:3]  # type: ignore[return-value]
        return self.to_vector(self._follow(link))

    def color(self, node: bpy.types.Node, identifier: str) -> Vector:
        """Input as scene-linear red, green, blue."""
        return self.vector(node, identifier)

    def vector_or(self, node: bpy.types.Node, identifier: str, default: Callable[[], Vector]) -> Vector:
        """Input as three floats, ``default()`` where nothing is linked."""
        return self.vector(node, identifier) if self.is_linked(node, identifier) else default()

    def closure(self, node: bpy.types.Node, identifier: str, weight: Vector) -> None:
        """Adds the closures that feed the input, times weight. Nothing linked: black."""
        link = self._link(node, identifier)
        if link is None or all(self.builder.known(value) == 0.0 for value in weight):
            return
        source = link.from_node
        if link.from_socket.type != "SHADER":  # a colour shown as emission, as Cycles does
            self.builder.closure("CLOSURE_EMISSION", self.builder.modulate(weight, self.to_vector(self._follow(link))))
            return
        emit = CLOSURE_EMITTERS.get(source.bl_idname)
        if emit is None:
            self.warn(source, "is not supported yet; it shows black")
            return
        with self._entered(source):
            emit(self, source, weight)

    # -- conversions --------------------------------------------------------------------------

    def to_vector(self, output: Output) -> Vector:
        """A float repeated three times, or the vector itself."""
        return output if isinstance(output, tuple) else (output, output, output)

    def luminance(self, color: Vector) -> Value:
        """Rec.709 luminance of a scene-linear colour."""
        return self.builder.op1("COLOR_LUMINANCE", color)

    def average(self, vector: Vector) -> Value:
        """Mean of three values."""
        return self.builder.op1("VECTOR_AVERAGE", vector)

    # -- bump ---------------------------------------------------------------------------------

    def offset_params(self) -> tuple[int, int]:
        """The two static words that every operation on the point starts with."""
        return self._offset, float_word(self._filter_width if self._offset else 0.0)

    @contextmanager
    def at_offset(self, corner: int, filter_width: float) -> Iterator[None]:
        """Emits what follows at a corner of the bump stencil (0, 1, 2)."""
        before = self._offset, self._filter_width
        self._offset, self._filter_width = corner, filter_width if corner else 0.0
        try:
            yield
        finally:
            self._offset, self._filter_width = before

    # -- messages -----------------------------------------------------------------------------

    def warn(self, node: bpy.types.Node, fact: str, effect: str = "") -> None:
        """One warning per node and fact, naming both. effect: of luch.effects, that is missing here."""
        label = node.label or node.bl_label
        if (label, fact) not in self._warned:
            self._warned.add((label, fact))
            self.context.warn(f'{self.owner}: node "{label}" {fact}.', effect)

    # -- inside -------------------------------------------------------------------------------

    def _link(self, node: bpy.types.Node, identifier: str) -> bpy.types.NodeLink | None:
        """What feeds an input. A value of a node that is not known feeds nothing: the input's own counts, as in Cycles.
        What a closure or a medium is, those who read it ask."""
        link = self._links.get((node.name, identifier))
        if link is None or link.from_node.bl_idname in EMITTERS or link.from_socket.type == "SHADER":
            return link
        self.warn(link.from_node, "is not supported; the input that it feeds keeps its own value")
        return None

    def _follow(self, link: bpy.types.NodeLink) -> Output:
        node, identifier = link.from_node, link.from_socket.identifier
        key = (node.name, self._offset, self._filter_width)
        if key not in self._outputs:
            with self._entered(node):
                self._outputs[key] = EMITTERS[node.bl_idname](self, node)
        outputs = self._outputs[key]
        if identifier not in outputs:
            if outputs:
                self.warn(node, f'has no output "{link.from_socket.name}" in Luch yet; 0 is used')
            return self.builder.constant(0.0)
        return outputs[identifier]

    @contextmanager
    def _entered(self, node: bpy.types.Node) -> Iterator[None]:
        if node.name in self._open:
            raise RecursionError(f'{self.owner}: node "{node.name}" feeds itself. Remove the loop of links.')
        self._open.append(node.name)
        try:
            yield
        finally:
            self._open.pop()

    def _to_float(self, output: Output, socket_type: str) -> Value:
        if not isinstance(output, tuple):
            return output
        return self.luminance(output) if socket_type == "RGBA" else self.average(output)

    def _default(self, node: bpy.types.Node, identifier: str) -> tuple[Value, ...]:
        socket = find_socket(node.inputs, identifier)
        value = getattr(socket, "default_value", 0.0)
        if isinstance(value, (int, float)):
            return (self.builder.constant(float(value)),)
        return tuple(self.builder.constant(float(number)) for number in value)


def find_socket(sockets: Any, identifier: str) -> bpy.types.NodeSocket:
    """The socket with this identifier; raises KeyError with what exists."""
    for socket in sockets:
        if socket.identifier == identifier:
            return socket  # type: ignore[no-any-return]
    raise KeyError(f"no socket {identifier!r}; there are {[socket.identifier for socket in sockets]}")
