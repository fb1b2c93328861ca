"""Rows of test_geometry.py through every structure that a scene may be traced by. Numbers: the rows of the hard cases.

test_geometry.py asks the same of the default one with more places and samples.
"""

from __future__ import annotations

import numpy as np
import pytest
from luch.scene import F64, Mesh
from support import accel_meshes
from support.asked import every_device
from support.hard_geometry import (
    ball_inside,
    camera_above,
    convex,
    edge_energy,
    far_plane,
    leak,
    room_scene,
    stack,
    stack_in_one_mesh,
    sun,
    thin_gap,
)
from support.hard_scenes import HERE, at, diffuse, glass, mesh_of, mirror, picture, scene_of

every_kind = pytest.mark.parametrize(
    "kind", ["BVH2", "BVH2_STACKLESS", "CWBVH", "KD_TREE", "HIERARCHICAL_GRID", "GRID"]
)


@every_device
@every_kind
@pytest.mark.parametrize("offset", [0.0, 1e3, 1e5, 1e6, 1e7])
def test_09_and_10_no_light_leaks_through_any_structure(offset: float, kind: str, device: str) -> None:
    for mode in ("object", "vertices"):
        seen = room_scene(offset, mode, 0.0, size=24, samples=4, accelerator=kind, device=device)
        assert leak(seen) == 0.0, mode
        met = room_scene(offset, mode, 0.8, size=16, samples=8, accelerator=kind, device=device)
        assert leak(met) <= 1e-7, mode


@every_device
@every_kind
def test_11_no_ray_leaves_a_ball_of_any_size_through_any_structure(kind: str, device: str) -> None:
    for power in range(-5, 10):
        scene = ball_inside(10.0**power, size=12, samples=4, albedo=0.8, accelerator=kind, device=device)
        assert leak(scene) == 0.0, f"radius 1e{power} m"


@every_device
@every_kind
@pytest.mark.parametrize("offset", [0.0, 1e4, 1e6])
def test_12_a_plane_does_not_shade_itself_in_any_structure(offset: float, kind: str, device: str) -> None:
    for distance in (1.0, 1e3, 1e6):
        for elevation in (60.0, 1.0):
            wrong = far_plane(distance, offset, 33.0, elevation, samples=1, accelerator=kind, device=device)
            assert wrong == 0.0, (distance, elevation)


@every_device
@every_kind
@pytest.mark.parametrize("material", [diffuse(), mirror(), glass()], ids=["diffuse", "mirror", "glass"])
def test_13_a_quads_inner_edge_keeps_its_energy_in_any_structure(material: object, kind: str, device: str) -> None:
    for power in range(6):
        mean, worst = edge_energy(10.0**power, material, samples=4, accelerator=kind, device=device)  # type: ignore[arg-type]
        assert mean <= 1e-4 and worst <= 0.01, f"edge 1e{power} m: {mean:.1e}, worst pixel {worst:.1e}"


@every_device
@every_kind
def test_14_quads_that_coincide_look_like_one_in_any_structure(kind: str, device: str) -> None:
    one = stack(1, accelerator=kind, device=device)
    for copies in (2, 100):
        np.testing.assert_allclose(stack(copies, accelerator=kind, device=device), one, rtol=5e-3)
        together = stack_in_one_mesh(copies, accelerator=kind, device=device)
        np.testing.assert_allclose(picture(together), one, rtol=5e-3)


@every_device
@every_kind
@pytest.mark.parametrize("mode", ["object", "vertices"])
def test_15_a_thin_gap_lets_no_sun_through_any_structure(mode: str, kind: str, device: str) -> None:
    assert thin_gap(0.0, 1.0, covered=False, accelerator=kind, device=device) > 0.5
    for base in (0.0, 1.0, 100.0, 1e4):
        largest = max(base if mode == "vertices" else 0.0, 5.0)
        for gap in 10.0 ** -np.arange(1.0, 8.0):
            if gap >= 16.0 * np.spacing(np.float32(largest)):
                lit = thin_gap(base, float(gap), mode, accelerator=kind, device=device, samples=2)
                assert lit == 0.0, (base, gap)


@every_device
@every_kind
def test_16_a_white_convex_body_cannot_be_seen_through_any_structure(kind: str, device: str) -> None:
    nested: list[F64] = [at(HERE, size) for size in (1.0, 0.9, 0.8)]
    for matrices in (nested[:1], [at(HERE, (-1.0, 1.0, 1.0))], nested):
        np.testing.assert_allclose(convex(matrices, accelerator=kind, device=device), 1.0, atol=1e-4)


@every_device
@pytest.mark.parametrize("kind", ["BVH", *every_kind.args[1]])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_24_faces_beside_a_broken_vertex_are_drawn(value: float, kind: str, device: str) -> None:
    points, triangles = accel_meshes.icosphere(2)

    def drawn(mesh: Mesh) -> np.ndarray:  # type: ignore[type-arg]
        return picture(scene_of([mesh], [diffuse(0.8)], camera=camera_above(2.4), world=0.2, lights=[sun(50.0)],
                                origin=HERE, accelerator=kind, device=device))  # fmt: skip

    broken = points.copy()
    broken[7] = value
    whole = drawn(mesh_of("Ball", (points, triangles[(triangles != 7).all(1)])))
    assert whole.std() > 0.05
    np.testing.assert_array_equal(drawn(mesh_of("Ball", (broken, triangles))), whole)
    nothing = drawn(mesh_of("Ball", (np.full_like(points, value), triangles)))
    np.testing.assert_allclose(nothing, 0.2, rtol=1e-6)


@every_device
@every_kind
def test_28_flattened_instances_keep_the_light_between_them_in_any_structure(kind: str, device: str) -> None:
    ball = mesh_of("Ball", accel_meshes.icosphere(3))
    for thickness in (1e-6, 1e-20, 0.0):
        places = [at((0.0, 0.0, 1e-3 * k), (1.0, 1.0, thickness)) for k in range(2)]
        scene = scene_of([ball] * 2, [diffuse(1.0)], places, camera=camera_above(2.4), bounces=64, samples=4,
                         accelerator=kind, device=device)  # fmt: skip
        np.testing.assert_allclose(picture(scene), 1.0, atol=1e-4, err_msg=f"{thickness}")
