"""Image files: the only place that knows OpenImageIO.

Pictures are float32 (H, W, C), bottom row first, scene-linear, colour multiplied by alpha, as renders are.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from luch.scene import F32, Image

# Channel letters of passes whose number of channels does not tell them, as Blender writes them.
_LETTERS = {
    "Depth": "Z",
    "Mist": "Z",
    "Denoising Depth": "Z",
    "Position": "XYZ",
    "Normal": "XYZ",
    "Denoising Normal": "XYZ",
    "UV": "UVA",
}
# A file stores channels by name; this is the order in which a pass has them.
_ORDER = "XYZWUVRGBArgba"
_LETTERS_BY_COUNT = {1: "X", 2: "XY", 3: "RGB", 4: "RGBA"}


class ImageError(OSError):
    """A picture that cannot be read or written. The message names the file, the fact and the remedy."""


def openimageio() -> ModuleType:
    """OpenImageIO: installed, or the copy inside the ``bpy`` package. Raises ImportError with the remedy."""
    try:
        return importlib.import_module("OpenImageIO")
    except ImportError:
        folder = _bundled_folder()
        if folder is None:
            raise ImportError("OpenImageIO is missing; run `python3 -m pip install OpenImageIO`") from None
        sys.path.append(str(folder))
        return importlib.import_module("OpenImageIO")


def _bundled_folder() -> Path | None:
    """Where the bpy package keeps its Python packages; None without bpy."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or not spec.submodule_search_locations:
        return None
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for location in spec.submodule_search_locations:
        for folder in Path(location).glob(f"*/python/lib/{version}/site-packages"):
            if (folder / "OpenImageIO").exists():
                return folder
    return None


def channel_letters(name: str, count: int) -> str:
    """Channel names of a pass, one letter each. Cryptomatte's are lower case, which keeps them exact everywhere."""
    if name.startswith("Crypto") and count == 4:
        return "rgba"
    letters = _LETTERS.get(name, "")
    return letters if len(letters) == count else _LETTERS_BY_COUNT[count]


def write_exr(
    path: str | os.PathLike[str],
    passes: Mapping[str, F32],
    *,
    layer: str = "ViewLayer",
    metadata: Mapping[str, str | int | float] | None = None,
) -> None:
    """Writes passes of one size as a multilayer EXR, lossless, with channels such as ``ViewLayer.Combined.R``.

    Raises ImageError if it cannot be written, ValueError if the sizes differ.
    """
    if not passes:
        raise ValueError("no passes to write")
    names, planes = [], []
    shape = next(iter(passes.values())).shape[:2]
    for name, pixels in passes.items():
        if pixels.ndim != 3 or pixels.shape[:2] != shape:
            raise ValueError(f'pass "{name}" has shape {pixels.shape}; expected {shape} and channels')
        names += [f"{layer}.{name}.{letter}" for letter in channel_letters(name, pixels.shape[2])]
        planes.append(np.asarray(pixels, dtype=np.float32))
    attributes: dict[str, str | int | float] = {"compression": "zip", "Software": "Luch", **(metadata or {})}
    _write(path, np.concatenate(planes, axis=2), names, attributes)


def write_png(
    path: str | os.PathLike[str], picture: F32, *, metadata: Mapping[str, str | int | float] | None = None
) -> None:
    """Writes a picture (H, W, 1, 3 or 4) through Blender's "Standard" view: sRGB, 8 bit, straight alpha.

    Raises ImageError if it cannot be written.
    """
    color = np.nan_to_num(np.asarray(picture, dtype=np.float32), nan=0.0, posinf=1e30, neginf=0.0)
    if color.shape[2] == 4:
        alpha = np.clip(color[..., 3:], 0.0, 1.0)
        straight = np.divide(color[..., :3], alpha, out=np.zeros_like(color[..., :3]), where=alpha > 0)
        encoded = np.concatenate([encode_srgb(straight), alpha], axis=2)
    else:
        encoded = encode_srgb(color)
    names = {1: ["Y"], 3: ["R", "G", "B"], 4: ["R", "G", "B", "A"]}[color.shape[2]]
    attributes: dict[str, str | int | float] = {
        "oiio:UnassociatedAlpha": 1,
        "oiio:ColorSpace": "sRGB",
        "Software": "Luch",
        **(metadata or {}),
    }
    _write(path, (encoded * 255.0 + 0.5).astype(np.uint8), names, attributes)


def encode_srgb(linear: F32) -> F32:
    """Scene-linear to sRGB, both 0..1; clips."""
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1.0 / 2.4) - 0.055).astype(np.float32)


def read_image(path: str | os.PathLike[str]) -> Image:
    """Reads a texture as it is stored: uint8, float16 or float32, straight or premultiplied alpha.

    Deeper integers become float32 in 0..1. 8 and 16 bit files count as sRGB, others as linear. Raises ImageError.
    """
    oiio = openimageio()
    name = os.fspath(path)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # straight alpha stays straight, as Blender has it
    file = oiio.ImageInput.open(name, config)
    if file is None:
        raise ImageError(f"{name}: cannot be read as an image ({_reason(oiio)}). Check the file.")
    try:
        spec = file.spec()
        stored = str(spec.format)
        kind = stored if stored in ("uint8", "half") else "float"
        pixels = file.read_image(0, 0, 0, min(spec.nchannels, 4), kind)
        if pixels is None:
            raise ImageError(f"{name}: its pixels are damaged ({file.geterror()}). Save the image again.")
    finally:
        file.close()
    alpha = "NONE"
    if 0 <= spec.alpha_channel < 4:
        straight = spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0
        alpha = "STRAIGHT" if straight else "PREMULTIPLIED"
    colorspace = "SRGB" if stored in ("uint8", "uint16") else "LINEAR"
    picture = np.ascontiguousarray(np.asarray(pixels).reshape(spec.height, spec.width, -1)[::-1])
    return Image(name=Path(name).name, pixels=picture, colorspace=colorspace, alpha=alpha)


def read_exr(path: str | os.PathLike[str]) -> tuple[dict[str, F32], dict[str, Any]]:
    """All channels of an EXR, of all its parts, grouped by what stands before their last dot: name ->
    float32 (H, W, C) bottom row first, channels in their pass's order; and the first part's metadata. Raises ImageError."""
    oiio = openimageio()
    name = os.fspath(path)
    file = oiio.ImageInput.open(name)
    if file is None:
        raise ImageError(f"{name}: cannot be read as an image ({_reason(oiio)}). Check the file.")
    groups: dict[str, dict[str, F32]] = {}
    metadata: dict[str, Any] = {}
    part = 0
    try:
        while file.seek_subimage(part, 0):
            spec = file.spec()
            if part == 0:
                metadata = {attribute.name: attribute.value for attribute in spec.extra_attribs}
            pixels = file.read_image(part, 0, 0, spec.nchannels, "float")
            if pixels is None:
                raise ImageError(f"{name}: its pixels are damaged ({file.geterror()}). Render it again.")
            planes = np.asarray(pixels, dtype=np.float32).reshape(spec.height, spec.width, -1)[::-1]
            for index, channel in enumerate(spec.channelnames):
                group, _, letter = channel.rpartition(".")
                groups.setdefault(group, {})[letter] = planes[..., index]
            part += 1
    finally:
        file.close()
    stacked = {
        group: np.stack([planes[letter] for letter in sorted(planes, key=_ORDER.find)], axis=2)
        for group, planes in groups.items()
    }
    return stacked, metadata


def _reason(oiio: ModuleType) -> str:
    """What OpenImageIO has to say about its last failure, in one line."""
    return " ".join(str(oiio.geterror()).split())


def _write(
    path: str | os.PathLike[str],
    pixels: NDArray[Any],
    names: list[str],
    attributes: Mapping[str, str | int | float],
) -> None:
    oiio = openimageio()
    name = os.fspath(path)
    file = oiio.ImageOutput.create(name)
    if file is None:
        raise ImageError(f"{name}: no such kind of image ({_reason(oiio)}). Use .exr or .png.")
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, str(pixels.dtype).replace("float32", "float"))
    spec.channelnames = tuple(names)
    for key, value in attributes.items():
        spec.attribute(key, value)
    if not file.open(name, spec):
        raise ImageError(f"{name}: cannot be written ({file.geterror()}). Check the folder and its permissions.")
    whole = file.write_image(np.ascontiguousarray(pixels[::-1]))
    if not file.close() or not whole:
        raise ImageError(f"{name}: writing stopped ({file.geterror()}). Is the disk full?")
