"""Pictures written and read: exact values, Blender's channel names, straight alpha, the right way up."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from luch import image

rng = np.random.default_rng(5)


def test_an_exr_keeps_every_bit_under_blenders_channel_names(tmp_path: Path) -> None:
    passes = {
        "Combined": rng.normal(size=(5, 7, 4)).astype(np.float32) * 1e10,
        "Depth": np.full((5, 7, 1), 1e10, np.float32),
        "Normal": rng.random((5, 7, 3), dtype=np.float32),
        "UV": rng.random((5, 7, 3), dtype=np.float32),
        "Diffuse Direct": rng.random((5, 7, 3), dtype=np.float32),
        "Object Index": rng.random((5, 7, 1), dtype=np.float32),
        "CryptoObject00": rng.integers(0, 2**31, (5, 7, 4), dtype=np.uint32).view(np.float32),
        "Combined_key light": rng.random((5, 7, 3), dtype=np.float32),
    }
    path = tmp_path / "out.exr"
    image.write_exr(path, passes, metadata={"luch.samples": 64, "cryptomatte/1234567/name": "ViewLayer.CryptoObject"})
    groups, metadata = image.read_exr(path)
    assert set(groups) == {f"ViewLayer.{name}" for name in passes}
    for name, pixels in passes.items():
        assert groups[f"ViewLayer.{name}"].tobytes() == pixels.tobytes(), name
    assert metadata["luch.samples"] == 64
    assert metadata["cryptomatte/1234567/name"] == "ViewLayer.CryptoObject"


def test_channels_are_named_as_blender_names_them() -> None:
    expected = {
        ("Combined", 4): "RGBA",
        ("Depth", 1): "Z",
        ("Mist", 1): "Z",
        ("Position", 3): "XYZ",
        ("Denoising Normal", 3): "XYZ",
        ("UV", 3): "UVA",
        ("Material Index", 1): "X",
        ("Emission", 3): "RGB",
        ("CryptoAsset01", 4): "rgba",
    }
    assert {key: image.channel_letters(*key) for key in expected} == expected


def test_a_png_is_srgb_with_straight_alpha_and_the_right_way_up(tmp_path: Path) -> None:
    picture = np.zeros((2, 3, 4), np.float32)
    picture[0, 0] = (0.5, 0.25, 0.0, 0.5)  # bottom left: half covered by (1, .5, 0)
    picture[1, 2] = (7.0, 0.002, np.nan, 1.0)
    path = tmp_path / "out.png"
    image.write_png(path, picture)
    back = image.read_image(path)
    assert (back.colorspace, back.alpha, back.pixels.dtype) == ("SRGB", "STRAIGHT", np.uint8)
    assert back.pixels[0, 0].tolist() == [255, 188, 0, 128]
    assert back.pixels[1, 2].tolist() == [255, 7, 0, 255]
    assert back.pixels[0, 1].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 16384, 4), (16384, 1, 1)])
def test_any_size_is_written_and_read(shape: tuple[int, int, int], tmp_path: Path) -> None:
    picture = rng.random(shape, dtype=np.float32)
    image.write_exr(tmp_path / "a.exr", {"Combined": picture})
    assert image.read_exr(tmp_path / "a.exr")[0]["ViewLayer.Combined"].tobytes() == picture.tobytes()
    image.write_png(tmp_path / "a.png", picture)
    assert image.read_image(tmp_path / "a.png").pixels.shape == shape


def test_float_textures_stay_linear_and_premultiplied(tmp_path: Path) -> None:
    picture = rng.random((3, 2, 4), dtype=np.float32)
    image.write_exr(tmp_path / "a.exr", {"Combined": picture})
    back = image.read_image(tmp_path / "a.exr")
    assert back.colorspace == "LINEAR" and back.pixels.dtype == np.float32


def test_what_cannot_be_read_or_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n but no more")
    (tmp_path / "cut.exr").write_bytes(b"\x76\x2f\x31\x01\x02\x00\x00\x00")
    for name in ("bad.png", "cut.exr", "none.png"):
        with pytest.raises(image.ImageError, match=f"{name}: .*Check the file"):
            image.read_image(tmp_path / name)
    with pytest.raises(image.ImageError, match=r"none/out\.exr: cannot be written"):
        image.write_exr(tmp_path / "none" / "out.exr", {"Combined": np.zeros((2, 2, 4), np.float32)})
    with pytest.raises(ValueError, match='pass "Depth" has shape'):
        image.write_exr(
            tmp_path / "a.exr", {"Combined": np.zeros((2, 2, 4), np.float32), "Depth": np.zeros((2, 2), np.float32)}
        )


def test_a_picture_cut_in_the_middle_is_an_error_not_a_black_texture(tmp_path: Path) -> None:
    image.write_exr(tmp_path / "a.exr", {"Combined": rng.random((64, 64, 4), dtype=np.float32)})
    whole = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(image.ImageError):
        image.read_image(tmp_path / "a.exr")


def test_openimageio_is_found_inside_bpy_when_it_is_not_installed() -> None:
    script = (
        "import sys\n"
        "class Hidden:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'OpenImageIO' and not any('/python/lib/' in p for p in sys.path):\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, Hidden())\n"
        "from luch import image\n"
        "print(image.openimageio().__file__)\n"
    )
    environment = {"PYTHONPATH": str(Path(image.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().endswith("__init__.py")
