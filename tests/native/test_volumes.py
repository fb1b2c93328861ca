"""Light in homogeneous media against what theory says of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch.render import Result, render
from luch.scene import Camera, Film, Material, Medium, Mesh, Phase, Scene, Settings
from luch.shader import ProgramBuilder
from scipy import integrate
from support.effects import closure, program
from support.media import at, box, bulb, even, fog, placed, shining, slab

WHITE = (1.0, 1.0, 1.0)


def drawn(scene: Scene, name: str = "Combined") -> Any:
    """Mean of a pass over the picture, float64 (3,); nothing in it may be other than finite."""
    return np.asarray(image(scene)[name], np.float64)[..., :3].mean((0, 1))


def image(scene: Scene) -> dict[str, Any]:
    result: Result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    assert all(np.isfinite(picture).all() for picture in result.passes.values())
    return result.passes


def patient(bounces: int = 1000, samples: int = 64) -> Settings:
    return Settings(samples=samples, threads=1, accelerator="BVH", max_bounces=bounces, volume_bounces=bounces,
                    transparent_bounces=64)  # fmt: skip


@pytest.mark.parametrize("thickness", [1e-3, 1.0, 30.0])
def test_light_through_a_slab_dies_away_as_beer_and_lambert_say(thickness: float) -> None:
    sigma = np.array([0.1, 1.0, 3.0])
    scene = slab(Medium(absorption=tuple(sigma)), thickness, world=shining((1.0, 2.0, 3.0)))
    np.testing.assert_allclose(drawn(scene), np.array([1.0, 2.0, 3.0]) * np.exp(-sigma * thickness), rtol=1e-4)


def test_what_a_slab_shines_by_itself_is_integrated_exactly() -> None:
    sigma, glow = np.array([0.0, 1e-4, 5.0]), np.array([1.0, 2.0, 3.0])
    scene = slab(Medium(tuple(sigma), tuple(glow)), 2.0)
    expected = glow * np.array([2.0, (1.0 - np.exp(-2e-4)) / 1e-4, (1.0 - np.exp(-10.0)) / 5.0])
    np.testing.assert_allclose(drawn(scene), expected, rtol=1e-4)


def test_a_shadow_in_a_slab_is_as_deep_as_the_way_of_its_light() -> None:
    """A matt floor under absorbing water, a sun above: down with the sun, up with the eye."""

    def chalk(builder: ProgramBuilder) -> None:
        closure(builder, "CLOSURE_DIFFUSE", {"color": (0.5, 0.5, 0.5)})

    floor = Mesh("Floor", np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], np.float32),
                 np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.zeros(2, np.uint16))  # fmt: skip
    water = Medium((0.5, 0.2, 0.1))
    scene = placed([floor, box("Water", (40, 40, 2.0), (0, 0, -2.0))], [Material("Chalk", program(chalk)), fog(water)])
    slant = np.array([[0.8, 0, 0.6, 0], [0, 1, 0, 0], [-0.6, 0, 0.8, 0]])  # cosine 0.8
    scene.lights = [bulb((0, 0, 5), 2.0)]
    scene.lights[0].kind, scene.lights[0].matrix, scene.lights[0].angle = "SUN", slant, 0.0
    scene.settings = patient(0)
    expected = 2.0 * 0.8 * 0.5 / np.pi * np.exp(-np.array(water.absorption) * (2.0 + 2.0 / 0.8))
    np.testing.assert_allclose(drawn(scene), expected, rtol=2e-3)


@pytest.mark.parametrize("g", [0.0, 0.7, -0.7])
def test_single_scattering_of_a_lamp_is_that_of_quadrature(g: float) -> None:
    """Down through a slab, lit by a point above it; the shadow rays pass the border."""
    sigma_s, sigma_a, thickness, place = np.array([0.2, 0.5, 1.0]), np.array([0.1, 0.0, 0.3]), 3.0, (1.5, 0.0, 1.0)
    scene = slab(Medium(tuple(sigma_a), scattering=[even(tuple(sigma_s), g)]), thickness)
    scene.camera = Camera(kind="ORTHO", matrix=at(0.0, 0.0, 10.0), ortho_scale=1e-4)
    scene.lights, scene.settings = [bulb(place, 100.0)], patient(0, 1024)
    sigma_t = sigma_s + sigma_a

    def seen(depth: float, channel: int) -> float:
        to = np.array(place) - np.array([0.0, 0.0, -depth])
        distance = float(np.linalg.norm(to))
        inside = distance * depth / (depth + place[2])
        cosine = float(np.dot(to / distance, [0.0, 0.0, -1.0]))  # of the eye's ray with the way to the lamp
        phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
        intensity = 100.0 / (4 * np.pi)
        return float(sigma_s[channel] * phase * intensity / distance**2 * np.exp(-sigma_t[channel] * (depth + inside)))

    expected = [integrate.quad(seen, 0.0, thickness, args=(channel,))[0] for channel in range(3)]
    np.testing.assert_allclose(drawn(scene), expected, rtol=6e-3)


@pytest.mark.parametrize(
    "phases",
    [[even(WHITE)], [even((0.2, 1.0, 3.0), 0.8)], [even(WHITE, -0.6), Phase("DRAINE", WHITE, 0.5, 3.0)],
     [Phase("FOURNIER_FORAND", WHITE, 1.2, 0.2)]],
    ids=["even", "coloured, forward", "backward and Draine", "Fournier-Forand"],
)  # fmt: skip
def test_a_white_furnace_shows_no_trace_of_a_medium_that_absorbs_nothing(phases: list[Phase]) -> None:
    scene = slab(Medium(scattering=phases), 1.0, world=shining(WHITE), settings=patient())
    scene.meshes = [box("Block", (1.0, 0.7, 0.5))]
    np.testing.assert_allclose(drawn(scene), 1.0, atol=0.01)


def test_a_furnace_holds_where_media_meet_and_overlap() -> None:
    media = [Medium(scattering=[even(color, g)]) for color, g in (((1.0, 2.0, 4.0), 0.4), ((3.0, 1.0, 0.5), -0.3))]
    boxes = [box("A", (1.0, 1.0, 1.0)), box("B", (0.6, 0.6, 0.6), (0.5, 0.1, 0.3))]
    scene = placed(boxes, [fog(medium) for medium in media], world=shining(WHITE), settings=patient())
    scene.camera.ortho_scale, scene.settings.samples = 3.0, 512
    np.testing.assert_allclose(drawn(scene), 1.0, atol=0.01)


def test_the_camera_knows_the_media_that_it_stands_in() -> None:
    outer, inner = Medium((0.1, 0.2, 0.3)), Medium((0.5, 0.0, 0.0))
    boxes = [box("Outer", (4.0, 4.0, 4.0)), box("Inner", (1.0, 1.0, 1.0)), box("Away", (1.0, 1.0, 1.0), (9, 0, 0))]
    scene = placed(boxes, [fog(outer), fog(inner), fog(Medium((9.0, 9.0, 9.0)))], world=shining(WHITE))
    expected = np.exp(-np.array([0.1, 0.2, 0.3]) * 4.0 - np.array([0.5, 0.0, 0.0]))
    scene.camera = Camera(matrix=at(0.0, 0.0, 0.0), lens_mm=1e4, clip_start=0.0)
    np.testing.assert_allclose(drawn(scene), expected, rtol=1e-4)
    # Rays begin beyond the inner box's border: at the near clip the camera has left it.
    scene.camera = Camera(matrix=at(0.0, 0.0, 0.0), lens_mm=1e4, clip_start=1.5)
    np.testing.assert_allclose(drawn(scene), np.exp(-np.array([0.1, 0.2, 0.3]) * 2.5), rtol=1e-4)


def test_rays_of_one_wide_camera_begin_in_different_media() -> None:
    scene = placed([box("Block", (1.0, 9.0, 1.0))], [fog(Medium((1.0, 1.0, 1.0)))], world=shining(WHITE))
    scene.camera = Camera(kind="ORTHO", matrix=at(0.0, 0.0, 0.0), ortho_scale=4.0, clip_start=0.0)
    scene.film = Film(width=8, height=2, filter="BOX", filter_width=0.01)
    row = image(scene)["Combined"][0, :, 0]
    inside = np.abs((np.arange(8) + 0.5) * 0.5 - 2.0) < 1.0
    np.testing.assert_allclose(row, np.where(inside, np.exp(-1.0), 1.0), rtol=1e-4)


def test_the_world_fills_all_space_and_hides_what_is_endlessly_far() -> None:
    world = shining(WHITE)
    world.volume = Medium((0.1, 0.0, 0.2))
    floor = box("Floor", (5.0, 5.0, 0.5), (0.0, 0.0, -0.5))

    def glow(builder: ProgramBuilder) -> None:
        closure(builder, "CLOSURE_EMISSION", {}, weight=WHITE)

    scene = placed([floor], [Material("Glow", program(glow))], world=world)
    np.testing.assert_allclose(drawn(scene), np.exp(-np.array([0.1, 0.0, 0.2]) * 9.9), rtol=2e-3)
    scene.instances.object[:] = 0  # type: ignore[union-attr]
    scene.objects[0].visibility = 0
    np.testing.assert_allclose(drawn(scene), [0.0, 1.0, 0.0], atol=1e-6)


def test_light_passes_of_volumes_hold_what_they_scatter() -> None:
    medium = Medium(scattering=[even((0.5, 0.5, 0.5))])
    scene = slab(medium, 1.0, world=shining((0.2, 0.3, 0.4)), lights=[bulb((1, 0, 1))], settings=patient(8, 256))
    scene.film.passes = ["Combined", "Volume Direct", "Volume Indirect", "Environment", "Emission"]
    passes = image(scene)
    total = passes["Volume Direct"] + passes["Volume Indirect"] + passes["Environment"] + passes["Emission"]
    np.testing.assert_allclose(total, passes["Combined"][..., :3], rtol=1e-5)
    assert passes["Volume Direct"].mean() > passes["Volume Indirect"].mean() > 1e-3
    scene.settings.volume_bounces = 0
    assert image(scene)["Volume Indirect"].max() == 0.0


def test_a_veil_of_fog_is_as_opaque_to_the_film_as_to_the_eye() -> None:
    scene = slab(Medium((0.3, 0.3, 0.3), scattering=[even((0.4, 0.4, 0.4))]), 1.0, settings=patient(0, 4096))
    scene.film.transparent = True
    alpha = image(scene)["Combined"][..., 3].mean()
    assert alpha == pytest.approx(1.0 - np.exp(-0.7), abs=0.005)


@pytest.mark.parametrize("density", [0.0, 1e-20, 1e-6, 1.0, 1e6, float("inf"), float("nan")])
@pytest.mark.parametrize("albedo", [0.0, 1.0])
@pytest.mark.parametrize("g", [-1.0, 1.0])
def test_no_density_albedo_or_sharpness_is_too_much(density: float, albedo: float, g: float) -> None:
    medium = Medium((density * (1.0 - albedo),) * 3, (0.1, 0.1, 0.1), [even((density * albedo,) * 3, g)])
    world = shining(WHITE)
    scene = slab(medium, 1.0, world=world, lights=[bulb((0.0, 0.0, -0.5), radius=0.1), bulb((0.03, 0.02, 1.0))])
    scene.settings = patient(32, 4)
    scene.film.passes = ["Combined", "Volume Direct", "Volume Indirect"]
    assert (drawn(scene) >= 0.0).all()
    world.volume = medium
    assert (drawn(scene) >= 0.0).all()


def test_a_dense_white_block_sends_all_light_back() -> None:
    """Mean free paths of a thousandth: thousands of turns, none of which may slip through the border unseen."""
    scene = slab(Medium(scattering=[even((1e3,) * 3)]), 1.0, world=shining(WHITE), settings=patient(100_000, 8))
    scene.film = Film(width=4, height=4)
    np.testing.assert_allclose(drawn(scene), 1.0, atol=0.05)
