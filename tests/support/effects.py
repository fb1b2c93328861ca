"""Scenes of one triangle with one material, for tests of what effects are on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from luch.effects.closures import input_places
from luch.scene import Instances, Material, Mesh, Object, Program, Scene
from luch.shader import ProgramBuilder, Value
from luch.shader_code import OPS

ONE = (1.0, 1.0, 1.0)
Inputs = dict[str, object]
# A Principled BSDF as Blender adds it.
PLAIN: Inputs = {
    "base_color": (0.8, 0.8, 0.8), "metallic": 0.0, "roughness": 0.5, "ior": 1.5, "thin_wall": 0.0,
    "specular_ior_level": 0.5, "specular_tint": ONE, "coat_roughness": 0.03, "coat_ior": 1.5, "coat_tint": ONE,
    "sheen_roughness": 0.5, "sheen_tint": ONE, "emission_strength": 1.0, "thin_film_ior": 1.33,
}  # fmt: skip


def values(builder: ProgramBuilder, given: object, count: int) -> list[Value]:
    """Constants of numbers; values that are computed stay as they are."""
    if isinstance(given, int) and not isinstance(given, bool):  # a Value is an int: a number is a float
        return [Value(given)] * count
    parts = given if isinstance(given, tuple) else (given,) * count
    return [part if isinstance(part, int) else builder.constant(float(part)) for part in parts]  # type: ignore[arg-type]


def closure(builder: ProgramBuilder, name: str, inputs: Inputs, weight: object = ONE, params: object = ()) -> None:
    """A closure by the names of its inputs; those that are not named are 0."""
    read = [
        value
        for label, (_, count) in input_places(name).items()
        if label != "weight"
        for value in values(builder, inputs.get(label, 0.0), count)
    ]
    x, y, z = values(builder, weight, 3)
    words = tuple(params) if isinstance(params, tuple) and params else (1,) * OPS[name].params
    builder.closure(name, (x, y, z), read, words)


def principled(builder: ProgramBuilder, alpha: float = 1.0, emits: bool = False, **inputs: object) -> None:
    """As the exporter writes it: alpha is a closure of its own and part of the weight."""
    through = builder.constant(1.0 - alpha)
    builder.closure("CLOSURE_TRANSPARENT", (through, through, through))
    thin = int(inputs.get("thin_wall", 0.0) != 0.0 and inputs.get("transmission_weight", 0.0) != 0.0)
    closure(builder, "CLOSURE_PRINCIPLED", {**PLAIN, **inputs}, (alpha,) * 3, (1, 1, int(emits), thin))


def program(build: Callable[[ProgramBuilder], None] | None) -> Program:
    builder = ProgramBuilder()
    if build is not None:
        build(builder)
    return builder.finish()


def scene(build: Callable[[ProgramBuilder], None] | None = None, *, copies: int = 1, **fields: object) -> Scene:
    """One triangle with the material "Leaves", `copies` times; no world, no lamp."""
    mesh = Mesh("Triangle", np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32), np.zeros(1, np.uint16))
    instances = Instances(
        np.zeros(copies, np.uint32),
        np.repeat(np.eye(3, 4)[None], copies, axis=0),
        np.zeros(copies, np.float32),
        np.zeros((copies, 3), np.float32),
        np.zeros((copies, 2), np.float32),
    )
    result = Scene(
        meshes=[mesh],
        objects=[Object("Tree", 0, [0])],
        instances=instances,
        materials=[Material("Leaves", program(build))],
    )
    for name, value in fields.items():
        setattr(result, name, value)
    return result


def sky(builder: ProgramBuilder, name: str) -> None:
    """Emission of a colour that an operation gives."""
    position = builder.op3("POINT_POSITION", (), (0, 0))
    read = (*position, *([builder.constant(0.5)] * (OPS[name].inputs - 3)))[: OPS[name].inputs]
    color = builder.op(name, read, (0,) * OPS[name].params)
    builder.closure("CLOSURE_EMISSION", (color[0], color[-1], color[0]))
