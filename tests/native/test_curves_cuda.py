"""Hair on CUDA: the kernels with curves give the CPU's picture. On fibers always, on a GPU with `-m cuda`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from luch.cuda.plan import CURVE_SHAPES, NEEDED_BY
from luch.effects import effects_of
from luch.render import render
from luch.scene import Scene
from luch.shader import ProgramBuilder
from support.accel_meshes import icosphere
from support.cuda_on_cpu import FIBERS
from support.effects import closure
from support.from_above import Build
from support.hair import fibre, fur, scene_of

SHAPES = ("RIBBON", "THICK", "THICK_LINEAR")


def cones(builder: ProgramBuilder) -> None:
    """The Hair BSDF node, once as reflection and once as transmission."""
    inputs = {"color": (0.8, 0.5, 0.3), "offset": -0.05, "roughness_along": 0.2, "roughness_around": 0.9}
    for transmission in (0, 1):
        closure(builder, "CLOSURE_HAIR", inputs, params=(1, transmission))


def tangle(shape: str, build: Build = fibre) -> Scene:
    """Strands that absorb and a ball among them, drawn as they are and stretched."""
    positions, triangles = icosphere(1)
    mesh = fur(60, radius=0.08)
    mesh.positions, mesh.triangles = positions * np.float32(0.5), triangles
    mesh.material_slots = np.zeros(len(triangles), np.uint16)
    matrices = np.stack([np.eye(3, 4)] * 2)
    matrices[1, :, :3] = [[1.5, 0.3, 0.0], [0.0, -0.5, 0.0], [0.1, 0.0, 1.0]]
    matrices[1, 0, 3] = 1.0
    return scene_of(mesh, build, shape=shape, width=5.0, size=12, matrices=matrices, world=1.0, passes=["Combined"])


# On fibers one shape: each has kernels of its own, and compiling them is most of the time.
@pytest.mark.parametrize(("shape", "build"), [
    ("RIBBON", fibre), ("RIBBON", cones), *(pytest.param(s, fibre, marks=pytest.mark.cuda) for s in SHAPES[1:]),
])  # fmt: skip
def test_hair_looks_as_on_the_cpu(place: str, shape: str, build: Build) -> None:
    scene = tangle(shape, build)
    scene.settings.samples = 2
    ours, cpu = render(replace(scene, settings=replace(scene.settings, device="CUDA"))), render(scene)
    assert ours.stats["device"].startswith("CUDA"), ours.stats["warnings"]
    assert ours.stats["kernel_plan"]["CURVES"] and ours.stats["kernel_plan"]["HAIR"]
    plan = ours.stats["kernel_plan"]
    assert plan["CURVE_SHAPE"] == CURVE_SHAPES.index(shape), "no code of the other shapes"
    assert (plan["FIBRES"], plan["HAIR_CONES"]) == (build is fibre, build is cones), "no code of the other lobes"
    a, b = ours.passes["Combined"], cpu.passes["Combined"]
    if place == FIBERS:
        np.testing.assert_allclose(a, b, rtol=2e-6, atol=1e-7)
        assert ours.stats["rays"] == cpu.stats["rays"]
    else:  # a few of a GPU's functions differ in the last bit, so a path may turn
        assert (~np.isclose(a, b, rtol=1e-4, atol=1e-5)).mean() < 0.02


def test_kernels_of_scenes_without_hair_hold_none_of_its_code() -> None:
    scene = tangle("RIBBON")
    scene.meshes[0].curves = None
    assert not any(effects_of(scene)[name].on for name in NEEDED_BY["CURVES"])
    assert all(effects_of(tangle("RIBBON"))[name].on for name in NEEDED_BY["CURVES"] + NEEDED_BY["HAIR"])
