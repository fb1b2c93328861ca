"""Images: pixels as Blender has them, in the fewest bytes that keep them exact."""

from __future__ import annotations

from typing import Any

import numpy as np
from luch.scene import Image

from .context import ExportContext

MARKER = (1.0, 0.0, 1.0, 1.0)  # magenta: Blender's sign of a missing image
RAW = frozenset({"Non-Color", "Raw", "Linear Rec.709"})


def image_key(image: Any, user: Any, tile: int, frame: int) -> tuple[Any, ...]:
    """What makes two uses of an image show the same pixels."""
    if image is None:
        return (0,)
    moving = image.source in ("SEQUENCE", "MOVIE")
    return (image.original.session_uid, tile, frame if moving else None, id(user) if moving else None)


def export_image(image: Any, user: Any, tile: int, context: ExportContext) -> Image:
    """Pixels of a Blender image; a magenta marker and a warning if it has none."""
    if image is None:
        return marker("No image")
    image = image.original
    had_data = image.has_data
    width, height = image.size
    if width == 0 or height == 0 or not image.has_data:
        context.warn(
            f'Image "{image.name}": file "{image.filepath}" is missing or cannot be read; it is drawn magenta.'
            " Find it with File > External Data > Find Missing Files."
        )
        return marker(image.name)
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)
    if not had_data and not image.is_dirty:
        image.buffers_free()
    return _float_image(image, pixels) if image.is_float else _byte_image(image, pixels, context)


def marker(name: str) -> Image:
    """One magenta pixel."""
    return Image(name=name, pixels=np.array(MARKER, dtype=np.float32).reshape(1, 1, 4))


def _byte_image(image: Any, pixels: Any, context: ExportContext) -> Image:
    bytes_ = np.rint(pixels * 255.0).astype(np.uint8)
    space = image.colorspace_settings.name
    if space != "sRGB" and space not in RAW:
        context.warn(f'Image "{image.name}": colour space "{space}" is not supported yet and read as sRGB.')
    alpha = {"CHANNEL_PACKED": "CHANNEL_PACKED", "NONE": "NONE"}.get(image.alpha_mode, "STRAIGHT")
    return Image(image.name, bytes_, "LINEAR" if space in RAW else "SRGB", alpha)


def _float_image(image: Any, pixels: Any) -> Image:
    """Blender's float buffers are scene-linear with the alpha multiplied in."""
    alpha = {"CHANNEL_PACKED": "CHANNEL_PACKED", "NONE": "NONE"}.get(image.alpha_mode, "PREMULTIPLIED")
    return Image(image.name, pixels, "LINEAR", alpha)
