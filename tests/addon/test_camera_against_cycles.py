"""Luch's camera rays against Cycles': its Position pass must lie on our ray through the pixel's centre."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch import core
from luch.scene import Camera, Film
from numpy.typing import NDArray
from support.blender import save_every_pass

from addon.export.camera import PANORAMAS, add_panorama

bpy = pytest.importorskip("bpy")
oiio = pytest.importorskip("OpenImageIO")

WIDTH, HEIGHT = 24, 16
ROOM = 40.0  # half the side of the box around the camera, metres


@pytest.fixture(scope="module")
def scene() -> Any:
    """A camera somewhere in a big closed box; Cycles with one sample in the middle of each pixel."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("Box")
    corners = [(x * ROOM, y * ROOM, z * ROOM) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    scene.collection.objects.link(bpy.data.objects.new("Box", mesh))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.location = (1.0, -2.0, 3.0)
    camera.rotation_euler = (1.2, 0.3, 0.7)
    camera.scale = (2.0, 3.0, 0.5)  # must not matter
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.filter_width = 0.01  # pixels: Position is taken within 0.015 pixels of the centre
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 1
    scene.view_layers[0].use_pass_position = True
    save_every_pass(scene)
    return scene


def render_positions(scene: Any, folder: Path) -> NDArray[np.float64]:
    """Cycles' Position pass, (H * W, 3), bottom row first, with the raster centres of its pixels."""
    scene.render.filepath = str(folder / "position.exr")
    bpy.ops.render.render(write_still=True)
    file = oiio.ImageInput.open(scene.render.filepath)
    part = 0  # Blender writes one part per pass
    while file.seek_subimage(part, 0):
        names = list(file.spec().channelnames)
        columns = [i for axis in "XYZ" for i, n in enumerate(names) if n.endswith(f"Position.{axis}")]
        if columns:
            pixels = np.asarray(file.read_image("float"))[::-1]
            break
        part += 1
    else:
        raise AssertionError("no Position pass in Cycles' file")
    file.close()
    return pixels[..., columns].reshape(-1, 3).astype(np.float64)


def centres() -> NDArray[np.float32]:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([x.ravel() + 0.5, y.ravel() + 0.5], axis=1).astype(np.float32)


def luch_camera(scene: Any) -> tuple[Camera, Film]:
    data = scene.camera.data
    kind = PANORAMAS[data.panorama_type] if data.type == "PANO" else data.type
    camera = Camera(
        kind=kind,
        matrix=np.array(scene.camera.matrix_world)[:3],
        lens_mm=data.lens,
        sensor_width_mm=data.sensor_width,
        sensor_height_mm=data.sensor_height,
        sensor_fit=data.sensor_fit,
        ortho_scale=data.ortho_scale,
        shift_x=data.shift_x,
        shift_y=data.shift_y,
        clip_start=data.clip_start,
        clip_end=data.clip_end,
        use_dof=data.dof.use_dof,
        focus_distance=data.dof.focus_distance,
        fstop=data.dof.aperture_fstop,
        blades=data.dof.aperture_blades,
        blades_rotation=data.dof.aperture_rotation,
        aperture_ratio=data.dof.aperture_ratio,
    )
    add_panorama(camera, data)
    render = scene.render
    return camera, Film(width=WIDTH, height=HEIGHT, pixel_aspect=(render.pixel_aspect_x, render.pixel_aspect_y))


CASES: dict[str, dict[str, Any]] = {
    "perspective": {},
    "lens and shift": {"lens": 24.0, "shift_x": 0.3, "shift_y": -0.2},
    "vertical fit": {"sensor_fit": "VERTICAL", "sensor_height": 20.0, "shift_x": 0.1, "shift_y": 0.4},
    "horizontal fit of a tall pixel": {"sensor_fit": "HORIZONTAL", "pixel_aspect_y": 2.0, "shift_y": 0.25},
    "automatic fit of a tall pixel": {"pixel_aspect_y": 2.0, "shift_x": 0.25},
    "wide pixel": {"pixel_aspect_x": 1.5, "shift_y": 0.1},
    "orthographic": {"type": "ORTHO", "ortho_scale": 7.0},
    "orthographic, shifted, tall pixel": {
        "type": "ORTHO",
        "ortho_scale": 5.0,
        "shift_x": 0.2,
        "shift_y": -0.3,
        "pixel_aspect_y": 2.0,
    },
    "panorama": {"type": "PANO"},
    "part of a panorama": {
        "type": "PANO",
        "latitude_min": -0.5,
        "latitude_max": 1.1,
        "longitude_min": -2.0,
        "longitude_max": 0.7,
    },
    "panorama, shifted": {
        "type": "PANO",
        "shift_x": 0.2,
        "shift_y": 0.1,
        "latitude_min": -1.2,
        "latitude_max": 1.2,
    },
    "evenly spaced fisheye": {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": 4.0},
    "fisheye of equal areas": {
        "type": "PANO",
        "panorama_type": "FISHEYE_EQUISOLID",
        "fisheye_lens": 9.0,
        "fisheye_fov": 2.7,
        "shift_x": 0.1,
        "shift_y": -0.05,
    },
    "fisheye of equal areas, tall pixel": {
        "type": "PANO",
        "panorama_type": "FISHEYE_EQUISOLID",
        "sensor_fit": "VERTICAL",
        "sensor_height": 30.0,
        "pixel_aspect_y": 1.5,
    },
    "calibrated fisheye": {
        "type": "PANO",
        "panorama_type": "FISHEYE_LENS_POLYNOMIAL",
        "fisheye_fov": 1.2,
        "fisheye_polynomial_k1": -0.03,
        "fisheye_polynomial_k2": -2e-4,
    },
    "polished ball": {"type": "PANO", "panorama_type": "MIRRORBALL"},
    "face of a cube": {"type": "PANO", "panorama_type": "EQUIANGULAR_CUBEMAP_FACE", "shift_x": 0.1},
    "cylinder": {
        "type": "PANO",
        "panorama_type": "CENTRAL_CYLINDRICAL",
        "central_cylindrical_range_u_min": -2.0,
        "central_cylindrical_range_u_max": 1.5,
        "central_cylindrical_range_v_min": -0.7,
        "central_cylindrical_range_v_max": 1.2,
        "central_cylindrical_radius": 1.3,
    },
}
DEFAULTS: dict[str, Any] = {
    "type": "PERSP",
    "lens": 50.0,
    "shift_x": 0.0,
    "shift_y": 0.0,
    "sensor_fit": "AUTO",
    "sensor_width": 36.0,
    "sensor_height": 24.0,
    "ortho_scale": 6.0,
    "latitude_min": -np.pi / 2,
    "latitude_max": np.pi / 2,
    "longitude_min": -np.pi,
    "longitude_max": np.pi,
    "clip_start": 0.1,
    "clip_end": 1000.0,
    "panorama_type": "EQUIRECTANGULAR",
    "fisheye_fov": np.pi,
    "pixel_aspect_x": 1.0,
    "pixel_aspect_y": 1.0,
}


def set_camera(scene: Any, settings: dict[str, Any]) -> None:
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    data = scene.camera.data
    data.dof.use_dof = False
    for name, value in {**DEFAULTS, **settings}.items():
        setattr(scene.render if name.startswith("pixel_aspect") else data, name, value)
    bpy.context.view_layer.update()


@pytest.mark.parametrize("name", CASES)
def test_cycles_sees_the_point_on_our_ray(name: str, scene: Any, tmp_path: Path) -> None:
    set_camera(scene, CASES[name])
    positions = render_positions(scene, tmp_path)
    camera, film = luch_camera(scene)
    rays = core.camera.rays(camera, film, centres(), np.zeros((WIDTH * HEIGHT, 2), np.float32)).astype(np.float64)
    seen = rays[:, 7] >= 0.0  # beside a fisheye's circle there is nothing
    assert ((positions != 0.0).any(axis=1) == seen).all()
    rays, positions = rays[seen], positions[seen]
    origin, direction, footprint, spread = rays[:, 0:3], rays[:, 3:6], rays[:, 8], rays[:, 9]
    t = np.einsum("ij,ij->i", positions - origin, direction)
    beside = np.linalg.norm(positions - origin - t[:, None] * direction, axis=1)
    # The footprint is the mean of a pixel's two sides; a pixel's longer side is at most twice that.
    pixels = beside / (footprint + t * spread)
    print(f"{name}: Cycles' points lie at most {pixels.max():.4f} pixels beside our rays")
    assert (t > 0).all()
    assert pixels.max() < 0.035
    off = np.abs(core.camera.project(camera, film, positions)[:, :2] - centres()[seen])
    if name == "panorama, shifted":  # a full turn further is the same direction
        off[:, 0] = np.minimum(off[:, 0], np.abs(off[:, 0] - WIDTH))
    assert off.max() < 0.03


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
def test_clipping_starts_and_ends_where_cycles_clips(kind: str, scene: Any, tmp_path: Path) -> None:
    # The walls are 37 m away and more: what lies before clip_start or beyond clip_end is not seen.
    for clip in ({"clip_start": 43.0}, {"clip_end": 43.0}):
        set_camera(scene, {"type": kind, "ortho_scale": 60.0, "lens": 15.0, **clip})
        positions = render_positions(scene, tmp_path)
        seen = (positions != 0).any(axis=1)
        camera, film = luch_camera(scene)
        rays = core.camera.rays(camera, film, centres(), np.zeros((WIDTH * HEIGHT, 2), np.float32))
        origin, direction, t_max = rays[:, 0:3], rays[:, 3:6], rays[:, 7]
        wall = np.where(direction > 0, ROOM, -ROOM)
        t = ((wall - origin) / direction).min(axis=1)
        outside = (np.abs(origin) > ROOM).any(axis=1)
        ours = ~outside & (t <= t_max)
        print(f"{kind}, {clip}: {seen.sum()} of {seen.size} pixels see a wall, {(ours != seen).sum()} differ")
        assert 0 < seen.sum() < seen.size
        assert (ours != seen).sum() <= 2  # pixels whose sample lies on the other side of the limit


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
def test_the_aperture_is_that_of_cycles(kind: str, scene: Any, tmp_path: Path) -> None:
    set_camera(scene, {"type": kind, "ortho_scale": 8.0})
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 5.0, 0.02 if kind != "ORTHO" else 0.4
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 3, 0.4, 2.0
    positions = render_positions(scene, tmp_path)
    camera, film = luch_camera(scene)
    sharp, _ = luch_camera(scene)
    sharp.use_dof = False
    lens = core.sampling.sample_2d(1, np.arange(WIDTH * HEIGHT, dtype=np.uint32), 0)
    ours = core.camera.rays(camera, film, centres(), lens).astype(np.float64)
    pinhole = core.camera.rays(sharp, film, centres(), np.zeros_like(lens)).astype(np.float64)
    axes = np.array(scene.camera.matrix_world)[:3, :3]
    axes /= np.linalg.norm(axes, axis=0)
    centre = np.array(scene.camera.matrix_world)[:3, 3]
    # The point in focus of each pixel, then where the line from it to what is seen crosses the lens.
    depth = 5.0 if kind != "PERSP" else 5.0 / -(pinhole[:, 3:6] @ axes[:, 2])[:, None]
    start = centre if kind != "ORTHO" else pinhole[:, 0:3] + axes[:, 2] * camera.clip_start
    focus = start + pinhole[:, 3:6] * depth

    def on_lens(towards: NDArray[np.float64]) -> NDArray[np.float64]:
        """Offset from the lens's centre in units of the aperture, along its own two axes."""
        d = towards - focus
        if kind == "PANO":
            local = pinhole[:, 3:6]  # the lens faces every pixel
            forward = -axes[:, 2]
            u = forward - local * (local @ forward)[:, None]
            u /= np.linalg.norm(u, axis=1)[:, None]
            v = np.cross(local, u)
        else:
            local = np.broadcast_to(-axes[:, 2], d.shape)
            u, v = (np.broadcast_to(axes[:, k], d.shape) for k in (0, 1))
        back = -np.einsum("ij,ij->i", focus - start, local) / np.einsum("ij,ij->i", d, local)
        p = focus + d * back[:, None] - start
        radius = (1.0 if kind == "ORTHO" else camera.lens_mm * 1e-3) / (2 * camera.fstop)
        return np.stack([np.einsum("ij,ij->i", p, a) for a in (u, v)], axis=1) / radius

    theirs, mine = on_lens(positions), on_lens(ours[:, 0:3] + 7.0 * ours[:, 3:6])
    half = np.pi / 3
    for points in (theirs, mine):
        for k in range(3):  # inside all three edges of the triangle, after undoing the ratio
            edge = 0.4 + k * 2 * half
            reach = points[:, 0] * 2.0 * np.cos(edge) + points[:, 1] * np.sin(edge)
            assert np.cos(half) * 0.9 < reach.max() < np.cos(half) * 1.02
    np.testing.assert_allclose(theirs.mean(axis=0), mine.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(theirs.std(axis=0), mine.std(axis=0), rtol=0.08)
