"""Comparing pictures: error measures, and PNGs of picture, reference and difference when a test fails."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

F32 = NDArray[np.float32]
ARTIFACTS = Path(__file__).resolve().parents[2] / "out" / "test-artifacts"


def read_passes(path: Path) -> dict[str, F32]:
    """Every layer of a Blender EXR (multi-part or interleaved): pass name -> float32 (height, width, channels).

    Top row first, as the file has it. "ViewLayer.Combined.R" becomes channel 0 of "Combined".
    """
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise OSError(f"{path}: {oiio.geterror()}")
    layers: dict[str, dict[str, F32]] = {}
    part = 0
    while source.seek_subimage(part, 0):
        spec = source.spec()
        pixels = np.asarray(source.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT), dtype=np.float32)
        pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)
        part_name = spec.get_string_attribute("name", "")
        for index, channel in enumerate(spec.channelnames):
            # The layer's name may be in the channel ("ViewLayer.Depth.Z"), in the part's name, or in both.
            pieces = channel.split(".") if "." in channel else [*part_name.split("."), channel]
            name = ".".join(pieces[1:-1]) if len(pieces) > 2 else (pieces[0] if len(pieces) == 2 else "Combined")
            layers.setdefault(name, {})[pieces[-1]] = pixels[:, :, index]
        part += 1
    source.close()
    order = "RGBAXYZUVW"
    return {
        name: np.stack([channels[key] for key in sorted(channels, key=lambda k: order.find(k[0]))], axis=2)
        for name, channels in layers.items()
    }


def rel_mse(picture: F32, reference: F32) -> float:
    """mean((picture - reference)^2 / (reference + 0.01)^2) over the first three channels, in double."""
    a = picture[..., :3].astype(np.float64)
    r = reference[..., :3].astype(np.float64)
    return float(np.mean((a - r) ** 2 / (np.abs(r) + 0.01) ** 2))


def bias_rel_mse(half_a: F32, half_b: F32, reference: F32) -> float:
    """The relMSE left when independent noise is gone: the cross product of two halves' differences.

    Unbiased where the noise of the halves is independent; may come out slightly negative.
    """
    r = reference[..., :3].astype(np.float64)
    a = half_a[..., :3].astype(np.float64) - r
    b = half_b[..., :3].astype(np.float64) - r
    return float(np.mean(a * b / (np.abs(r) + 0.01) ** 2))


def energy_ratio(picture: F32, reference: F32) -> NDArray[np.float64]:
    """Mean of each of the three channels over the reference's mean."""
    means = reference[..., :3].mean(axis=(0, 1), dtype=np.float64)
    ratio = picture[..., :3].mean(axis=(0, 1), dtype=np.float64) / np.where(means == 0, 1, means)
    return np.asarray(ratio, dtype=np.float64)


def to_display(linear: F32) -> NDArray[np.uint8]:
    """Scene-linear to 8-bit sRGB, clipped; not finite pixels become magenta."""
    rgb = linear[..., :3] if linear.shape[-1] >= 3 else np.repeat(linear[..., :1], 3, axis=2)
    bad = ~np.isfinite(rgb).all(axis=2)
    clipped = np.clip(np.nan_to_num(rgb), 0, 1)
    encoded = np.where(clipped <= 0.0031308, clipped * 12.92, 1.055 * clipped ** (1 / 2.4) - 0.055)
    encoded[bad] = (1, 0, 1)
    return np.asarray(np.rint(encoded * 255), dtype=np.uint8)


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """pixels: (height, width, 3) uint8, top row first. Makes the folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    height, width, channels = pixels.shape
    target = oiio.ImageOutput.create(str(path))
    if target is None or not target.open(str(path), oiio.ImageSpec(width, height, channels, oiio.UINT8)):
        raise OSError(f"{path}: {oiio.geterror()}")
    target.write_image(np.ascontiguousarray(pixels))
    target.close()


def side_by_side(picture: F32, reference: F32, gain: float = 10.0) -> NDArray[np.uint8]:
    """Picture | reference | gain x |difference|, with a thin grey bar between."""
    height = picture.shape[0]
    bar = np.full((height, 4, 3), 128, dtype=np.uint8)
    difference = np.abs(picture[..., :3] - reference[..., :3]) * gain
    return np.concatenate([to_display(picture), bar, to_display(reference), bar, to_display(difference)], axis=1)


def assert_pictures_agree(
    name: str, picture: F32, reference: F32, *, tolerance: float, measure: float | None = None
) -> None:
    """Fails, leaving out/test-artifacts/NAME.png, unless relMSE (or the given measure) is below tolerance."""
    assert picture.shape[:2] == reference.shape[:2], f"{name}: {picture.shape} against {reference.shape}"
    error = rel_mse(picture, reference) if measure is None else measure
    if error <= tolerance and np.isfinite(picture).all():
        return
    path = ARTIFACTS / f"{name}.png"
    write_png(path, side_by_side(picture, reference))
    energy = ", ".join(f"{value:.4f}" for value in energy_ratio(picture, reference))
    raise AssertionError(
        f"{name}: error {error:.3e} > {tolerance:.1e}; energy {energy}; picture | reference | 10x difference in {path}"
    )
