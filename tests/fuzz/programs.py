"""Random shader programs of every operation there is."""

from __future__ import annotations

import numpy as np
from luch.ies import parse_ies
from luch.scene import Program
from luch.shader import (
    ATTRIBUTE_COLOR,
    ATTRIBUTE_GENERATED,
    ATTRIBUTE_TANGENT,
    ATTRIBUTE_UV,
    OPS,
    ProgramBuilder,
    Value,
    float_word,
)
from luch.sky import preetham_table

from fuzz.values import Rng, chance, number

ATTRIBUTE_NAMES = ("UVMap", "Col", "mass", "object:tint", "instancer:tint", "radius", "nothing")
IES = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 3 2 1 2 0 0 0\n1 1 100\n0 45 90\n0 180\n100 50 0\n80 40 0\n"
VALUE_OPS = [name for name, op in OPS.items() if not op.closure and name != "SKY_ATMOSPHERE"]
SURFACES = [name for name, op in OPS.items() if op.closure and name not in ("CLOSURE_EMISSION", "STORE_AOV")]


def random_program(rng: Rng, kind: str, images: int, aovs: list[str], wild: float) -> Program:
    """kind: "SURFACE", "WORLD" or "LIGHT". wild: share of hostile constants."""
    builder = ProgramBuilder()
    values = [builder.constant(number(rng, 0.0, 1.0, wild=wild)) for _ in range(4)]
    for _ in range(int(rng.integers(0, 9))):
        name = VALUE_OPS[int(rng.integers(len(VALUE_OPS)))]
        if name in ("IMAGE", "IMAGE_BOX", "ENVIRONMENT") and images == 0:
            continue
        values += builder.op(name, _inputs(rng, builder, values, name, wild), _params(rng, builder, name, images))
    closures = [SURFACES[int(rng.integers(len(SURFACES)))] for _ in range(int(rng.integers(1, 4)))]
    if kind != "SURFACE":
        closures = ["CLOSURE_EMISSION"]
    elif chance(rng, 0.2):
        closures.append("CLOSURE_EMISSION")
    for name in closures:
        read = _inputs(rng, builder, values, name, wild)
        builder.closure(name, (read[0], read[1], read[2]), read[3:], _params(rng, builder, name, images))
    if aovs and kind == "SURFACE" and chance(rng, 0.3):
        read = _inputs(rng, builder, values, "STORE_AOV", wild)
        builder.closure("STORE_AOV", None, read, (builder.aov(aovs[int(rng.integers(len(aovs)))]),))
    return builder.finish()


def _inputs(rng: Rng, builder: ProgramBuilder, values: list[Value], name: str, wild: float) -> list[Value]:
    def one() -> Value:
        if chance(rng, 0.5):
            return values[int(rng.integers(len(values)))]
        return builder.constant(number(rng, 0.0, 1.0, wild=wild))

    return [one() for _ in range(OPS[name].inputs)]


def _params(rng: Rng, builder: ProgramBuilder, name: str, images: int) -> list[int]:
    """Static words that the exporter could write."""
    words = [int(rng.integers(0, 3)) for _ in range(OPS[name].params)]
    if name == "COLOR_RAMP":
        words[:2] = [builder.table(rng.random((16, 4)).astype(np.float32)), 16]
    elif name == "CURVE":
        words = [builder.table(rng.random((16, 3)).astype(np.float32)), 16, 3, int(rng.integers(3)), words[4],
                 float_word(0.0), float_word(1.0)]  # fmt: skip
    elif name in ("BLACKBODY", "WAVELENGTH"):
        words = [builder.table(rng.random((512, 3)).astype(np.float32))]
    elif name == "IES":
        words = [builder.table(parse_ies(IES))]
    elif name == "SKY_PREETHAM":
        words = [builder.table(preetham_table((0.3, 0.2, 0.9), 2.5))]
    elif name in ("IMAGE", "IMAGE_BOX", "ENVIRONMENT"):
        words[0] = builder.image(int(rng.integers(images)))
        words = [*words[:4], words[4] & 3] if name == "IMAGE" else words
        if name == "IMAGE_BOX":
            words[3] = float_word(number(rng, 0.0, 1.0))
    elif name in ("ATTRIBUTE_VALUE", "ATTRIBUTE_COLOR", "TANGENT_UV", "NORMAL_MAP"):
        words[2] = _attribute(rng, builder)
    elif name == "ATTRIBUTE_OBJECT":
        words[0] = builder.attribute(ATTRIBUTE_NAMES[3 + int(rng.integers(2))])
    elif name == "POINT_OTHER_OBJECT":
        words[2:] = [float_word(number(rng)) for _ in range(12)]
    return words


def _attribute(rng: Rng, builder: ProgramBuilder) -> int:
    if chance(rng, 0.4):
        named = (ATTRIBUTE_UV, ATTRIBUTE_COLOR, ATTRIBUTE_GENERATED, ATTRIBUTE_TANGENT)
        return named[int(rng.integers(4))]
    return builder.attribute(ATTRIBUTE_NAMES[int(rng.integers(len(ATTRIBUTE_NAMES)))])
