"""Lamps, worlds, textures and glass at their limits, through whole renders. Numbers: the rows of the hard cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from luch.render import render
from luch.scene import Camera, Image, Light, Material
from luch.shader import ProgramBuilder
from support.asked import every_device
from support.effects import program
from support.hard_geometry import quad
from support.hard_lights import glass_against_nothing, hot_texel, lit_floor, nested_dielectrics, sky_over_floor
from support.hard_scenes import at, diffuse, even_world, glow, looking, picture, scene_of


@every_device
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_42_glass_fades_in_with_its_index(roughness: float, device: str) -> None:
    """Multiscatter GGX, as Blender's nodes are set: single scattering loses what it does not model."""
    for ior in (0.999, 0.9999, 1.0, 1.00005, 1.0001, 1.001, 1.01):
        rms = glass_against_nothing(ior, roughness, samples=32, device=device)
        assert rms <= 20.0 * abs(ior - 1.0) + 1e-3, (ior, rms)
        if ior == 1.0001:
            assert rms <= 3e-3


@every_device
@pytest.mark.parametrize("kind", ["overlap", "gap", "coincident", "inside"])
def test_43_water_in_glass_keeps_all_light(kind: str, device: str) -> None:
    np.testing.assert_allclose(nested_dielectrics(kind, samples=8, device=device), 1.0, atol=1e-3)


@every_device
def test_45_and_46_suns_and_bulbs_of_any_size_light_alike(device: str) -> None:
    for angle in (0.0, math.pi):
        sun = Light("Sun", "SUN", power=10.0, angle=angle)
        assert picture(lit_floor([sun], device=device)).mean() == pytest.approx(1.5915, rel=1e-3)
    for radius in (0.0, *10.0 ** np.arange(-10.0, -2.0)):
        for soft in (True, False):
            bulb = Light("Bulb", "POINT", matrix=at((0, 0, 1)), power=100.0, radius=radius, soft_falloff=soft)
            assert picture(lit_floor([bulb], device=device)).mean() == pytest.approx(1.2665, rel=1e-3), radius


@every_device
def test_47_a_bulb_on_the_floor_is_finite_and_one_under_it_gives_nothing(device: str) -> None:
    for height, radius in ((0.0, 0.0), (0.0, 0.1), (1e-6, 0.0), (1e-6, 0.1), (-1e-6, 0.0), (-1e-3, 0.0), (-0.2, 0.1)):
        bulb = Light("Bulb", "POINT", matrix=at((0, 0, height)), power=100.0, radius=radius)
        pixels = picture(lit_floor([bulb], samples=64, device=device))
        assert pixels.max() > 0.0 if height > 0.0 else True
        if height < 0.0:
            assert pixels.max() == 0.0, (height, radius)


@every_device
def test_48_area_lamps_of_any_size_and_tilt(device: str) -> None:
    for size, normalize, power, truth in ((0.0, True, 100.0, 5.066), (1e-6, True, 100.0, 5.066),
                                          (1e6, False, math.pi, 0.5)):  # fmt: skip
        lamp = Light("Lamp", "AREA", matrix=at((0, 0, 1)), power=power, normalize=normalize, size=size)
        pixels = picture(lit_floor([lamp], samples=1024, device=device))
        assert pixels.mean() == pytest.approx(truth, rel=2e-3), size
    edge_on = np.array(
        [[0.0, 0.0, -1.0, 0.01], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0]]
    )  # shines to +x from x = 1 cm
    for matrix in (edge_on, at((0, 0, 0)), at((0, 0, 1), 0.0)):
        lamp = Light("Lamp", "AREA", matrix=matrix, power=100.0, size=1.0)
        assert picture(lit_floor([lamp], samples=64, device=device)).max() == 0.0


@every_device
@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN", "AREA"])
def test_49_lamps_of_any_power_give_finite_light(kind: str, device: str) -> None:
    for power in (1e30, np.inf, np.nan, -10.0, 3e38):
        lamp = Light("Lamp", kind, matrix=at((0, 0, 1)), power=power, radius=0.1, angle=0.1, size=0.3)
        picture(lit_floor([lamp], samples=16, device=device))
        other = Light("Bulb", "POINT", matrix=at((0, 0, 1)), power=100.0)
        both = picture(lit_floor([lamp, other], samples=64, device=device)).mean()
        if power in (np.inf, 3e38) or np.isnan(power):
            assert both == pytest.approx(1.2665, rel=0.01), "a broken lamp takes no light from the others"


@every_device
@pytest.mark.parametrize("value", [1e4, 1e7, 1e12])
def test_51_a_hot_texel_lights_as_its_tent(value: float, device: str) -> None:
    pixels, truth = hot_texel(value)
    lit = picture(sky_over_floor(pixels, samples=64, device=device))[..., 0].astype(np.float64)
    assert lit.mean() == pytest.approx(truth, rel=1e-3)
    assert lit.std() / lit.mean() <= 2e-3


@every_device
def test_52_broken_skies_light_by_the_rest_of_them(device: str) -> None:
    width, height = 64, 32
    for value in (np.nan, np.inf, -np.inf):
        pixels = np.full((height, width, 3), 0.5, np.float32)
        pixels[20, 30] = value
        lit = picture(sky_over_floor(pixels, samples=256, device=device)).mean()
        assert lit == pytest.approx(0.25, rel=0.01), value
    for shape in ((1, 1), (1, 2), (2, 1)):
        assert picture(sky_over_floor(np.full((*shape, 3), 0.5, np.float32), device=device)).mean() == pytest.approx(
            0.25, rel=0.01
        )
    for value in (0.0, -1.0):
        dark = picture(sky_over_floor(np.full((height, width, 3), value, np.float32), samples=4, device=device))
        assert dark.max() <= 0.0


@every_device
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -3.0])
def test_53_a_broken_texel_changes_no_other(value: float, device: str) -> None:
    """A glowing square of 8 by 8 texels, one of which is broken, without interpolation."""

    def shown(pixels: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        def build(b: ProgramBuilder) -> None:
            x, y, _ = b.op3("POINT_POSITION", (), (0, 0, 0))
            half = b.constant(0.5)
            where = (b.op1("MATH_ADD", (x, half)), b.op1("MATH_ADD", (y, half)))
            red, green, blue, _ = b.op("IMAGE", (*where, b.constant(0.0)), (b.image(0), 1, 0, 0, 0))
            b.closure("CLOSURE_EMISSION", (red, green, blue))

        camera = Camera(kind="ORTHO", matrix=looking((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)), ortho_scale=1.0)
        scene = scene_of([quad(1.0)], [Material("Picture", program(build))], camera=camera, world=0.0, size=(16, 16),
                         origin=(0.0, 0.0, 0.0), device=device)  # fmt: skip
        scene.film.filter, scene.film.filter_width = "BOX", 0.01
        scene.images = [Image("Texels", pixels)]
        return picture(scene)

    texels = np.random.default_rng(53).uniform(0.1, 1.0, (8, 8, 3)).astype(np.float32)
    whole = shown(texels)
    assert whole.std() > 0.1
    for one in (value, 0.7):  # an image of a single texel
        np.testing.assert_allclose(shown(np.full((1, 1, 3), one, np.float32)), one if np.isfinite(one) else 0.0)
    broken = texels.copy()
    broken[2, 5] = value
    different = (shown(broken) != whole).any(axis=2)
    assert not np.delete(different, np.s_[4:6], axis=0).any() and not np.delete(different, np.s_[10:12], axis=1).any()


@every_device
@pytest.mark.promise(18)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_samples_are_counted_by_cause_and_kept_out(value: float, device: str) -> None:
    """A world whose strength is no number: what paths meet is refused, the floor's own light is kept."""
    camera = Camera(kind="ORTHO", matrix=looking((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)), ortho_scale=4.0)
    scene = scene_of([quad(2.0)], [glow(0.5)], camera=camera, samples=4, size=(16, 16), device=device)
    scene.world = even_world(value)
    result = render(scene)
    pixels = result.passes["Combined"][..., :3]
    assert np.isfinite(pixels).all() and pixels.max() == 0.5
    stats = result.stats
    causes = {key: stats[key] for key in stats if key.startswith("refused_") and key != "refused_share"}
    assert set(causes) == {"refused_emission", "refused_direct", "refused_scatter", "refused_flight", "refused_data"}
    assert stats["non_finite_samples"] == causes["refused_emission"] == sum(causes.values()) > 500


def test_a_scene_of_ordinary_things_refuses_nothing() -> None:
    stats = render(scene_of([quad(2.0)], [diffuse(0.5)], camera=Camera(matrix=at((0, 0, 5))))).stats
    assert stats["non_finite_samples"] == 0
