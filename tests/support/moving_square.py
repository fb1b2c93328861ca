"""A square that moves while the shutter is open: as an object, by its shape, or before a camera that moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from luch.render import render
from luch.scene import Camera, CameraMotion, Film, InstanceMotion, Instances, Material, Object, Scene, Settings, Shutter

from support.effects import closure, program
from support.everything import quad

WIDTH = 32  # pixels, of 1/4 m each


def glow(builder: Any) -> None:
    closure(builder, "CLOSURE_EMISSION", {"color": (1.0, 1.0, 1.0), "strength": 1.0})


def shifted(x: float, y: float = 0.0) -> Any:
    return np.array([[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 0.0]])


def square(**settings: Any) -> Scene:
    """A glowing square of 2 m before a camera that sees 8 m by 2 m straight on."""
    return Scene(
        meshes=[quad("Square", 1.0, 0.0)],
        objects=[Object("Square", 0, [0])],
        instances=Instances(np.zeros(1, np.uint32), shifted(0.0)[None], np.zeros(1, np.float32),
                            np.zeros((1, 3), np.float32), np.zeros((1, 2), np.float32)),
        materials=[Material("Glow", program(glow))],
        camera=Camera(kind="ORTHO", ortho_scale=8.0, matrix=np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5]])),
        film=Film(width=WIDTH, height=4, filter="BOX", filter_width=1.0),
        settings=Settings(samples=1024, threads=1, **settings),
        shutter=Shutter(),
    )  # fmt: skip


def moved_object(scene: Scene, speed: float, keys: int = 2) -> Scene:
    """The first instance."""
    assert scene.instances is not None
    places = np.stack([scene.instances.matrix[0]] * keys)
    places[:, 0, 3] += [speed * (k / (keys - 1) - 0.5) for k in range(keys)]
    motion = InstanceMotion(np.zeros(1, np.uint32), np.array([keys], np.uint32), places)
    return replace(scene, instances=replace(scene.instances, motion=motion))


def moved_shape(scene: Scene, speed: float, keys: int = 2) -> Scene:
    """The first mesh."""
    points = scene.meshes[0].positions
    places = [points + np.float32([speed * (k / (keys - 1) - 0.5), 0.0, 0.0]) for k in range(keys)]
    return replace(scene, meshes=[replace(scene.meshes[0], motion_positions=np.stack(places)), *scene.meshes[1:]])


def moved_camera(scene: Scene, speed: float, keys: int = 2) -> Scene:
    places = np.stack([scene.camera.matrix for _ in range(keys)])
    places[:, 0, 3] -= [speed * (k / (keys - 1) - 0.5) for k in range(keys)]
    return replace(scene, camera=replace(scene.camera, motion=CameraMotion(places)))


WAYS = {"object": moved_object, "shape": moved_shape, "camera": moved_camera}


def expected(speed: float, times: Any) -> Any:
    """The share of times at which each pixel's column sees the square, (WIDTH,)."""
    x = (np.arange(WIDTH * 64) + 0.5) / 64 / WIDTH * 8.0 - 4.0
    middle = speed * (np.asarray(times) - 0.5)
    return (np.abs(x[None] - middle[:, None]) < 1.0).mean(axis=0).reshape(WIDTH, 64).mean(axis=1)


def row(scene: Scene) -> Any:
    return render(scene).passes["Combined"][..., 0].mean(axis=0)


EVEN = (np.arange(4000) + 0.5) / 4000
