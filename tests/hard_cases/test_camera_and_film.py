"""Cameras, sampler and film at their limits, through whole renders. Numbers: the rows of the list of hard cases."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import core
from luch.render import render
from luch.scene import F32, Camera, Film, Instances, Material, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder, float_word
from numpy.typing import NDArray
from support import accel_meshes, closed_meshes
from support.asked import every_device
from support.hard_scenes import glow, mesh_of, scene_of

KINDS = ["PERSP", "ORTHO", "EQUIRECTANGULAR"]


def world(strength: float = 1.0) -> World:
    """The same light from everywhere."""
    builder = ProgramBuilder()
    builder.closure("CLOSURE_EMISSION", builder.vector(strength, strength, strength))
    return World("World", builder.finish())


def picture(scene: Scene, name: str = "Combined") -> F32:
    """A pass of the rendered scene, (H, W, C)."""
    return render(scene).passes[name]


def furnace(
    camera: Camera, film: Film | None = None, samples: int = 4, strength: float = 1.0, device: str = "CPU"
) -> Scene:
    return Scene(
        world=world(strength),
        camera=camera,
        film=film or Film(width=16, height=12),
        settings=Settings(samples=samples, threads=1, device=device),
    )


def rotation_x(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0]], np.float64)


def with_wall(scene: Scene, z: float, size: float = 1e4) -> Scene:
    """Adds a black square that faces the camera at height z."""
    corners = np.float32([[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]])
    mesh = Mesh("Wall", corners, np.uint32([[0, 1, 2], [0, 2, 3]]), np.zeros(2, np.uint16))
    black = ProgramBuilder()
    zero = black.constant(0.0)
    one = black.vector(1.0, 1.0, 1.0)
    black.closure("CLOSURE_DIFFUSE", black.vector(0.001, 0.001, 0.001), (*one, zero, zero, zero, zero), (1,))
    scene.meshes, scene.objects = [mesh], [Object("Wall", 0, [0])]
    scene.materials = [Material("Black", black.finish())]
    scene.instances = Instances(
        object=np.zeros(1, np.uint32),
        matrix=np.eye(3, 4)[None],
        random=np.zeros(1, np.float32),
        generated=np.zeros((1, 3), np.float32),
        uv=np.zeros((1, 2), np.float32),
    )
    return scene


@every_device
@pytest.mark.parametrize(("width", "height"), [(1, 1), (16384, 1), (1, 16384), (16384, 16)])
def test_54_any_resolution_renders_in_its_shape_and_mean(width: int, height: int, device: str) -> None:
    pixels = picture(furnace(Camera(), Film(width=width, height=height), samples=1, strength=0.25, device=device))
    assert pixels.shape == (height, width, 4)
    np.testing.assert_array_equal(pixels, np.broadcast_to(np.float32([0.25, 0.25, 0.25, 1.0]), pixels.shape))


def test_54_a_border_shows_exactly_its_part_of_the_frame() -> None:
    builder = ProgramBuilder()
    direction = builder.op3("POINT_POSITION", (), (float_word(0.0),) * 3)
    builder.closure("CLOSURE_EMISSION", builder.each("MATH_ABSOLUTE", direction))
    scene = furnace(Camera(lens_mm=20.0), Film(width=16, height=12))
    scene.world = World("World", builder.finish())
    # One sampler serves a square of pixels; parts of the frame must still meet the same samples.
    whole = picture(scene)
    part = picture(replace(scene, film=replace(scene.film, border=(3, 5, 14, 9))))
    np.testing.assert_array_equal(part, whole[5:9, 3:14])


CLIPS = [
    (0.1, 1000.0, True),
    (1e-6, 1000.0, True),
    (0.1, 3e38, True),
    (2.0, 3e38, True),  # the wall stands exactly at clip_start
    (2.5, 1000.0, False),
    (5.0, 1.0, False),  # the wrong way round: nothing is in it
    (0.1, 1.0, False),
]


# A panorama clips by a sphere, which no wall can lie in.
@every_device
@pytest.mark.parametrize(
    ("kind", "start", "end", "sees_wall"),
    [(kind, *clip) for kind in KINDS for clip in CLIPS if not (kind == "EQUIRECTANGULAR" and clip[0] == 2.0)],
)
def test_55_clipping_is_all_or_nothing_and_finite(
    kind: str, start: float, end: float, sees_wall: bool, device: str
) -> None:
    camera = Camera(kind=kind, clip_start=start, clip_end=end, lens_mm=200.0, ortho_scale=1.0)
    camera.latitude, camera.longitude = (-0.1, 0.1), (-0.1, 0.1)
    pixels = picture(with_wall(furnace(camera, device=device), -2.0))[..., 0]
    assert np.isfinite(pixels).all()
    if sees_wall:
        assert (pixels < 0.5).all()
    else:
        np.testing.assert_array_equal(pixels, 1.0)


@every_device
def test_55_a_slice_of_no_thickness_is_finite(device: str) -> None:
    scene = with_wall(furnace(Camera(clip_start=2.0, clip_end=2.0), device=device), -2.0)
    assert np.isfinite(picture(scene)).all()


@every_device
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "fields",
    [
        {"fstop": 0.0},
        {"fstop": 1e-6},
        {"focus_distance": 0.0},
        {"focus_distance": 1e30},
        {"ortho_scale": 0.0},
        {"ortho_scale": 1e-6},
        {"lens_mm": 1.0},
        {"sensor_width_mm": 1e-3},
    ],
)
def test_56_a_furnace_is_exactly_white_through_any_lens(kind: str, fields: dict[str, Any], device: str) -> None:
    pixels = picture(furnace(Camera(kind=kind, use_dof=True, blades=5, **fields), device=device))
    np.testing.assert_array_equal(pixels, 1.0)
    ball = mesh_of("Ball", closed_meshes.moved(accel_meshes.icosphere(2), 1e6))  # which rays that are none do not meet
    camera = Camera(kind=kind, use_dof=True, blades=5, clip_end=1e9, **fields)
    np.testing.assert_array_equal(picture(scene_of([ball], [glow(1.0)], camera=camera, world=0.0, device=device)), 1.0)


@every_device
def test_57_the_poles_of_a_panorama_are_even(device: str) -> None:
    builder = ProgramBuilder()
    _, _, up = builder.op3("POINT_POSITION", (), (float_word(0.0),) * 3)
    half = builder.constant(0.5)
    height = builder.op1("MATH_MULTIPLY_ADD", (up, half, half))
    builder.closure("CLOSURE_EMISSION", (height, height, height))
    camera = Camera(kind="EQUIRECTANGULAR", matrix=rotation_x(np.pi / 2))  # upright, as on the floor
    scene = furnace(camera, Film(width=128, height=64), samples=16, device=device)
    scene.world = World("World", builder.finish())
    rows = picture(scene)[..., 0]
    spread = np.ptp(rows[[0, -1]], axis=1)
    print(f"spread within the pole rows: {spread}")
    assert spread.max() <= 1e-3
    assert rows[-1].mean() == pytest.approx(1.0, abs=2e-3) and rows[0].mean() == pytest.approx(0.0, abs=2e-3)


@every_device
@pytest.mark.parametrize("strength", [0.1, 1.0, 1e4])
@pytest.mark.parametrize("samples", [1, 1024, 65536])
def test_59_equal_samples_have_their_own_mean(strength: float, samples: int, device: str) -> None:
    pixels = picture(furnace(Camera(), Film(width=2, height=2), samples=samples, strength=strength, device=device))
    error = np.abs(pixels[..., :3] / np.float32(strength) - 1).max()
    print(f"{samples} samples of {strength}: relative error {error:.1e}")
    assert error <= 1e-6


def test_60_a_deviation_on_a_bright_ground_is_that_of_two_passes() -> None:
    """A million and noise of 1: what two halves differ by, against their means in double."""
    count, rng = 4096, np.random.default_rng(60)
    samples = (1e6 + rng.normal(size=(count, 3))).astype(np.float32)
    film = core.film.Film(Film(width=1, height=1), marks=True)
    channel = film.channel("Combined")
    film.add_samples(0, channel, samples[: count // 2])
    film.count_samples(0, count // 2)
    film.mark(0, count // 2)
    film.add_samples(0, channel, samples[count // 2 :])
    film.count_samples(0, count // 2)
    mean, deviation, share = film.deviations()
    halves = samples.astype(np.float64).reshape(2, count // 2, 3).mean(axis=1)
    assert share == 0.5
    np.testing.assert_allclose(mean[0, 0], samples.mean(axis=0, dtype=np.float64), rtol=1e-7)
    np.testing.assert_allclose(np.abs(deviation[0, 0]), np.abs(halves[0] - halves[1]) / 2.0, rtol=1e-3)


def test_60_merged_parts_vary_as_one(count: int = 1 << 14) -> None:
    """Sums of parts are added, in double: no order of them moves the mean of a million and noise of 1."""
    samples = (1e6 + np.random.default_rng(61).normal(size=(count, 3))).astype(np.float32)
    whole, parts = (core.film.Film(Film(width=1, height=1)) for _ in range(2))
    whole.add_samples(0, whole.channel("Combined"), samples)
    for part in np.array_split(samples, 7):
        one = core.film.Film(Film(width=1, height=1))
        one.add_samples(0, one.channel("Combined"), part)
        one.count_samples(0, len(part))
        parts.merge(one)
    whole.count_samples(0, count)
    assert whole.resolve()["Combined"].tobytes() == parts.resolve()["Combined"].tobytes()


@every_device
@pytest.mark.parametrize("strength", [1e-38, 1e-20, 1e10, 1e30, 1e35, 1e38])
def test_64_light_near_the_ends_of_the_float_range_stays_finite_and_right(strength: float, device: str) -> None:
    pixels = picture(furnace(Camera(), samples=64, strength=strength, device=device))
    np.testing.assert_allclose(pixels[..., :3], np.float32(strength), rtol=1e-6)


@every_device
def test_64_light_beyond_the_float_range_never_enters(device: str) -> None:
    result = render(furnace(Camera(), samples=4, strength=np.inf, device=device))
    assert np.isfinite(result.passes["Combined"]).all()


@pytest.mark.promise(12)
def test_the_picture_does_not_depend_on_the_number_of_threads() -> None:
    scene = with_wall(furnace(Camera(use_dof=True, fstop=0.1), Film(width=70, height=50), samples=3), -30.0, 5.0)
    pictures = []
    for threads in (1, 2, 5):
        scene.settings.threads = threads
        pictures.append(picture(scene))
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])
