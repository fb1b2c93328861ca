"""A 3D view without a window: what Blender hands to view_update and view_draw, and edits as a user makes them."""

from __future__ import annotations

import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
from luch.render import render
from mathutils import Matrix
from numpy.typing import NDArray

F32 = NDArray[np.float32]
WAIT_S = 60.0
WIDTH, HEIGHT = 60, 40


def room_with_a_cube(scene: bpy.types.Scene) -> None:
    """A cube with a material under a sun, a camera, four samples."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.data.materials.append(bpy.data.materials.new("Stone"))
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.render.engine = "LUCH"
    scene.luch.preview_samples = 4
    bpy.context.view_layer.update()


def perspective(right: float, top: float, x: float = 0.0, y: float = 0.0) -> Matrix:
    """OpenGL's projection: half the width and height that are seen in a distance of 1, and the centre."""
    return Matrix(((1 / right, 0, x / right, 0), (0, 1 / top, y / top, 0), (0, 0, -1.0002, -0.2), (0, 0, -1, 0)))


def orthographic(right: float, top: float, x: float = 0.0, y: float = 0.0) -> Matrix:
    return Matrix(((1 / right, 0, 0, -x / right), (0, 1 / top, 0, -y / top), (0, 0, -0.002, 0), (0, 0, 0, 1)))


class Window:
    """What Blender hands to view_update and view_draw."""

    def __init__(self, width: int = WIDTH, height: int = HEIGHT) -> None:
        places = [area.spaces.active for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
        self.space_data: Any = places[0]
        eye = Matrix.Translation((0.3, -0.2, 5.0))
        view = SimpleNamespace(
            view_matrix=eye.inverted(), window_matrix=perspective(0.4, 0.4 * height / width), is_perspective=True,
            view_perspective="PERSP", view_location=(0.0, 0.0, 0.0),
        )  # fmt: skip
        self.region = SimpleNamespace(width=width, height=height, data=view)

    def look_from(self, x: float, y: float, z: float) -> None:
        self.region.data.view_matrix = Matrix.Translation((x, y, z)).inverted()

    def through_camera(self) -> None:
        scene = bpy.context.scene
        assert scene.camera is not None
        self.region.data.view_perspective = "CAMERA"
        self.region.data.view_matrix = scene.camera.matrix_world.inverted()


def depsgraph() -> Any:
    return bpy.context.evaluated_depsgraph_get()


def update(view: Any, window: Window) -> None:
    """As Blender does it: within the evaluation of what was edited, which alone knows what that was."""
    told: list[Any] = []

    def tell(_: Any, graph: Any) -> None:
        told.append(graph)
        view.update(window, graph)

    handlers: list[Any] = bpy.app.handlers.depsgraph_update_post
    handlers.append(tell)
    bpy.context.view_layer.update()
    handlers.remove(tell)
    if not told:
        view.update(window, depsgraph())


def shown(view: Any, window: Window) -> F32:
    """The finished picture of the file as it is."""
    update(view, window)
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None, view.text
    return view.preview.picture.pixels


def as_fresh(view: Any, window: Window) -> F32:
    """The same of a view that was never moved, with the origin that this one has kept (luch.kept)."""
    fresh = type(view)()
    update(fresh, window)
    scene = fresh._scene
    fresh.stop(wait=True)
    assert view.preview.kept.origin is not None
    return render(replace(scene, origin=view.preview.kept.origin)).passes["Combined"]


def edit(rng: np.random.Generator, window: Window) -> bool:
    """One of a user's edits; whether the view alone moved."""
    kind, cube = int(rng.integers(8)), bpy.data.objects["Cube"]
    mesh: Any = cube.data
    if kind <= 1:
        mesh.vertices[int(rng.integers(len(mesh.vertices)))].co.x += float(rng.normal(0.0, 0.1))
        mesh.update()
    elif kind == 2:
        cube.location.z = float(rng.normal(0.0, 0.3))
    elif kind == 3:
        tree = mesh.materials[0].node_tree
        tree.nodes["Principled BSDF"].inputs["Base Color"].default_value[0] = float(rng.random())
    elif kind == 4:
        cube.data = mesh.copy()
        bpy.data.meshes.remove(mesh)
    elif kind == 5:
        cube.modifiers.clear()
        cube.modifiers.new("Bevel", "BEVEL").width = float(rng.random() * 0.3)
    elif kind == 6:
        mesh.materials[0] = bpy.data.materials.new("Other")
    else:
        window.look_from(float(rng.normal(0.0, 0.3)), 0.0, 5.0)
        return True
    return False


def edits(count: int, seconds: float, window: Window, view: Any) -> None:
    """So many edits in about that time."""
    rng, began = np.random.default_rng(3), time.perf_counter()
    for number in range(count):
        moved = edit(rng, window)
        if not moved:
            update(view, window)
        view.follow(window, depsgraph())
        time.sleep(max(0.0, began + seconds * (number + 1) / count - time.perf_counter()))
