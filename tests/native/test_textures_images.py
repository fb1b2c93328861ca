"""Image lookups against numpy: interpolation, extension, formats, alpha, projections."""

from __future__ import annotations

import numpy as np
import pytest
from luch import core
from luch.textures import EXTENSIONS, INTERPOLATIONS, PROJECTIONS, TILED, UNASSOCIATE
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
run = core.textures.run
STRAIGHT, PREMULTIPLIED, CHANNEL_PACKED, IGNORE = range(4)
WIDTH, HEIGHT = 7, 5


def picture(channels: int = 4, seed: int = 1) -> F32:
    return np.random.default_rng(seed).uniform(0, 1, (HEIGHT, WIDTH, channels)).astype(np.float32)


def points(count: int = 500, reach: float = 2.5, seed: int = 2) -> F32:
    return np.random.default_rng(seed).uniform(-reach, reach, (3, count)).astype(np.float32)


def look_up(
    pixels: np.ndarray,
    at: F32,
    interpolation: str = "Linear",
    extension: str = "REPEAT",
    projection: str = "FLAT",
    *,
    srgb: bool = False,
    alpha: int = PREMULTIPLIED,
    flags: int = 0,
    one_by_one: bool = False,
) -> F32:
    params = [0, INTERPOLATIONS[interpolation], EXTENSIONS[extension], PROJECTIONS[projection], flags]
    return run("IMAGE", at, params, images=[(pixels, srgb, alpha)], one_by_one=one_by_one)


def wrap(index: NDArray[np.int64], size: int, extension: str) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    inside = (index >= 0) & (index < size) if extension == "CLIP" else np.ones(index.shape, bool)
    if extension == "REPEAT":
        return index % size, inside
    if extension == "MIRROR":
        folded = index % (2 * size)
        return np.where(folded < size, folded, 2 * size - 1 - folded), inside
    return np.clip(index, 0, size - 1), inside


def weights(t: F64, interpolation: str) -> F64:
    if interpolation == "Closest":
        return np.ones((1, t.size))
    if interpolation == "Linear":
        return np.stack([1 - t, t])
    return np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 3 * (1 - t) ** 3 - 6 * (1 - t) ** 2 + 4, t**3]) / 6


def reference(pixels: F32, at: F32, interpolation: str, extension: str) -> F64:
    """Sum over the neighbourhood, texel by texel, in double."""
    shift, first = {"Closest": (0.0, 0), "Linear": (0.5, 0), "Cubic": (0.5, -1)}[interpolation]
    x = at[0].astype(np.float64) * WIDTH - shift
    y = at[1].astype(np.float64) * HEIGHT - shift
    wx, wy = weights(x - np.floor(x), interpolation), weights(y - np.floor(y), interpolation)
    total = np.zeros((4, at.shape[1]))
    for j in range(len(wy)):
        for i in range(len(wx)):
            column, in_x = wrap(np.floor(x).astype(np.int64) + first + i, WIDTH, extension)
            row, in_y = wrap(np.floor(y).astype(np.int64) + first + j, HEIGHT, extension)
            total += np.where(in_x & in_y, wx[i] * wy[j] * pixels[row, column].T, 0.0)
    return total


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("interpolation", ["Linear", "Closest", "Cubic"])
def test_float_image_agrees_with_numpy(interpolation: str, extension: str) -> None:
    pixels, at = picture(), points()
    ours = look_up(pixels, at, interpolation, extension)
    np.testing.assert_allclose(ours, reference(pixels, at, interpolation, extension), atol=2e-5)
    np.testing.assert_array_equal(ours, look_up(pixels, at, interpolation, extension, one_by_one=True))


@pytest.mark.parametrize("dtype", [np.uint8, np.float16])
def test_small_formats_hold_the_same_picture(dtype: type) -> None:
    pixels = picture()
    small = (pixels * 255).round().astype(np.uint8) if dtype is np.uint8 else pixels.astype(np.float16)
    exact = small.astype(np.float32) / (255 if dtype is np.uint8 else 1)
    np.testing.assert_allclose(look_up(small, points()), look_up(exact, points()), atol=1e-6)


def test_every_half_float_is_read_exactly() -> None:
    values = np.arange(65536, dtype=np.uint16).view(np.float16)
    values = values[np.isfinite(values)]
    pixels = np.ascontiguousarray(values.reshape(-1, 2, 1)[:, :1])
    at = np.zeros((3, len(pixels)), np.float32)
    at[0], at[1] = 0.5, (np.arange(len(pixels)) + 0.5) / len(pixels)
    np.testing.assert_array_equal(look_up(pixels, at, "Closest")[0], pixels[:, 0, 0].astype(np.float32))


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_missing_channels_are_grey_and_opaque(channels: int) -> None:
    pixels = picture(channels)
    full = np.ones((HEIGHT, WIDTH, 4), np.float32)
    full[..., :3] = pixels[..., :3] if channels >= 3 else pixels[..., :1]
    if channels in (2, 4):
        full[..., 3] = pixels[..., -1]
    np.testing.assert_array_equal(look_up(pixels, points()), look_up(full, points()))


def test_bytes_are_blended_before_they_are_decoded() -> None:
    pixels = np.array([[[0, 0, 0, 255], [255, 255, 255, 255]]], np.uint8)
    middle = np.array([[0.5], [0.5], [0.0]], np.float32)
    out = look_up(pixels, middle, extension="EXTEND", srgb=True, alpha=STRAIGHT)
    np.testing.assert_allclose(out[:3, 0], ((0.5 + 0.055) / 1.055) ** 2.4, rtol=1e-5)


def test_all_bytes_decode_as_srgb() -> None:
    pixels = np.repeat(np.arange(256, dtype=np.uint8).reshape(1, 256, 1), 3, axis=2)
    at = np.zeros((3, 256), np.float32)
    at[0], at[1] = (np.arange(256) + 0.5) / 256, 0.5
    c = np.arange(256) / 255
    expected = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(look_up(pixels, at, "Closest", srgb=True)[0], expected, rtol=2e-5)


def test_transparent_neighbours_do_not_bleed() -> None:
    pixels = np.array([[[200, 100, 50, 255], [0, 255, 0, 0]]], np.uint8)  # opaque brown beside transparent green
    middle = np.array([[0.5], [0.5], [0.0]], np.float32)
    out = look_up(pixels, middle, extension="EXTEND", srgb=True, alpha=STRAIGHT, flags=UNASSOCIATE)
    alone = look_up(pixels[:, :1].copy(), middle, srgb=True, alpha=STRAIGHT)
    np.testing.assert_allclose(out[:3], alone[:3], rtol=1e-4)
    assert out[3, 0] == 0.5


def test_channel_packed_colour_ignores_alpha() -> None:
    pixels = np.array([[[200, 100, 50, 0]]], np.uint8)
    out = look_up(pixels, points(4), srgb=True, alpha=CHANNEL_PACKED, flags=UNASSOCIATE)
    opaque = look_up(pixels[..., :3].copy(), points(4), srgb=True)
    np.testing.assert_array_equal(out[:3], opaque[:3])
    assert np.all(out[3] == 0) and np.all(look_up(pixels, points(4), alpha=IGNORE)[3] == 1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30, -1e30])
def test_no_coordinate_reads_outside_the_image(bad: float) -> None:
    at = np.full((3, 20), bad, np.float32)
    for interpolation in ("Linear", "Closest", "Cubic"):
        for extension in EXTENSIONS:
            for projection in PROJECTIONS:
                assert np.isfinite(look_up(picture(), at, interpolation, extension, projection)).all()
    normal = np.full((6, 20), bad, np.float32)
    images = [(picture(), False, PREMULTIPLIED)]
    assert np.isfinite(run("IMAGE_BOX", normal, [0, 0, 0, 0, 0], images=images)).all()
    for ball in (0, 1):
        assert np.isfinite(run("ENVIRONMENT", at, [0, 0, ball], images=images)).all()


def test_udim_finds_the_tile_and_shows_magenta_outside() -> None:
    first, second = np.full((1, 1, 3), 0.25, np.float32), np.full((1, 1, 3), 0.75, np.float32)
    at = np.array([[0.5, 1.5, 0.5, -1.5], [0.5, 0.5, 1.5, 0.5], [0, 0, 0, 0]], np.float32)
    params = [2, 0, 0, 0, TILED, 1001, 0, 1002, 1]
    out = run("IMAGE", at, params, images=[(first, False, 1), (second, False, 1)])
    np.testing.assert_array_equal(out.T, [[0.25] * 3 + [1], [0.75] * 3 + [1], [1, 0, 1, 1], [1, 0, 1, 1]])


def test_environment_has_its_centre_straight_ahead() -> None:
    pixels = np.zeros((2, 4, 3), np.float32)
    pixels[..., 0] = np.arange(4)
    pixels[..., 1] = np.arange(2)[:, None]
    up = [0.3, 0.3, -0.9]
    directions = np.array([[1, 0.2, 0.1], [-0.2, 1, 0.1], up], np.float32).T.copy()
    out = run("ENVIRONMENT", directions, [0, 1, 0], images=[(pixels, False, PREMULTIPLIED)])
    np.testing.assert_array_equal(out[:2].T, [[1, 1], [0, 1], [1, 0]])


def test_box_projection_weights_sum_to_one() -> None:
    normals = np.random.default_rng(5).normal(size=(3, 2000)).astype(np.float32)
    white = [(np.ones((1, 1, 4), np.float32), False, PREMULTIPLIED)]
    for blend in (0.0, 0.2, 0.7, 1.0):
        params = [0, 0, 0, int(np.float32(blend).view(np.uint32)), 0]
        out = run("IMAGE_BOX", np.concatenate([points(2000), normals]), params, images=white)
        np.testing.assert_allclose(out, 1.0, atol=1e-5)
