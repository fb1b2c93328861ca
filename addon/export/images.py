"""Images: pixels as Blender has them, in the fewest bytes that keep them exact."""

from __future__ import annotations

import os
import re
from typing import Any

import bpy
import imbuf
import numpy as np
from luch.scene import F32, Image
from numpy.typing import NDArray

from .colorspace import to_scene_linear
from .context import ExportContext

MARKER = (1.0, 0.0, 1.0, 1.0)  # magenta: Blender's sign of a missing image
SRGB = "sRGB"
ALPHA_MODES = {
    "STRAIGHT": "STRAIGHT",
    "PREMUL": "PREMULTIPLIED",
    "CHANNEL_PACKED": "CHANNEL_PACKED",
    "NONE": "NONE",
}
LINEAR = frozenset({"Linear Rec.709", "Raw", "Non-Color"})


def image_key(image: Any, user: Any, tile: int, frame: int) -> tuple[Any, ...]:
    """What makes two uses of an image show the same pixels."""
    if image is None:
        return (0,)
    shown = _frame_of(user, frame) if image.source in ("SEQUENCE", "MOVIE") else 0
    return (image.original.session_uid, tile, shown)


def export_image(image: Any, user: Any, tile: int, context: ExportContext) -> Image:
    """Pixels of a Blender image; a magenta marker and a warning if it has none."""
    if image is None:
        return marker("No image")
    image = image.original
    if image.source == "MOVIE":
        context.warn(f'Image "{image.name}" is a movie; Luch shows its current frame. Convert it to an image sequence.')
    pixels = _from_file(image, _frame_of(user, context.frame), tile)
    if pixels is None:
        pixels = _from_blender(image)
    if pixels is None:
        context.warn(
            f'Image "{image.name}": file "{image.filepath}" is missing or cannot be read, so it is drawn magenta.'
            " Find it with File > External Data > Find Missing Files."
        )
        return marker(image.name)
    return _bytes(image, pixels, context) if pixels.dtype == np.uint8 else _floats(image, pixels)


def marker(name: str) -> Image:
    """One magenta pixel."""
    return Image(name=name, pixels=np.array(MARKER, dtype=np.float32).reshape(1, 1, 4))


def _from_file(image: Any, frame: int, tile: int) -> NDArray[Any] | None:
    """(H, W, 4) straight from the file or the packed bytes; None where Blender's own copy must be asked.

    This spares Blender's detour through floats, which takes three times as long. Floats of a plain file do take it:
    Blender converts their colour space.
    """
    moving = image.source in ("SEQUENCE", "TILED")
    if (
        image.is_dirty
        or image.source not in ("FILE", "SEQUENCE", "TILED")
        or not hasattr(imbuf.types.ImBuf, "with_buffer")
    ):
        return None
    try:
        packed = _packed_bytes(image, tile)
        buffer = imbuf.load_from_buffer(packed) if packed is not None else imbuf.load(_path(image, frame, tile))
    except (OSError, ValueError, RuntimeError):
        return None
    if buffer is None or (buffer.buffer_type != "BYTE" and not moving):
        return None
    access: Any = buffer.with_buffer()
    with access as view:
        pixels = np.array(view)
    buffer.free()
    return _four_channels(pixels)


def _packed_bytes(image: Any, tile: int) -> bytes | None:
    if image.source == "TILED":
        number = str(tile or image.tiles[0].number)
        found = [packed for packed in image.packed_files if number in os.path.basename(packed.filepath)]
        return bytes(found[0].packed_file.data) if found else None
    return bytes(image.packed_file.data) if image.packed_file else None


def _path(image: Any, frame: int, tile: int) -> str:
    """Absolute path of the file that holds a frame or tile."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "TILED":
        number = tile or image.tiles[0].number
        column, row = (number - 1001) % 10, (number - 1001) // 10
        return path.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
    if image.source == "SEQUENCE":
        folder, name = os.path.split(path)
        digits = re.search(r"(\d+)(\D*)$", name)
        if digits:
            name = f"{name[: digits.start()]}{frame:0{len(digits[1])}d}{digits[2]}"
        return os.path.join(folder, name)
    return path


def read_path(image: Any, user: Any, tile: int, frame: int) -> str:
    """Absolute path of the file that an image shows at a frame of the scene."""
    return _path(image, _frame_of(user, frame), tile)


def _frame_of(user: Any, frame: int) -> int:
    """The file number that an image sequence shows at a frame of the scene."""
    if user is None:
        return frame
    if not user.use_auto_refresh:
        return int(user.frame_current)
    count = max(1, user.frame_duration)
    position = frame - user.frame_start + 1
    position = (position - 1) % count + 1 if user.use_cyclic else min(max(position, 1), count)
    return int(position + user.frame_offset)


def _from_blender(image: Any) -> NDArray[Any] | None:
    """(H, W, 4) through Blender's copy of the pixels: uint8 as stored, or float32 scene-linear. None: no pixels."""
    had_data = image.has_data
    count = len(image.pixels)  # loads the file
    width, height = image.size
    if count == 0 or width == 0 or height == 0 or not image.has_data:
        return None
    pixels = np.empty(count, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    if not had_data and not image.is_dirty:
        image.buffers_free()
    pixels = _four_channels(pixels.reshape(height, width, -1))
    if image.is_float:
        return pixels
    pixels *= 255.0
    pixels += 0.5
    return pixels.astype(np.uint8)


def _four_channels(pixels: NDArray[Any]) -> NDArray[Any]:
    channels = pixels.shape[2]
    if channels == 4:
        return pixels
    result = np.empty((*pixels.shape[:2], 4), dtype=pixels.dtype)
    result[..., :3] = pixels[..., :3] if channels == 3 else pixels[..., :1]
    result[..., 3] = pixels[..., 1] if channels == 2 else (255 if pixels.dtype == np.uint8 else 1.0)
    return result


def _bytes(image: Any, pixels: NDArray[np.uint8], context: ExportContext) -> Image:
    """8-bit pixels stay 8-bit where a shader can decode them: sRGB, linear, data."""
    settings = image.colorspace_settings
    alpha = ALPHA_MODES[image.alpha_mode]
    if settings.name == SRGB:
        return Image(image.name, pixels, "SRGB", alpha)
    opaque = alpha != "STRAIGHT" or bool((pixels[..., 3] == 255).all())
    if settings.is_data or (settings.name in LINEAR and opaque):
        return Image(image.name, pixels, "LINEAR", alpha)
    linear = to_scene_linear(pixels, settings.name)
    if linear is None:
        context.warn(f'Image "{image.name}": colour space "{settings.name}" cannot be converted and is read as sRGB.')
        return Image(image.name, pixels, "SRGB", alpha)
    return _associated(Image(image.name, linear, "LINEAR", alpha))


def _associated(image: Image) -> Image:
    """Scene-linear floats with a straight alpha multiplied in, as shaders expect of colours."""
    if image.alpha == "STRAIGHT":
        image.pixels[..., :3] *= image.pixels[..., 3:]
        image.alpha = "PREMULTIPLIED"
    return image


def _floats(image: Any, pixels: F32) -> Image:
    """Blender's float buffers are scene-linear; of files the alpha is multiplied in. Half floats where those are exact."""
    result = Image(image.name, pixels, "LINEAR", ALPHA_MODES[image.alpha_mode])
    if image.source == "GENERATED":
        _associated(result)
    elif result.alpha == "STRAIGHT":
        result.alpha = "PREMULTIPLIED"
    with np.errstate(over="ignore", invalid="ignore"):
        half = result.pixels.astype(np.float16)
        exact = np.array_equal(half, result.pixels)
    if exact:
        result.pixels = half
    return result
