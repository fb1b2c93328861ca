"""Small scenes that have some effects and lack others: rows that show every pair of two effects in all four ways."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from luch.scene import (
    CameraMotion,
    InstanceMotion,
    Instances,
    Light,
    Material,
    Medium,
    Mesh,
    Object,
    Scene,
    Shutter,
    World,
)
from luch.shader import ProgramBuilder

from support.accel_meshes import icosphere
from support.effects import closure, principled, program
from support.everything import everything, quad
from support.from_above import balls
from support.hair import fibre, strands
from support.hard_scenes import mesh_of


def _material(scene: Scene, index: int, build: Callable[[ProgramBuilder], None]) -> None:
    scene.materials[index] = Material(scene.materials[index].name, program(build))


def _chalk(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.6, 0.5, 0.4)})


def _coat(scene: Scene) -> None:
    _material(scene, 0, lambda b: principled(b, base_color=(0.5, 0.4, 0.3), coat_weight=0.5, roughness=0.4))


def _sheen(scene: Scene) -> None:
    inputs = {"color": (0.8, 0.7, 0.6), "roughness": 0.5}
    _show(scene, quad("Velvet", 0.4, 1.2), lambda b: closure(b, "CLOSURE_SHEEN", inputs))


def _glass(scene: Scene) -> None:
    _material(scene, 1, lambda b: closure(b, "CLOSURE_GLASS", {"color": (0.9, 1.0, 0.9), "roughness": 0.1, "ior": 1.4}))


def _film_on_glass(scene: Scene) -> None:
    inputs = {"color": (1.0, 1.0, 1.0), "ior": 1.5, "thin_film_thickness": 400.0, "thin_film_ior": 1.3}
    _material(scene, 1, lambda b: closure(b, "CLOSURE_GLASS", inputs))


def _leaf(builder: ProgramBuilder) -> None:
    half = (0.5, 0.5, 0.5)
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.2, 0.6, 0.1)}, weight=half)
    closure(builder, "CLOSURE_TRANSPARENT", {}, weight=half)


def _glow(scene: Scene) -> None:
    _material(scene, 3, lambda b: closure(b, "CLOSURE_EMISSION", {}, weight=(6.0, 4.0, 2.0)))


def _lens(scene: Scene) -> None:
    scene.camera.use_dof = True


def _lamp(kind: str) -> Callable[[Scene], None]:
    def add(scene: Scene) -> None:
        matrix = np.array([[1.0, 0, 0, -1.0], [0, 1.0, 0, 0.3], [0, 0, 1.0, 4.0]])
        scene.lights.append(
            Light(kind, kind, matrix=matrix, power=2.0 if kind == "SUN" else 80.0, radius=0.2, angle=0.1)
        )

    return add


def _sky(scene: Scene) -> None:
    scene.world = everything().world


def _clamp(scene: Scene) -> None:
    scene.settings.clamp_direct = scene.settings.clamp_indirect = 1.5


def _blur(scene: Scene) -> None:
    scene.settings.filter_glossy = 1.0


def _passes(scene: Scene) -> None:
    scene.film.passes = ["Combined", "Depth", "Normal", "Diffuse Direct", "Glossy Indirect", "Ambient Occlusion"]


def _holdout(scene: Scene) -> None:
    scene.objects[2] = replace(scene.objects[2], holdout=True)


def _show(scene: Scene, mesh: Mesh, build: Callable[[ProgramBuilder], None]) -> None:
    """One object more, where it stands, of a material of its own."""
    scene.meshes.append(mesh)
    scene.materials.append(Material(mesh.name, program(build)))
    scene.objects.append(Object(mesh.name, len(scene.meshes) - 1, [len(scene.materials) - 1]))
    old = scene.instances
    assert old is not None
    scene.instances = Instances(
        np.append(old.object, np.uint32(len(scene.objects) - 1)),
        np.concatenate([old.matrix, np.eye(3, 4)[None]]),
        np.append(old.random, np.float32(0.3)),
        np.concatenate([old.generated, np.zeros((1, 3), np.float32)]),
        np.concatenate([old.uv, np.zeros((1, 2), np.float32)]),
        motion=old.motion,
    )


def _hair(scene: Scene) -> None:
    """Below the leaves: a shadow ray that goes on behind one begins there anew, near which no ribbon is met."""
    rng = np.random.default_rng(6)
    strand = np.array([[-1.0, 0.0, 0.1, 0.15], [0.1, 0.3, 0.7, 0.12], [0.9, -0.2, 1.1, 0.05]])
    rows = [strand + np.append(rng.uniform(-1.0, 1.0, 2), [0.0, 0.0]) for _ in range(6)]
    _show(scene, strands(*rows), _chalk)


def _hair_shading(scene: Scene) -> None:
    """On a surface: closures of hair and curves are apart."""
    _show(scene, quad("Braid", 0.6, 1.0), fibre)


def _round_hair(scene: Scene) -> None:
    scene.settings.curve_shape = "THICK"


def _cloud(scene: Scene) -> None:
    _show(scene, balls((-0.8, 0.4, 0.7, 0.2), (0.3, -0.6, 0.9, 0.15), (0.9, 0.8, 0.5, 0.1)), _chalk)


def _skin(scene: Scene) -> None:
    positions, triangles = icosphere(1)
    ball = mesh_of("Wax", (positions * np.float32(0.4) + np.float32([0.9, -0.9, 0.6]), triangles))
    inputs = {"color": (0.8, 0.5, 0.4), "radius": 0.1, "ior": 1.4, "alpha": 1.0, "anisotropy": 0.0}
    _show(scene, ball, lambda b: closure(b, "CLOSURE_SUBSURFACE", inputs, params=(1, 0)))


def _mist(scene: Scene) -> None:
    """All around; a world that is there keeps its light."""
    world = scene.world or World("Night", program(None))
    scene.world = replace(world, volume=Medium((0.05, 0.04, 0.03)))


def _moving_object(scene: Scene) -> None:
    assert scene.instances is not None
    ends = [scene.instances.matrix[1].copy() for _ in range(2)]
    ends[1][0, 3] += 0.3
    motion = InstanceMotion(np.array([1], np.uint32), np.array([2], np.uint32), np.stack(ends))
    scene.instances, scene.shutter = replace(scene.instances, motion=motion), Shutter()


def _moving_camera(scene: Scene) -> None:
    ends = [scene.camera.matrix.copy() for _ in range(2)]
    ends[1][1, 3] += 0.1
    scene.camera, scene.shutter = replace(scene.camera, motion=CameraMotion(np.stack(ends))), Shutter()


EFFECTS: dict[str, Callable[[Scene], None]] = {
    "coat": _coat,
    "sheen": _sheen,
    "glass": _glass,
    "thin film": _film_on_glass,
    "transparency": lambda scene: _material(scene, 2, _leaf),
    "emissive mesh": _glow,
    "depth of field": _lens,
    "area lamp": _lamp("AREA"),
    "spot lamp": _lamp("SPOT"),
    "sun": _lamp("SUN"),
    "varied world": _sky,
    "clamping": _clamp,
    "filter glossy": _blur,
    "passes": _passes,
    "holdout": _holdout,
    "hair": _hair,
    "hair shading": _hair_shading,
    "round hair": _round_hair,
    "point cloud": _cloud,
    "subsurface": _skin,
    "volume": _mist,
    "moving object": _moving_object,
    "moving camera": _moving_camera,
}


def covering_rows(seed: int = 5) -> list[tuple[str, ...]]:
    """Sets of effects such that any two appear together, apart each way round, and not at all (greedy, from a seed)."""
    names, rng = list(EFFECTS), np.random.default_rng(seed)
    pairs = list(itertools.combinations(range(len(names)), 2))
    missing = {(a, b, x, y) for a, b in pairs for x in (0, 1) for y in (0, 1)}
    rows = []
    while missing:
        tries = rng.integers(0, 2, (200, len(names)))
        best = max(tries, key=lambda row: len(_shown(row.tolist(), pairs) & missing))
        missing -= _shown(best.tolist(), pairs)
        rows.append(tuple(name for name, on in zip(names, best.tolist(), strict=True) if on))
    return rows


def _shown(row: list[int], pairs: list[tuple[int, int]]) -> set[tuple[int, int, int, int]]:
    return {(a, b, row[a], row[b]) for a, b in pairs}


def scene_of(effects: tuple[str, ...]) -> Scene:
    """Chalk lit by one point lamp and a plain world, with the effects added."""
    scene = everything(max_bounces=3)
    scene.camera.use_dof, scene.world = False, None
    scene.lights = [replace(scene.lights[0], radius=0.0)]
    scene.materials = [Material(material.name, program(_chalk)) for material in scene.materials]
    for name in effects:
        EFFECTS[name](scene)
    return scene
