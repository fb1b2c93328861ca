"""Leaks, acne and lost energy through whole renders. Numbers: the rows of the list of hard cases.

Other renders than these take the same figures from tests/support/hard_geometry.py with more rays: `build.py bench
hard-cases`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from luch.render import render
from luch.scene import F32, F64, Instances, Mesh, Scene
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
    stack_of_objects,
    sun,
    thin_gap,
)
from support.hard_scenes import (
    HERE,
    at,
    diffuse,
    glass,
    glow,
    instances_of,
    mesh_of,
    mirror,
    picture,
    scene_of,
)

OFFSETS = [0.0, 1e3, 1e5, 1e6, 1e7]


@every_device
@pytest.mark.parametrize("mode", ["object", "vertices"])
@pytest.mark.parametrize("offset", OFFSETS)
def test_09_no_ray_of_the_camera_leaves_a_closed_room_anywhere(offset: float, mode: str, device: str) -> None:
    assert leak(room_scene(offset, mode, 0.0, size=48, samples=8, device=device)) == 0.0


@pytest.mark.full
@every_device
@pytest.mark.parametrize("mode", ["object", "vertices"])
@pytest.mark.parametrize("offset", OFFSETS)
def test_09_none_of_two_million_rays_leaves_a_closed_room(offset: float, mode: str, device: str) -> None:
    assert leak(room_scene(offset, mode, 0.0, size=512, samples=4, device=device)) == 0.0


@every_device
@pytest.mark.parametrize("mode", ["object", "vertices"])
@pytest.mark.parametrize("offset", OFFSETS)
def test_10_no_light_leaks_into_a_closed_room_anywhere(offset: float, mode: str, device: str) -> None:
    """Both ways to be far away: in the object's place, and in the vertices themselves."""
    assert leak(room_scene(offset, mode, 0.8, size=32, samples=8, device=device)) <= 1e-7


@pytest.mark.parametrize("precision", ["FAST", "DOUBLE"])
def test_10_no_light_leaks_in_other_precisions_either(precision: str) -> None:
    assert leak(room_scene(1e5, "vertices", 0.8, size=24, samples=8, precision=precision)) <= 1e-6


def test_10_a_hole_in_the_room_is_seen() -> None:
    """What the tests of leaks look for is there to be found."""
    scene = room_scene(1e6, "vertices", 0.8, size=16, samples=8)
    mesh = scene.meshes[0]
    scene.meshes[0] = Mesh(mesh.name, mesh.positions, mesh.triangles[1:], mesh.material_slots[1:])
    assert leak(scene) > 1e-4


@every_device
def test_11_no_ray_leaves_a_ball_of_any_size(device: str) -> None:
    for power in range(-5, 10):
        for albedo in (0.0, 0.8):
            scene = ball_inside(10.0**power, size=16, samples=4, albedo=albedo, device=device)
            assert leak(scene) == 0.0, f"radius 1e{power} m"


@every_device
@pytest.mark.parametrize("elevation", [60.0, 1.0])
@pytest.mark.parametrize("offset", [0.0, 1e4, 1e6])
def test_12_a_plane_does_not_shade_itself(offset: float, elevation: float, device: str) -> None:
    for distance in 10.0 ** np.arange(7.0):
        for tilt in (0.0, 33.0):
            assert far_plane(float(distance), offset, tilt, elevation, samples=2, device=device) == 0.0, (
                distance,
                tilt,
            )


@every_device
@pytest.mark.parametrize("material", [diffuse(), mirror(), glass()], ids=["diffuse", "mirror", "glass"])
def test_13_a_quads_inner_edge_keeps_its_energy(material: object, device: str) -> None:
    for power in range(6):
        mean, worst = edge_energy(10.0**power, material, samples=16, device=device)  # type: ignore[arg-type]
        assert mean <= 1e-4 and worst <= 0.01, f"edge 1e{power} m: {mean:.1e}, worst pixel {worst:.1e}"


@every_device
@pytest.mark.parametrize("copies", [2, 10, 100, 1000])
def test_14_quads_that_coincide_look_like_one(copies: int, device: str) -> None:
    one = stack(1, device=device)
    assert one.min() > 0.05
    np.testing.assert_allclose(stack(copies, device=device), one, rtol=5e-3)
    np.testing.assert_allclose(picture(stack_in_one_mesh(copies, device=device)), one, rtol=5e-3)


@pytest.mark.parametrize("stacked", [stack_of_objects, stack_in_one_mesh])
def test_14_a_thousand_quads_in_one_place_are_traced_as_one(stacked: Callable[[int], Scene]) -> None:
    """No ray can hit any but the first, and no tree could part them: with all of them it took 45 times as long."""
    stats = render(stacked(1000)).stats
    assert (stats["triangles"], stats["duplicate_primitives"]) == (2, 1998)


@every_device
@pytest.mark.parametrize("mode", ["object", "vertices"])
def test_15_a_thin_gap_lets_no_sun_through(mode: str, device: str) -> None:
    """Down to 16 units in the last place of the largest coordinate: the cover's height, or the camera's distance."""
    assert thin_gap(0.0, 1.0, covered=False, device=device) > 0.5, "the floor is lit where nothing covers it"
    for base in (0.0, 1.0, 100.0, 1e4):
        largest = max(base if mode == "vertices" else 0.0, 5.0)
        for gap in 10.0 ** -np.arange(1.0, 8.0):
            if gap >= 16.0 * np.spacing(np.float32(largest)):
                assert thin_gap(base, float(gap), mode, device=device) == 0.0, (base, gap)


def turned(seed: int) -> F64:
    """Rotation, uneven scale and shear, perhaps mirrored."""
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    stretch = np.diag(rng.uniform(0.3, 1.0, 3)) + 0.3 * np.triu(rng.normal(size=(3, 3)), 1)
    return np.column_stack([turn @ stretch, 0.1 * rng.normal(size=3)])


CONVEX: dict[str, Sequence[F64]] = {
    "plain": [at(HERE)],
    "mirrored": [at(HERE, (-1.0, 1.0, 1.0))],
    "nested": [at(HERE, size) for size in (1.0, 0.9, 0.8)],
    "sheared": [turned(1)],
}


@every_device
@pytest.mark.parametrize("name", CONVEX)
def test_16_a_white_convex_body_cannot_be_seen_in_a_white_world(name: str, device: str) -> None:
    np.testing.assert_allclose(convex(CONVEX[name], device=device), 1.0, atol=1e-4)


@every_device
def test_16_nor_can_instances_that_are_traced_in_their_own_space(device: str) -> None:
    """So many triangles that they are not copied into the world: rays go through the transforms."""
    ball = mesh_of("Ball", accel_meshes.icosphere(6))
    place = at((0.0, 0.0, 0.0))
    scene = scene_of([ball], [diffuse(1.0)], camera=camera_above(2.4), bounces=32, samples=2, device=device)
    hidden = [at((1e3 + 3.0 * k, 1e3, 0.0)) for k in range(30)]
    scene.instances = instances_of([0] * 31, [np.column_stack([turned(3)[:, :3], place[:, 3]]), *hidden])
    np.testing.assert_allclose(picture(scene), 1.0, atol=1e-4)


def lit_ball(device: str = "CPU") -> Scene:
    """A ball under a sun."""
    ball = mesh_of("Ball", accel_meshes.icosphere(3))
    scene = scene_of([ball], [diffuse(0.8)], camera=camera_above(4.0), world=0.2, lights=[sun(50.0)], device=device)
    scene.origin = HERE  # of coordinates as they are given, rounded nowhere
    return scene


def beside(scene: Scene, mesh: Mesh, matrix: F64, emits: bool = False) -> Scene:
    """The scene with one more object."""
    return scene_of([*scene.meshes, mesh], [scene.materials[0], glow(10.0) if emits else scene.materials[0]],
                    [at(HERE), matrix], camera=scene.camera, world=0.2, lights=scene.lights, origin=scene.origin,
                    device=scene.settings.device)  # fmt: skip


def broken_meshes() -> dict[str, Mesh]:
    """Rows 23 to 26 and 29: what cannot be drawn."""
    rng = np.random.default_rng(23)
    # Coordinates of few digits, so that what should lie on a line does.
    spots = np.repeat(np.round(rng.normal(size=(1000, 1, 3)), 1) * 1.25, 3, axis=1)
    spots, along = (np.round(x * 64.0) / 64.0 for x in (spots, rng.normal(size=(1000, 1, 3))))
    lines = spots + np.array([0.0, 0.5, 1.0])[:, None] * along
    vertices, triangles = accel_meshes.icosphere(1)
    broken = vertices + np.float32(50.0)
    broken[:] = np.nan
    nothing = np.zeros((0, 3), np.float32)
    huge = np.array([[(3e38, 0, 0), (0, 3e38, 0), (0, 0, 3e38)]])
    return {
        "points": mesh_of("Points", accel_meshes.separate(spots)),
        "lines": mesh_of("Lines", accel_meshes.separate(lines)),
        "repeated indices": mesh_of("Repeated", (vertices, np.repeat(triangles[:, :1], 3, axis=1))),
        "not numbers": mesh_of("NaN", (broken, triangles)),
        "infinite": mesh_of("Infinite", (broken * np.float32(np.inf), triangles)),
        "huge": mesh_of("Huge", accel_meshes.separate(huge)),
        "denormal": mesh_of("Denormal", ((vertices * 1e-40).astype(np.float32), triangles)),
        "no faces": mesh_of("No Faces", (vertices, triangles[:0])),
        "nothing": mesh_of("Nothing", (nothing, triangles[:0])),
    }


BROKEN = broken_meshes()


def test_30_glowing_lines_that_rounding_gave_some_width_take_no_light_from_the_rest() -> None:
    """A place of many digits makes slivers of lines: they may be chosen, and what they bring is next to nothing."""
    alone, among = lit_ball(), beside(lit_ball(), BROKEN["lines"], at((0.0, 0.0, 1e-3)), emits=True)
    for scene in (alone, among):
        scene.settings.samples = 256
    assert picture(among).mean() == pytest.approx(picture(alone).mean(), rel=0.01)


TRANSFORMS = {
    "scale 0": at((0.5, 0.5, 0.0), 0.0),
    "scale 1e-20": at((0.5, 0.5, 0.0), 1e-20),
    "infinite scale": at(HERE, np.inf),
    "scale not a number": at(HERE, np.nan),
    "infinite place": at((np.inf, 0.0, 0.0)),
    "place not a number": at((np.nan, 0.0, 0.0)),
    "far place": at((3e38, 0.0, 0.0)),
}


@every_device
@pytest.mark.parametrize("emits", [False, True])
@pytest.mark.parametrize("name", BROKEN)
def test_23_to_26_29_and_30_a_broken_mesh_changes_no_pixel_and_takes_no_light(
    name: str, emits: bool, device: str
) -> None:
    alone = picture(lit_ball(device))
    among = picture(beside(lit_ball(device), BROKEN[name], at(HERE), emits))
    np.testing.assert_array_equal(among, alone)


@every_device
@pytest.mark.parametrize("emits", [False, True])
@pytest.mark.parametrize("size", [1e-30, 1e-40])
def test_26_and_30_a_tiny_ball_before_the_camera_changes_no_pixel(size: float, emits: bool, device: str) -> None:
    points, triangles = accel_meshes.icosphere(2)
    tiny = mesh_of("Tiny", ((points.astype(np.float64) * size).astype(np.float32), triangles))
    among = picture(beside(lit_ball(device), tiny, at((0.3, 0.2, 3.0)), emits))
    np.testing.assert_array_equal(among, picture(lit_ball(device)))


@every_device
@pytest.mark.parametrize("emits", [False, True])
@pytest.mark.parametrize("name", TRANSFORMS)
def test_27_and_30_a_broken_transform_changes_no_pixel_and_takes_no_light(name: str, emits: bool, device: str) -> None:
    with np.errstate(invalid="ignore"):
        other = mesh_of("Other", accel_meshes.icosphere(2))
        among = picture(beside(lit_ball(device), other, TRANSFORMS[name], emits))
    np.testing.assert_allclose(among, picture(lit_ball(device)), rtol=1e-6)


@pytest.mark.parametrize("size", [1e30, 1e37])
def test_30_an_endless_emitter_far_away_takes_no_light_from_the_rest(size: float) -> None:
    corners = np.array([[(size, -size, size), (size, size, size), (size, 0, -size)]])
    alone = picture(lit_ball()).mean()
    far = mesh_of("Far", accel_meshes.separate(corners))
    unlit = picture(beside(lit_ball(), far, at(HERE), emits=False)).mean()
    lit = picture(beside(lit_ball(), far, at(HERE), emits=True)).mean()
    assert np.isfinite(lit) and lit >= 0.99 * unlit, (alone, unlit, lit)


@every_device
def test_29_a_single_triangle_renders(device: str) -> None:
    one = mesh_of("One", accel_meshes.separate(np.array([[(-9, -9, 0), (9, -9, 0), (0, 9, 0)]])))
    np.testing.assert_allclose(
        picture(scene_of([one], [diffuse(1.0)], camera=camera_above(0.5), device=device)), 1.0, atol=1e-5
    )


@every_device
@pytest.mark.parametrize("thickness", [1e-6, 1e-12, 1e-20, 1e-30, 0.0])
def test_28_flattened_instances_keep_the_light_between_them(thickness: float, device: str) -> None:
    ball = mesh_of("Ball", accel_meshes.icosphere(3))
    places = [at((0.0, 0.0, 1e-3 * k), (1.0, 1.0, thickness)) for k in range(2)]
    scene = scene_of(
        [ball] * 2, [diffuse(1.0)], places, camera=camera_above(2.4), bounces=64, samples=16, device=device
    )
    np.testing.assert_allclose(picture(scene), 1.0, atol=1e-4)


@every_device
@pytest.mark.parametrize("copies", [1000, 100_000, pytest.param(1_000_000, marks=pytest.mark.full)])
def test_31_and_32_triangles_that_coincide_or_share_a_plane_look_like_one_layer(copies: int, device: str) -> None:
    camera = camera_above(0.5)
    one = accel_meshes.separate(np.array([[(-3, -3, 0), (3, -3, 0), (0, 3, 0)]]))
    same = (np.tile(one[0], (copies, 1)), np.arange(3 * copies, dtype=np.uint32).reshape(-1, 3))
    rng = np.random.default_rng(32)
    spots = np.concatenate([rng.uniform(-1, 1, (copies, 1, 2)) + 0.3 * rng.normal(size=(copies, 3, 2)),
                            np.zeros((copies, 3, 1))], axis=2)  # fmt: skip
    plane = accel_meshes.separate(spots)
    layer, twins, flat = (
        picture(
            scene_of(
                [mesh_of("Layer", mesh)], [diffuse(0.5)], camera=camera, world=0.3, lights=[sun(60.0)], device=device
            )
        )
        for mesh in (one, same, plane)
    )
    np.testing.assert_array_equal(twins, layer)
    assert flat.mean() == pytest.approx(layer.mean(), rel=0.02)


@every_device
@pytest.mark.parametrize("scale", [(-1.0, 1.0, 1.0), (-1.0, -1.0, -1.0), (3.0, 0.3, 1.0)])
def test_37_a_mirrored_or_sheared_instance_looks_like_its_baked_mesh(
    scale: tuple[float, float, float], device: str
) -> None:
    points, triangles = accel_meshes.icosphere(2)
    turn = turned(5)[:, :3] if scale[0] > 1.0 else np.eye(3)
    linear = turn @ np.diag(scale)
    order = [0, 2, 1] if np.linalg.det(linear) < 0 else [0, 1, 2]
    baked = (points @ linear.T.astype(np.float32), triangles[:, order].copy())
    camera = camera_above(4.0)
    pictures: list[F32] = []
    for mesh, matrix in ((baked, at(HERE)), ((points, triangles), np.column_stack([linear, np.zeros(3)]))):
        scene = scene_of([mesh_of("Ball", mesh)], [glass()], [matrix], camera=camera, world=0.2, lights=[sun(50.0)],
                         samples=16, device=device)  # fmt: skip
        scene.film.passes = ["Combined", "Normal"]
        passes = render(scene).passes
        assert np.isfinite(passes["Combined"]).all()
        pictures += [passes["Combined"][..., :3], passes["Normal"]]
    different = np.abs(pictures[2] - pictures[0]).max(axis=2) > 1e-2
    assert different.mean() <= 0.02, "paths may turn at edges only"
    np.testing.assert_allclose(pictures[3], pictures[1], atol=2e-2)


@every_device
@pytest.mark.parametrize("depth", [8, 32])
def test_36_an_instance_of_many_nested_transforms_is_the_one_transform_they_make(depth: int, device: str) -> None:
    """What so many parents make, each mirrored and stretched, arrives as one matrix in double."""
    step = np.eye(4)
    step[:3, :3] = np.diag([-1.01, 1.0, 0.99])
    step[:3, 3] = 0.01, -0.02, 0.0
    matrix = np.linalg.matrix_power(step, depth)[:3]
    points, triangles = accel_meshes.icosphere(2)
    baked = (points @ matrix[:, :3].T + matrix[:, 3]).astype(np.float32)
    ours, flat = (
        picture(scene_of([mesh_of("Ball", mesh)], [diffuse(0.8)], [where], camera=camera_above(5.0), world=0.2,
                         lights=[sun(50.0)], device=device))
        for mesh, where in (((points, triangles), matrix), ((baked, triangles), at(HERE)))
    )  # fmt: skip
    assert (np.abs(ours - flat).max(axis=2) > 1e-3).mean() <= 0.02


def bytes_of(count: int) -> tuple[float, float]:
    """Bytes and seconds an instance that `count` instances of one mesh take."""
    ball = mesh_of("Ball", accel_meshes.icosphere(1))
    scene = scene_of([ball], [diffuse()], camera=camera_above(4.0), size=(4, 4), samples=1, bounces=1)
    matrices = np.repeat(np.eye(3, 4)[None], count, axis=0)
    matrices[:, :, 3] = np.random.default_rng(35).uniform(-100, 100, (count, 3))
    scene.instances = Instances(np.zeros(count, np.uint32), matrices, np.zeros(count, np.float32),
                                np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32))  # fmt: skip
    stats = render(scene).stats
    return (stats["structure_bytes"] + stats["scene_bytes"]) / count, stats["prepare_seconds"] / count


@pytest.mark.long
@pytest.mark.parametrize(
    ("count", "most"),
    [(1000, 66 * 80), (30_000, 2048), (100_000, 2048), pytest.param(1_000_000, 2048, marks=pytest.mark.full)],
)
def test_35_instances_cost_memory_in_proportion(count: int, most: int) -> None:
    """Few instances are copied to the world, where rays find them sooner: 80 triangles of 66 bytes each at the most."""
    size, seconds = bytes_of(count)
    print(f"{count} instances: {size:.0f} bytes and {seconds * 1e6:.1f} us each")
    assert size <= most


@every_device
def test_63_empty_scenes_show_the_world(device: str) -> None:
    empty = scene_of([], [], camera=camera_above(2.0), world=0.25, device=device)
    np.testing.assert_array_equal(picture(empty), np.float32(0.25))
    np.testing.assert_array_equal(picture(scene_of([], [], camera=camera_above(2.0), world=0.0, device=device)), 0.0)
    hidden = lit_ball(device)
    hidden.objects[0].visibility = 0
    hidden.lights = []
    np.testing.assert_allclose(picture(hidden), 0.2, rtol=1e-6)


def test_09_the_room_is_looked_at_from_all_sides() -> None:
    """Primary rays of the panorama cover the sphere: the six walls are all seen."""
    scene = room_scene(0.0, "object", 0.0, size=16, samples=1)
    scene.film.passes = ["Combined", "Normal"]
    normals = render(scene).passes["Normal"].reshape(-1, 3)
    assert {tuple(np.round(n).astype(int)) for n in normals if math.isclose(np.abs(n).max(), 1.0)} >= {
        (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)}  # fmt: skip
