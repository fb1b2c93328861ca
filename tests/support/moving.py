"""Meshes and instances that move, as rays at a time meet them, and the same frozen at that time."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch import core
from luch.accel import STRUCTURES
from numpy.typing import NDArray

from support.accel_meshes import icosphere, soup
from support.instances import ALL, Scene, placed

TIMES = np.array([0.0, 0.11, 0.5, 0.73, 1.0], np.float32)
NO_TIMES = np.zeros(0, np.float32)


def rotation(axis: int, angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    turn = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return turn


def between(keys: NDArray[np.float32], time: float) -> NDArray[np.float32]:
    """Points (V, 3) between keys (K, V, 3), as luch/geometry/motion.h blends them."""
    at = np.float32(time) * np.float32(len(keys) - 1)
    first = min(int(at), len(keys) - 2)
    a, b = keys[first], keys[first + 1]
    blended = a + (b - a) * np.float32(at - np.float32(first))
    return np.clip(blended, np.minimum(a, b), np.maximum(a, b)).astype(np.float32)


class Moving:
    """Two instances of each mesh, so that none is copied to the world; some move, of which the last keeps its turn, and
    one mesh changes its shape.
    """

    def __init__(self, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        self.still = Scene([icosphere(2), soup(60, 0.6), icosphere(1)])
        self.still.instances = [(m, placed(rng, 3.0), ALL) for m in (0, 0, 1, 1, 2, 2)]
        self.ways: list[tuple[int, Any]] = []
        for instance, keys in ((0, 3), (3, 5), (4, 2)):
            start = self.still.instances[instance][1]
            steps = []
            for k in range(keys):
                turn = rotation(instance % 3, 2.5 * k / (keys - 1)) @ np.diag([1.0 + 0.3 * k, 1.0, 1.0 - 0.1 * k])
                steps.append(np.hstack([turn @ start[:, :3], start[:, 3:] + [[0.6 * k], [0.0], [-0.4 * k]]]))
            self.ways.append((instance, np.array(steps)))
        start = self.still.instances[5][1]
        self.ways.append((5, np.stack([start + np.eye(3, 4, 3) * x for x in (0.0, 0.9, 0.4)])))
        points = self.still.meshes[1][0]
        self.shapes = [(1, np.stack([points + 0.3 * k * rng.normal(size=points.shape) for k in range(3)]).astype("f4"))]

    def build(self, kind: str = "BVH", precision: int = 1, for_device: bool = False, flatten: int = 0) -> Any:
        numbers = {name: number for number, name in enumerate(STRUCTURES)}
        return core.motion.MovingAccel(
            *self.still._arrays(), numbers.get(kind, -1), precision, flatten, self.shapes, self.ways, for_device
        )

    def frozen(self, time: float) -> Any:
        """All of it as it is at a time, still, searched one by one."""
        scene = Scene(list(self.still.meshes), list(self.still.instances))
        for mesh, keys in self.shapes:
            scene.meshes[mesh] = (between(keys, time), scene.meshes[mesh][1])
        arrays = list(scene._arrays())
        for instance, matrices in self.ways:
            to_world, to_object = core.motion.place(matrices, time)
            arrays[5][instance], arrays[6][instance] = to_world.ravel(), to_object.ravel()
        return core.ArrayAccel(*arrays, 0, 1, 1, 1, 0, np.zeros((0, 4), np.float32))


def same(hits: Any, truth: Any) -> None:
    for name, ours, expected in zip(("t", "prim", "u", "v", "instance"), hits, truth, strict=True):
        differ = np.flatnonzero(np.ascontiguousarray(ours).view(np.uint32) != expected.view(np.uint32))
        assert not len(differ), f"{name} of {len(differ)} rays, first {differ[0]}"
