"""Image and Environment Texture at the same coordinates: Cycles against our programs (support/textures.py)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray
from support.textures import Case, assert_same_pixels, cycles_of_cases, our_pixels

F32 = NDArray[np.float32]
WIDTH, HEIGHT = 9, 6


def picture(
    name: str, *, is_float: bool = False, data: bool = False, alpha_mode: str = "STRAIGHT", space: str = ""
) -> bpy.types.Image:
    """A packed picture of random texels, alpha between 0 and 1."""
    if name in bpy.data.images:
        return bpy.data.images[name]
    image = bpy.data.images.new(name, WIDTH, HEIGHT, alpha=True, float_buffer=is_float, is_data=data)
    pixels = np.random.default_rng(7).uniform(0, 1, (HEIGHT, WIDTH, 4)).astype(np.float32)
    if is_float:
        pixels[..., :3] *= 3.0 * pixels[..., 3:]  # float buffers hold their colours with alpha multiplied in
    if space:
        image.colorspace_settings.name = space
    image.pixels.foreach_set(pixels.ravel())
    image.alpha_mode = alpha_mode
    image.update()
    return image


def shows(name: str, **options: bool | str) -> Callable[[bpy.types.Node], None]:
    """Sets the node's image."""

    def setup(node: bpy.types.Node) -> None:
        node.image = picture(name, **options)

    return setup


def image_cases() -> list[Case]:
    kind = "ShaderNodeTexImage"
    cases = []
    for interpolation in ("Linear", "Closest", "Cubic", "Smart"):
        for extension in ("REPEAT", "EXTEND", "CLIP", "MIRROR"):
            settings = {
                "setup": shows("float", is_float=True, alpha_mode="PREMUL"),
                "interpolation": interpolation,
                "extension": extension,
            }
            cases.append(Case(f"{interpolation} {extension}", kind, "Color", settings, outliers=0.01))
    for projection in ("SPHERE", "TUBE", "BOX"):
        settings = {
            "setup": shows("float", is_float=True, alpha_mode="PREMUL"),
            "projection": projection,
            "projection_blend": 0.3,
        }
        cases.append(Case(f"projection {projection}", kind, "Color", settings, {}, outliers=0.01))
    # Cycles merges equal nodes, and a node whose alpha is used gives other colours: so two interpolations.
    for output, interpolation in (("Color", "Linear"), ("Alpha", "Cubic")):
        for mode in ("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"):
            settings = {"setup": shows(f"byte {mode}", alpha_mode=mode), "interpolation": interpolation}
            # Cycles multiplies alpha into bytes and rounds.
            cases.append(Case(f"bytes {mode} {output}", kind, output, settings, tolerance=6e-3, outliers=0.002))
        for space in ("Linear Rec.709", "Linear Rec.2020"):
            settings = {"setup": shows(space, space=space), "interpolation": interpolation}
            cases.append(Case(f"bytes {space} {output}", kind, output, settings, tolerance=1e-2, outliers=0.002))
        for mode in ("STRAIGHT", "PREMUL"):
            settings = {"setup": shows(f"float {mode}", is_float=True, alpha_mode=mode), "interpolation": interpolation}
            cases.append(Case(f"floats {mode} {output}", kind, output, settings, outliers=0.002))
        settings = {"setup": shows("data", data=True)}
        cases.append(Case(f"data {output}", kind, output, settings, tolerance=2e-3))
    cases.append(Case("no image", kind, "Color"))
    return cases


def environment_cases() -> list[Case]:
    cases = []
    for projection in ("EQUIRECTANGULAR", "MIRROR_BALL"):
        for interpolation in ("Linear", "Closest", "Cubic"):
            settings = {
                "setup": shows("float", is_float=True, alpha_mode="PREMUL"),
                "projection": projection,
                "interpolation": interpolation,
            }
            for source in ("up", "point"):
                name = f"environment {projection} {interpolation} {source}"
                cases.append(Case(name, "ShaderNodeTexEnvironment", "Color", settings, {}, source, outliers=0.01))
    settings = {"setup": shows("byte STRAIGHT")}
    name = "environment bytes"
    cases.append(Case(name, "ShaderNodeTexEnvironment", "Color", settings, {}, "up", tolerance=6e-3, outliers=0.01))
    return cases


CASES = [*image_cases(), *environment_cases()]


@pytest.fixture(scope="module")
def cycles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, F32]:
    return cycles_of_cases(CASES, tmp_path_factory.mktemp("images"))


@pytest.mark.parametrize("number", range(len(CASES)), ids=lambda k: CASES[k].name)
def test_image_node_gives_what_cycles_gives(number: int, cycles: dict[str, F32]) -> None:
    case = CASES[number]
    ours = our_pixels(case, cycles["position"])
    assert_same_pixels(case, ours, cycles[f"case {number}"], cycles["position"])


def test_missing_image_is_named(cycles: dict[str, F32], tmp_path: Path) -> None:
    from support.textures import Context

    context = Context()
    image = bpy.data.images.new("Gone", 4, 4)
    image.source, image.filepath = "FILE", str(tmp_path / "gone.png")
    context.image_index(image)
    assert len(context.warnings) == 1 and "Gone" in context.warnings[0]
