"""Three boxes to hold engines against each other: numbers alone, so that every engine's writer starts from the same.

Metres, Z up, linear RGB. The box stands on Z = 0 around the Z axis and is open towards -Y, where the camera looks from.
It fills the picture: no pixel sees past it. Its lamp fills a hole in the ceiling and lies above the picture, since
engines differ in whether a lamp shows itself to the camera, and in whether it hides what is behind it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Point = tuple[float, float, float]
Colour = tuple[float, float, float]

WIDTH = 2.0  # of the box in X, Y and Z


@dataclass(frozen=True)
class Surface:
    """kind: "diffuse" (Lambert), "metal" (GGX without Fresnel, alpha = roughness squared), "glass" (smooth, clear)."""

    kind: str
    colour: Colour = (1.0, 1.0, 1.0)
    roughness: float = 0.0
    ior: float = 1.5


@dataclass(frozen=True)
class Thing:
    """A mesh of polygons. smooth: normals are those of a sphere around its middle."""

    name: str
    vertices: Sequence[Point]
    polygons: Sequence[tuple[int, ...]]
    surface: Surface
    smooth: bool = False

    @property
    def middle(self) -> Point:
        count = len(self.vertices)
        x, y, z = (sum(axis) / count for axis in zip(*self.vertices, strict=True))
        return x, y, z

    def triangles(self) -> list[tuple[int, int, int]]:
        """Each polygon as a fan."""
        return [(one[0], one[i], one[i + 1]) for one in self.polygons for i in range(1, len(one) - 1)]


@dataclass(frozen=True)
class Lamp:
    """A square that shines downwards, evenly in all directions; its back is dark."""

    middle: Point = (0.0, -0.5, WIDTH)
    side: float = 0.5
    radiance: float = 12.0

    @property
    def watts(self) -> float:
        """Of all it sends out."""
        return math.pi * self.side**2 * self.radiance


@dataclass(frozen=True)
class Eye:
    """Looks along +Y."""

    at: Point = (0.0, -4.9, WIDTH / 2.0)
    angle_deg: float = 23.6  # of the picture's width and height


@dataclass(frozen=True)
class Box:
    name: str
    things: Sequence[Thing]
    lamp: Lamp = Lamp()
    eye: Eye = Eye()


WHITE = Surface("diffuse", (0.73, 0.71, 0.68))
RED = Surface("diffuse", (0.63, 0.065, 0.05))
GREEN = Surface("diffuse", (0.14, 0.45, 0.09))
STEEL = Surface("metal", (0.9, 0.9, 0.9), roughness=0.2)
COPPER = Surface("metal", (0.9, 0.6, 0.4), roughness=0.35)
GLASS = Surface("glass")


def walls() -> list[Thing]:
    """Floor, ceiling around the lamp, back and two sides."""
    h, w = WIDTH / 2.0, WIDTH
    corners = [(x, y, z) for z in (0.0, w) for y in (-h, h) for x in (-h, h)]
    faces = {"Floor": (0, 1, 3, 2), "Back": (2, 3, 7, 6), "Left": (0, 2, 6, 4), "Right": (1, 5, 7, 3)}
    colours = {"Left": RED, "Right": GREEN}
    flat = [(0, 1, 2, 3)]
    return [
        *(Thing(name, [corners[i] for i in face], flat, colours.get(name, WHITE)) for name, face in faces.items()),
        ceiling(Lamp()),
    ]


def ceiling(lamp: Lamp) -> Thing:
    """Four polygons around a hole that the lamp fills."""
    h, half, (x, y, z) = WIDTH / 2.0, lamp.side / 2.0, lamp.middle
    outer = [(-h, -h, z), (-h, h, z), (h, h, z), (h, -h, z)]
    inner = [(x + a * half, y + b * half, z) for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    around = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)]
    return Thing("Ceiling", outer + inner, around, WHITE)


def block(name: str, size: Point, at: tuple[float, float], turn_deg: float, surface: Surface) -> Thing:
    """Stands a millimetre above the floor; turned about Z."""
    cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    vertices = [
        (at[0] + cos * x - sin * y, at[1] + sin * x + cos * y, z)
        for z in (0.001, 0.001 + size[2])
        for y in (-size[1] / 2.0, size[1] / 2.0)
        for x in (-size[0] / 2.0, size[0] / 2.0)
    ]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return Thing(name, vertices, faces, surface)


def ball(name: str, radius: float, at: Point, surface: Surface, around: int = 128, up: int = 64) -> Thing:
    """So fine that facets do not matter."""
    rings = [math.pi * i / up for i in range(1, up)]
    turns = [2.0 * math.pi * j / around for j in range(around)]
    unit = [(math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)) for t in rings for p in turns]
    unit += [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    top, bottom = len(unit) - 2, len(unit) - 1
    polygons: list[tuple[int, ...]] = []
    for j in range(around):
        k = (j + 1) % around
        polygons.append((top, j, k))
        polygons += [
            (i * around + j, (i + 1) * around + j, (i + 1) * around + k, i * around + k) for i in range(up - 2)
        ]
        polygons.append(((up - 2) * around + j, bottom, (up - 2) * around + k))
    vertices = [(at[0] + radius * x, at[1] + radius * y, at[2] + radius * z) for x, y, z in unit]
    return Thing(name, vertices, polygons, surface, smooth=True)


def _blocks(tall: Surface, low: Surface) -> list[Thing]:
    return [
        block("Tall", (0.6, 0.6, 1.2), (-0.35, 0.3), 18.0, tall),
        block("Low", (0.6, 0.6, 0.6), (0.38, -0.3), -17.0, low),
    ]


BOXES = {
    box.name: box
    for box in (
        Box("diffuse", [*walls(), *_blocks(WHITE, WHITE)]),
        Box("glossy", [*walls(), *_blocks(STEEL, COPPER)]),
        Box("caustic", [*walls(), ball("Ball", 0.45, (0.1, -0.1, 0.6), GLASS)]),
    )
}
