"""Cameras at the edges of what a user can type, and pixel filters. Agreement with Cycles is in tests/addon."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch import core
from luch.scene import Camera, Film
from numpy.typing import NDArray

KINDS = ["PERSP", "ORTHO", "EQUIRECTANGULAR"]
FLT_MAX = float(np.finfo(np.float32).max)


def lens_points(n: int) -> NDArray[np.float32]:
    return core.sampling.sample_2d(3, np.arange(n, dtype=np.uint32), 0)


def raster_points(n: int, film: Film) -> NDArray[np.float32]:
    return core.sampling.sample_2d(4, np.arange(n, dtype=np.uint32), 1) * np.float32([film.width, film.height])


def rays(camera: Camera, film: Film, n: int = 256, origin: Any = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    return core.camera.rays(camera, film, raster_points(n, film), lens_points(n), origin).astype(np.float64)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("width", "height"), [(1, 1), (16384, 1), (1, 16384), (16384, 16)])
def test_any_resolution_has_unit_rays_and_its_corners_project_back(kind: str, width: int, height: int) -> None:
    camera, film = Camera(kind=kind, shift_x=0.1), Film(width=width, height=height)
    out = rays(camera, film)
    np.testing.assert_allclose(np.linalg.norm(out[:, 3:6], axis=1), 1.0, atol=1e-6)
    points = out[:, 0:3] + 5.0 * out[:, 3:6]
    raster = core.camera.project(camera, film, points)[:, :2]
    off = np.abs(raster - raster_points(256, film))
    if kind == "EQUIRECTANGULAR":  # a full turn further is the same direction
        off[:, 0] = np.minimum(off[:, 0], np.abs(off[:, 0] - width))
    assert off.max() < 3e-6 * max(width, height) + 2e-3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("start", "end", "sees"),
    [
        (0.1, 1000.0, True),
        (5.0, 1.0, False),  # the wrong way round: nothing, as in Cycles
        (1e-6, 1000.0, True),
        (0.1, 3e38, True),
        (0.1, np.inf, True),
        (0.0, FLT_MAX, True),
        (2.0, 2.0, None),  # a slice of no thickness
    ],
)
def test_clip_range_stays_finite(kind: str, start: float, end: float, sees: bool | None) -> None:
    out = rays(Camera(kind=kind, clip_start=start, clip_end=end), Film(width=64, height=48))
    assert np.isfinite(out[:, :7]).all() and np.isfinite(out[:, 8:]).all()
    assert not np.isnan(out[:, 7]).any()
    if sees is not None:
        assert ((out[:, 7] > 0) == sees).all()


@pytest.mark.parametrize("place", [0.0, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_plane_exactly_at_clip_start_is_seen_by_every_pixel(kind: str, place: float) -> None:
    matrix = np.eye(3, 4)
    matrix[:, 3] = place
    out = rays(Camera(kind=kind, clip_start=0.5, matrix=matrix), Film(width=64, height=48), 4096).astype(np.float32)
    plane = np.float32(place - 0.5)
    t = (plane - out[:, 2]) / out[:, 5]  # single precision, as a tracer would
    assert (t > out[:, 6]).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "fields",
    [
        {"fstop": 0.0},
        {"fstop": 1e-6},
        {"focus_distance": 0.0},
        {"focus_distance": 1e30},
        {"focus_distance": np.inf},
        {"fstop": 1e-6, "focus_distance": 1e-6},
        {"ortho_scale": 0.0},
        {"ortho_scale": 1e-6},
        {"lens_mm": 1.0},
        {"sensor_width_mm": 1e-3},
        {"aperture_ratio": 0.01, "blades": 3},
        {"blades": 2},
        {"latitude": (0.5, 0.5), "longitude": (1.0, 1.0)},
    ],
)
def test_rays_are_unit_and_finite_whatever_the_lens(kind: str, fields: dict[str, Any]) -> None:
    # A white world seen along unit rays of weight 1 is exactly white.
    out = rays(Camera(kind=kind, use_dof=True, **fields), Film(width=64, height=48), 4096)
    assert np.isfinite(out).all()
    np.testing.assert_allclose(np.linalg.norm(out[:, 3:6], axis=1), 1.0, atol=2e-6)


def test_rays_through_one_raster_point_meet_in_the_plane_of_focus() -> None:
    film = Film(width=64, height=48)
    raster = np.repeat(np.float32([[50.3, 7.7]]), 500, axis=0)
    for kind in ("PERSP", "ORTHO"):
        camera = Camera(kind=kind, use_dof=True, focus_distance=4.0, fstop=0.5, blades=5)
        out = core.camera.rays(camera, film, raster, lens_points(500)).astype(np.float64)
        t = (-4.0 - out[:, 2]) / out[:, 5]
        meet = out[:, 0:3] + t[:, None] * out[:, 3:6]
        assert np.ptp(meet, axis=0).max() < 1e-5
        assert np.ptp(out[:, 0:2], axis=0).max() > 1e-3


def test_pole_rows_of_a_panorama_look_straight_up_and_down() -> None:
    film = Film(width=256, height=128)
    x = np.arange(256) + 0.5
    for y, z in ((127.999, 1.0), (0.001, -1.0)):
        raster = np.stack([x, np.full(256, y)], axis=1).astype(np.float32)
        # Blender's panorama has its zenith along the camera's own +Y.
        out = core.camera.rays(Camera(kind="EQUIRECTANGULAR"), film, raster, np.zeros((256, 2), np.float32))
        assert np.abs(out[:, 4] - z).max() < 1e-3
        assert np.ptp(out[:, 4]) < 1e-6  # a world that depends on height alone gives an even row


@pytest.mark.parametrize("kind", KINDS)
def test_footprint_is_the_distance_to_the_next_pixels_ray(kind: str) -> None:
    camera, film = Camera(kind=kind, lens_mm=20.0, clip_start=2.0), Film(width=640, height=480)
    raster = np.random.default_rng(1).uniform([0, 40], [640, 440], (200, 2)).astype(np.float32)
    lens = np.zeros_like(raster)
    at, right, above = (
        core.camera.rays(camera, film, raster + np.float32(step), lens).astype(np.float64)
        for step in ([0, 0], [1, 0], [0, 1])
    )
    # Axis-parallel step of the unit direction, and of the origin where rays are parallel.
    column = slice(0, 3) if kind == "ORTHO" else slice(3, 6)
    step = 0.5 * sum(np.linalg.norm(other[:, column] - at[:, column], axis=1) for other in (right, above))
    mine = at[:, 8] if kind == "ORTHO" else at[:, 9]
    np.testing.assert_allclose(mine, step, rtol=3e-3)
    if kind != "ORTHO":
        np.testing.assert_allclose(at[:, 8], at[:, 9] * np.linalg.norm(at[:, 0:3], axis=1), rtol=1e-5)


def test_the_origin_is_subtracted_in_double() -> None:
    matrix = np.eye(3, 4)
    matrix[:, 3] = (1e7 + 0.125, -1e7, 3e7)
    out = rays(Camera(matrix=matrix, clip_start=0.0), Film(width=8, height=8), 1, (1e7, -1e7, 3e7))
    np.testing.assert_allclose(out[0, 0:3], (0.125, 0, 0), atol=1e-6)


def test_scale_of_the_camera_object_does_not_matter_but_a_flat_one_is_refused() -> None:
    film = Film(width=8, height=8)
    np.testing.assert_allclose(rays(Camera(matrix=np.eye(3, 4) * 7), film), rays(Camera(), film), atol=1e-7)
    flat = np.eye(3, 4)
    flat[:, 1] = flat[:, 0]
    with pytest.raises(ValueError, match="matrix is flat"):
        rays(Camera(matrix=flat), film)
    with pytest.raises(ValueError, match='kind "FISHEYE" is unknown'):
        rays(Camera(kind="FISHEYE"), film)


def density(kind: str, x: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    if kind == "BOX":
        return np.where(np.abs(x) < 0.5, 1.0, 0.0)
    if kind == "GAUSSIAN":
        return np.where(np.abs(x) < 1.5 * width, np.exp(-8.0 * (x / width) ** 2), 0.0)
    a = np.pi * (x / width + 1)
    shape = 0.35875 - 0.48829 * np.cos(a) + 0.14128 * np.cos(2 * a) - 0.01168 * np.cos(3 * a)
    return np.where(np.abs(x) < width, shape, 0.0)


@pytest.mark.parametrize("kind", ["BOX", "GAUSSIAN", "BLACKMAN_HARRIS"])
@pytest.mark.parametrize("width", [0.01, 1.5, 10.0])
def test_filter_offsets_follow_blenders_filter(kind: str, width: float) -> None:
    u = (np.arange(1 << 18) + 0.5) / (1 << 18)
    offsets = np.sort(core.camera.filter_offsets(kind, width, u.astype(np.float32)).astype(np.float64))
    x = np.linspace(-2 * width - 1, 2 * width + 1, 1 << 18)
    mass = np.cumsum(density(kind, x, width))
    mass /= mass[-1]
    ideal = np.interp(offsets, x, mass)
    worst = np.abs(ideal - u).max()
    print(f"{kind} {width}: largest error of the cumulative distribution {worst:.2e}")
    assert worst < 1e-3
    assert abs(offsets.mean()) < 1e-4 * width
    ideal_deviation = np.sqrt(np.sum(x**2 * density(kind, x, width)) / np.sum(density(kind, x, width)))
    assert offsets.std() == pytest.approx(ideal_deviation, rel=3e-3)  # linear steps widen the tails
