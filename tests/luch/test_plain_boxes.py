"""The boxes that engines are held against each other with: what their writers take for granted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.plain_boxes import BOXES, WIDTH, Box, Thing

every = pytest.mark.parametrize("box", BOXES.values(), ids=BOXES)


def shown(box: Box, point: tuple[float, float, float]) -> tuple[float, float]:
    """Where a point lies in the picture, -1 to 1 across and up."""
    x, y, z = (a - b for a, b in zip(point, box.eye.at, strict=True))
    half = math.tan(math.radians(box.eye.angle_deg) / 2.0)
    return x / y / half, z / y / half


@every
def test_the_picture_shows_nothing_but_the_inside(box: Box) -> None:
    for x in (-WIDTH / 2.0, WIDTH / 2.0):
        for z in (0.0, WIDTH):
            across, up = shown(box, (x, -WIDTH / 2.0, z))  # the opening's corners
            assert abs(across) > 1.0 < abs(up)


@every
def test_no_camera_ray_meets_the_lamp_which_fills_the_hole_in_the_ceiling(box: Box) -> None:
    x, y, z = box.lamp.middle
    half = box.lamp.side / 2.0
    corners = [(x + a * half, y + b * half, z) for a in (-1, 1) for b in (-1, 1)]
    assert all(shown(box, corner)[1] > 1.0 for corner in corners)
    ceiling = next(thing for thing in box.things if thing.name == "Ceiling")
    assert set(corners) < set(ceiling.vertices)
    assert area(ceiling) == pytest.approx(WIDTH**2 - box.lamp.side**2)


@every
def test_closed_things_are_closed_and_face_outwards(box: Box) -> None:
    closed = [thing for thing in box.things if thing.name in ("Tall", "Low", "Ball")]
    assert closed
    for thing in closed:
        edges = [(a, b) for t in thing.triangles() for a, b in zip(t, (*t[1:], t[0]), strict=True)]
        assert len(edges) == len(set(edges)) and {(b, a) for a, b in edges} == set(edges)
        corners = np.array(thing.vertices)[thing.triangles()] - np.array(thing.middle)
        volume = np.linalg.det(corners).sum() / 6.0
        assert volume > 0.0


def area(thing: Thing) -> float:
    a, b, c = np.moveaxis(np.array(thing.vertices)[thing.triangles()], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)
