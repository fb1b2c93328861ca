"""Images arrive with the pixels, colour space and alpha that Blender shows."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import OpenImageIO as oiio
import pytest
from luch.scene import Image, Scene

from addon.export.context import ExportContext

RED, GREEN = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)


@pytest.fixture
def context(scene: bpy.types.Scene) -> ExportContext:
    return ExportContext(bpy.context.evaluated_depsgraph_get(), Scene())


def save(path: Path, bottom: tuple[float, ...], top: tuple[float, ...]) -> Path:
    """A picture of 2x2 pixels with two rows of one colour each."""
    image = bpy.data.images.new(path.stem, 2, 2, alpha=True)
    image.pixels.foreach_set(np.array([bottom, bottom, top, top], dtype=np.float32).ravel())
    image.file_format = "PNG"
    image.filepath_raw = str(path)
    image.save()
    bpy.data.images.remove(image)
    return path


def export(context: ExportContext, image: bpy.types.Image | None, user: object = None, tile: int = 0) -> Image:
    return context.result.images[context.image_index(image, user, tile=tile)]


def test_a_byte_image_keeps_its_bytes_bottom_row_first(context: ExportContext, tmp_path: Path) -> None:
    image = bpy.data.images.load(str(save(tmp_path / "flag.png", RED, (0.0, 0.2, 1.0, 0.4))))
    result = export(context, image)
    assert (result.pixels.dtype, result.colorspace, result.alpha) == (np.uint8, "SRGB", "STRAIGHT")
    assert result.pixels[:, 0].tolist() == [[255, 0, 0, 255], [0, 51, 255, 102]]


def test_a_packed_image_needs_no_file(context: ExportContext, tmp_path: Path) -> None:
    path = save(tmp_path / "flag.png", RED, GREEN)
    image = bpy.data.images.load(str(path))
    image.pack()
    path.unlink()
    assert export(context, image).pixels[0, 0].tolist() == [255, 0, 0, 255]


def test_a_painted_image_shows_the_paint(context: ExportContext, tmp_path: Path) -> None:
    image = bpy.data.images.load(str(save(tmp_path / "flag.png", RED, RED)))
    image.pixels.foreach_set(np.array([GREEN] * 4, dtype=np.float32).ravel())
    assert image.is_dirty
    assert export(context, image).pixels[0, 0].tolist() == [0, 255, 0, 255]


def test_data_is_not_decoded(context: ExportContext, tmp_path: Path) -> None:
    image = bpy.data.images.load(str(save(tmp_path / "normals.png", RED, RED)))
    image.colorspace_settings.name = "Non-Color"
    assert export(context, image).colorspace == "LINEAR"


def test_a_wide_gamut_image_becomes_scene_linear(context: ExportContext, tmp_path: Path) -> None:
    image = bpy.data.images.load(str(save(tmp_path / "wide.png", (0.5, 0.5, 0.5, 1.0), RED)))
    image.colorspace_settings.name = "Linear Rec.2020"
    result = export(context, image)
    assert (result.pixels.dtype, result.colorspace) == (np.float32, "LINEAR")
    assert result.pixels[0, 0] == pytest.approx([0.502, 0.502, 0.502, 1.0], abs=2e-3)
    assert result.pixels[1, 0, 1] < 0.0, "pure Rec.2020 red lies outside Rec.709"
    assert not context.result.warnings


def test_a_float_image_is_linear_and_premultiplied(context: ExportContext, tmp_path: Path) -> None:
    path = tmp_path / "bright.exr"
    out = oiio.ImageOutput.create(str(path))
    out.open(str(path), oiio.ImageSpec(1, 2, 4, "half"))
    out.write_image(np.array([[[1000.0, 0.0, 0.0, 1.0]], [[7.5, 0.25, 0.0, 0.5]]], dtype=np.float32))
    out.close()
    result = export(context, bpy.data.images.load(str(path)))
    assert (result.colorspace, result.alpha) == ("LINEAR", "PREMULTIPLIED")
    assert result.pixels.dtype == np.float16, "exact in half floats"
    assert result.pixels[:, 0].tolist() == [[7.5, 0.25, 0.0, 0.5], [1000.0, 0.0, 0.0, 1.0]]


def test_a_generated_image_has_its_pixels(context: ExportContext) -> None:
    image = bpy.data.images.new("Blank", 4, 4)
    image.generated_color = GREEN
    assert export(context, image).pixels[0, 0].tolist() == [0, 255, 0, 255]


@pytest.mark.promise(13)
@pytest.mark.parametrize("contents", [None, b"", b"not a picture", b"\x89PNG\r\n\x1a\n\0\0\0"])
def test_a_missing_or_corrupt_image_is_magenta_and_named_once(
    context: ExportContext, tmp_path: Path, contents: bytes | None
) -> None:
    path = save(tmp_path / "lost.png", RED, RED)
    image = bpy.data.images.load(str(path))
    path.unlink()
    if contents is not None:
        path.write_bytes(contents)
    for _ in range(2):
        assert export(context, image).pixels.tolist() == [[[1.0, 0.0, 1.0, 1.0]]]
    (warning,) = context.result.warnings
    assert 'Image "lost.png"' in warning


def test_no_image_is_magenta_as_in_blender(context: ExportContext) -> None:
    assert export(context, None).pixels.tolist() == [[[1.0, 0.0, 1.0, 1.0]]]


def test_the_same_image_is_stored_once(context: ExportContext) -> None:
    image = bpy.data.images.new("Blank", 4, 4)
    assert context.image_index(image) == context.image_index(image)
    assert len(context.result.images) == 1


def test_tiles_are_images_of_their_own(context: ExportContext, tmp_path: Path) -> None:
    save(tmp_path / "body.1001.png", RED, RED)
    save(tmp_path / "body.1012.png", GREEN, GREEN)
    image = bpy.data.images.load(str(tmp_path / "body.1001.png"))
    image.source = "TILED"
    image.filepath = str(tmp_path / "body.<UDIM>.png")
    image.tiles.new(1012)
    assert export(context, image).pixels[0, 0].tolist() == [255, 0, 0, 255]
    assert export(context, image, tile=1012).pixels[0, 0].tolist() == [0, 255, 0, 255]


def test_a_sequence_shows_the_file_of_the_frame(context: ExportContext, tmp_path: Path) -> None:
    for frame, color in ((1, RED), (2, GREEN)):
        save(tmp_path / f"clip{frame:03d}.png", color, color)
    image = bpy.data.images.load(str(tmp_path / "clip001.png"))
    image.source = "SEQUENCE"
    tree = bpy.data.materials.new("Clip").node_tree
    user = tree.nodes.new("ShaderNodeTexImage").image_user
    user.use_auto_refresh = True
    user.frame_start, user.frame_duration = 10, 2
    expected = {5: RED, 10: RED, 11: GREEN, 20: GREEN}
    for frame, color in expected.items():
        context.frame = frame
        assert export(context, image, user).pixels[0, 0].tolist() == [round(255 * value) for value in color]
    user.use_cyclic = True
    context.frame = 12
    assert export(context, image, user).pixels[0, 0].tolist() == [255, 0, 0, 255]
