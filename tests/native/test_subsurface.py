"""Light under surfaces: energy, limits, colours that come back, what a walk sees, and the same on CUDA."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.render import Result, render
from luch.scene import Camera, Film, Instances, Light, Material, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder
from support.accel_meshes import icosphere
from support.cuda_on_cpu import FIBERS
from support.devices import watch_shadows
from support.effects import ONE, PLAIN, closure, program

WALK, SKIN, LEGACY, BURLEY = range(4)  # SubsurfaceMethod of bsdf/params.h
CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)], np.float32)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]], np.uint32,
)  # fmt: skip
Build = Callable[[ProgramBuilder], None]


def cube(name: str = "Cube", half: float = 1.0, faces: Any = FACES) -> Mesh:
    """Its normals point outwards."""
    return Mesh(name, CUBE * np.float32(half), faces, np.zeros(len(faces), np.uint16))


def wax(color: Any = (0.8, 0.5, 0.2), radius: Any = 0.3, g: float = 0.0, method: int = WALK, **more: Any) -> Build:
    given = {"color": color, "radius": radius, "ior": 1.4, "alpha": 1.0, "anisotropy": g, **more}
    return lambda b: closure(b, "CLOSURE_SUBSURFACE", given, params=(1, method))


def shine(*color: float) -> Build:
    return lambda b: closure(b, "CLOSURE_EMISSION", {}, weight=color or ONE)


def at(x: float, y: float, z: float, scale: Any = (1.0, 1.0, 1.0)) -> Any:
    return np.hstack([np.diag(np.broadcast_to(scale, 3)), [[x], [y], [z]]])


def room(
    meshes: list[Mesh], builds: list[Build], places: Any = None, sky: Build | None = None, **settings: Any
) -> Scene:
    """Mesh k with material k, seen from above; a white world."""
    count = len(meshes)
    places = [at(0, 0, 0)] * count if places is None else places
    copies = len(places)
    instances = Instances(
        np.arange(copies, dtype=np.uint32) % count, np.stack(places), np.zeros(copies, np.float32),
        np.zeros((copies, 3), np.float32), np.zeros((copies, 2), np.float32),
    )  # fmt: skip
    given = {"samples": 64, "accelerator": "BVH", "threads": 1, "max_bounces": 8, "diffuse_bounces": 8, **settings}
    return Scene(
        meshes=meshes,
        objects=[Object(mesh.name, k, [k]) for k, mesh in enumerate(meshes)],
        instances=instances,
        materials=[Material(f"Wax {k}", program(build)) for k, build in enumerate(builds)],
        world=World("Sky", program(sky or shine())),
        camera=Camera(kind="ORTHO", matrix=at(0.0, 0.0, 6.0), ortho_scale=1.6),
        film=Film(width=8, height=8),
        settings=Settings(**given),
    )


def shot(scene: Scene) -> tuple[Any, Result]:
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    picture = result.passes["Combined"][..., :3]
    assert np.isfinite(picture).all()
    return picture, result


@pytest.mark.parametrize("method", [WALK, SKIN])
@pytest.mark.parametrize("g", [0.0, 0.8])
def test_a_white_medium_in_a_white_world_cannot_be_seen(method: int, g: float) -> None:
    radius = {WALK: 2.0, SKIN: 1200.0}[method]  # of skin this white, a six hundredth counts
    picture, result = shot(room([cube()], [wax(ONE, radius, g, method)], samples=256))
    assert picture.mean(axis=(0, 1)) == pytest.approx(1.0, abs=6e-3)
    assert result.stats["subsurface_walks"] > 0


def ball() -> Mesh:
    """A sphere of the accelerators' tests."""
    points, faces = icosphere(3)
    return Mesh("Ball", points, faces, np.zeros(len(faces), np.uint16))


@pytest.mark.parametrize(("method", "g"), [(WALK, 0.0), (WALK, 0.6), (WALK, -0.5), (LEGACY, 0.0), (LEGACY, 0.6)])
def test_the_colour_asked_for_comes_back_from_a_thick_medium(method: int, g: float) -> None:
    """Light goes straight in, from all sides: a ball's disc shows every angle as often as diffuse light has it."""
    colors, scale = (0.3, 0.5, 0.8), {WALK: 0.01, LEGACY: 0.08}[method]
    scene = room([ball()], [wax(colors, scale, g, method, alpha=0.0, ior=1.0)], samples=64, max_bounces=1)
    scene.camera = replace(scene.camera, ortho_scale=2.1)
    scene.film = Film(width=16, height=16, transparent=True)
    picture, result = shot(scene)
    seen = picture.sum(axis=(0, 1)) / result.passes["Combined"][..., 3].sum()
    assert seen == pytest.approx(colors, rel=0.05)


@pytest.mark.parametrize("radius", [0.0, 1e-9, 1e-7])
def test_a_tiny_radius_is_diffuse(radius: float) -> None:
    ours, result = shot(room([cube()], [wax(radius=radius)]))
    diffuse, _ = shot(room([cube()], [lambda b: closure(b, "CLOSURE_DIFFUSE", {"color": (0.8, 0.5, 0.2)})]))
    assert result.stats["subsurface_walks"] == 0
    assert np.array_equal(ours, diffuse)


def test_channels_with_a_radius_walk_beside_those_without() -> None:
    picture, result = shot(room([cube()], [wax(radius=(0.3, 0.0, 1e-9))], samples=256, max_bounces=1))
    assert result.stats["subsurface_walks"] > 0
    assert picture.mean(axis=(0, 1))[1:] == pytest.approx([0.5, 0.2], rel=0.02)


def test_twice_the_size_and_the_radius_is_the_same_picture() -> None:
    small = room([cube()], [wax()])
    large = room([cube(half=2.0)], [wax(radius=0.6)])
    large.camera = replace(large.camera, matrix=at(0.0, 0.0, 12.0), ortho_scale=3.2)
    assert np.array_equal(shot(small)[0], shot(large)[0])


def test_a_walk_sees_its_own_object_alone() -> None:
    black: Build = lambda b: closure(b, "CLOSURE_DIFFUSE", {"color": (0.0, 0.0, 0.0)})  # noqa: E731
    alone, _ = shot(room([cube()], [wax()]))
    inside, _ = shot(room([cube(), cube("Core", 0.6)], [wax(), black]))
    assert np.array_equal(alone, inside)
    both = Mesh(
        "Both", np.vstack([CUBE, CUBE * np.float32(0.6)]), np.vstack([FACES, FACES + 8]), np.zeros(24, np.uint16)
    )
    assert not np.array_equal(alone, shot(room([both], [wax()]))[0]), "what is part of the object is seen"


def test_instances_walk_each_in_their_own_space() -> None:
    """A cube that its instance stretches is the stretched cube."""
    size = np.array([1.0, 0.5, 2.0], np.float32)
    mesh = cube()
    stretched = shot(room([mesh], [wax()], [at(0, 0, 0, size), at(9.0, 0, 0), at(12.0, 0, 0, (2, 2, 2))], samples=256))[
        0
    ]
    baked = shot(room([Mesh("Baked", CUBE * size, FACES, np.zeros(12, np.uint16))], [wax()], samples=256))[0]
    assert stretched.mean(axis=(0, 1)) == pytest.approx(baked.mean(axis=(0, 1)), rel=2e-3)


@pytest.mark.parametrize("radius", [0.0, 1e-6, 1e-4, 1e6])
@pytest.mark.parametrize("color", [(0.0, 0.0, 0.0), ONE, (1.0, 0.0, 0.5)])
def test_extremes_stay_finite(radius: float, color: Any) -> None:
    open_box = cube(faces=FACES[:-2])
    for g, method in ((0.0, BURLEY), (0.99, WALK), (-0.99, WALK), (0.99, SKIN), (-0.5, LEGACY)):
        scene = room([open_box], [wax(color, radius, g, method)], samples=4)
        picture, _ = shot(scene)
        assert picture.max() <= 60.0 and picture.min() >= 0.0


def test_no_number_of_threads_changes_a_bit() -> None:
    scene = room([cube()], [wax()])
    again = replace(scene, settings=replace(scene.settings, threads=3))
    assert np.array_equal(shot(scene)[0], shot(again)[0])


def test_what_scatters_nowhere_costs_nothing() -> None:
    _, plain = shot(room([cube()], [lambda b: closure(b, "CLOSURE_DIFFUSE", {"color": ONE})], samples=4))
    assert [plain.stats[f"subsurface_{name}"] for name in ("walks", "steps", "tree_bytes")] == [0, 0, 0]
    idle = room([cube(), cube("Other")], [lambda b: closure(b, "CLOSURE_DIFFUSE", {"color": ONE}), wax()], samples=4)
    idle.instances = replace(idle.instances, object=np.zeros(2, np.uint32))  # type: ignore[arg-type,type-var]
    assert shot(idle)[1].stats["subsurface_tree_bytes"] == 0
    left_out = room([cube()], [wax()], samples=4, without_effects=["subsurface"])
    assert shot(left_out)[1].stats["subsurface_tree_bytes"] == 0


def layered(builder: ProgramBuilder) -> None:
    """Principled with a bent normal, half of it under the surface."""
    position = builder.op3("POINT_POSITION", (), (0, 0))
    bent = tuple(builder.op1("MATH_ADD", (position[k], builder.constant(0.2 * k))) for k in range(3))
    inputs = {**PLAIN, "base_color": (0.7, 0.4, 0.3), "subsurface_weight": 0.5, "normal": bent,
              "subsurface_radius": (0.4, 0.2, 0.1), "subsurface_ior": 1.4}  # fmt: skip
    closure(builder, "CLOSURE_PRINCIPLED_SUBSURFACE", inputs, params=(1, 1, 0, 0, SKIN))


def everything_inside() -> Scene:
    """Four instances of three methods, two of them stretched, a lamp."""
    places = [at(0, 0, 0), at(-0.5, 0.5, 0.4, (0.6, 0.4, 1.0)), at(0.6, -0.6, 0.7, (0.4, 0.3, 0.4)),
              at(0.9, 0.2, 0.6, (0.3, 0.3, 0.3))]  # fmt: skip
    builds = [wax(g=0.3), layered, wax(radius=1.0, method=BURLEY)]
    scene = room([cube(), cube("Other", 0.8), cube("Disk")], builds, places, samples=4)
    scene.lights = [Light("Bulb", "POINT", matrix=at(1.0, 0.5, 4.0), power=300.0, radius=0.3)]
    scene.camera = replace(scene.camera, ortho_scale=3.0)
    scene.film.passes = ["Combined", "Diffuse Direct", "Diffuse Indirect", "Glossy Direct", "Ambient Occlusion"]
    return scene


def test_a_path_adds_light_of_its_surface_and_of_its_exit_one_after_the_other(
    place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched, scene = watch_shadows(monkeypatch), everything_inside()
    stats = render(replace(scene, settings=replace(scene.settings, device="CUDA"))).stats
    assert stats["subsurface_walks"] > 0
    assert sum(watched) > 50


def test_cuda_walks_as_the_cpu_does(place: str) -> None:
    scene = everything_inside()
    ours = render(replace(scene, settings=replace(scene.settings, device="CUDA")))
    assert ours.stats["device"].startswith("CUDA"), ours.stats["warnings"]
    assert ours.stats["kernel_plan"]["SUBSURFACE"]
    cpu = render(scene)
    for name in cpu.passes:
        if place == FIBERS:
            np.testing.assert_allclose(ours.passes[name], cpu.passes[name], rtol=2e-6, atol=1e-7, err_msg=name)
        else:
            differ = ~np.isclose(ours.passes[name], cpu.passes[name], rtol=1e-4, atol=1e-5)
            assert differ.mean() < 0.05, (name, differ.mean())
    for name in ("paths", "rays", "shadow_rays", "surface_points", "subsurface_walks", "subsurface_steps"):
        assert abs(ours.stats[name] - cpu.stats[name]) <= (0 if place == FIBERS else 0.01 * cpu.stats[name]), name
    assert cpu.stats["subsurface_steps"] > cpu.stats["subsurface_walks"] > 0
    assert cpu.passes["Diffuse Direct"].max() > 0.0 and cpu.passes["Glossy Direct"].max() > 0.0
