"""What is said of geometry that was left out."""

from __future__ import annotations

import numpy as np
from luch import door
from luch.scene import Mesh, Object
from support.from_above import scene_of


def test_what_is_left_out_is_told_by_the_first_object_that_shows_the_mesh() -> None:
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0]], np.float32)
    meshes = [Mesh(name, square, np.array([[0, 1, 2]], np.uint32), np.zeros(1, np.uint16)) for name in "abc"]
    scene = scene_of(meshes[0])
    scene.meshes = meshes
    scene.objects = [Object("First", 1, [0]), Object("Second", 1, [0]), Object("Other", 0, [0])]
    stats = {"left_out": [(0, 0, 0, 1, 0), (1, 2, 0, 3, 1), (2, 0, 1, 0, 0)]}
    assert door.report(stats, scene) == [
        'Object "Other": 1 face without area left out.',
        'Object "First": 3 faces without area and 1 face on top of another that is the same left out.',
    ]
    invalid, too_far = door.warnings(stats, scene)
    assert invalid.startswith('Object "First": 2 faces with a vertex') and too_far.startswith(
        'Mesh "c": 1 face reaching'
    )
