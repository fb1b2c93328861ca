"""Photon maps: light that paths cannot find, by the answer that is known."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import samplers
from luch._native import core
from luch.effects import effects_of
from luch.kept import Kept
from luch.render import render
from luch.scene import Light, Material, Scene
from support.effects import closure, program
from support.everything import quad
from support.hard_scenes import instances_of, picture
from support.through_glass import ALBEDO, SUN, glass, grey, objects_of, radiance_seen, scene_through_glass


@pytest.mark.parametrize("sampler", samplers.NAMES)
def test_light_through_glass_is_what_it_must_be_where_paths_find_none(sampler: str) -> None:
    assert picture(scene_through_glass(integrator="PATH", sampler=sampler)).max() == 0.0
    lit = render(scene_through_glass(sampler=sampler))
    assert lit.stats["photon_maps"] == 8 and lit.stats["photons_landed"] > 10_000
    assert lit.passes["Combined"][..., :3].mean() == pytest.approx(radiance_seen(), rel=0.02)


def lamp(kind: str) -> Callable[[Scene], None]:
    def build(scene: Scene) -> None:
        high = np.eye(3, 4)
        high[2, 3] = 1.0
        size = {"AREA": {"size": 1.0}, "POINT": {"radius": 0.4}, "SPOT": {"radius": 0.4, "spot_size": 2.5}}
        scene.lights = [Light("Lamp", kind, matrix=high, power=40.0, **size[kind])]  # type: ignore[arg-type]

    return build


def wide_sun(scene: Scene) -> None:
    scene.lights = [Light("Sun", "SUN", power=SUN, angle=0.6)]


def shining_mesh(scene: Scene) -> None:
    """A square that shines downwards, beside the camera's view."""
    scene.lights = []
    scene.meshes.append(quad("Panel", 0.5, 1.0))
    scene.meshes[2].positions[:, 0] += 1.2
    scene.meshes[2].triangles = scene.meshes[2].triangles[:, ::-1].copy()
    scene.objects = objects_of(scene.meshes)
    scene.instances = instances_of(range(3), [np.eye(3, 4)] * 3)
    scene.materials.append(
        Material(
            "Light",
            program(lambda b: b.closure("CLOSURE_EMISSION", b.vector(9.0, 8.0, 7.0))),
            emission_sampling="FRONT_BACK",
        )
    )


@pytest.mark.parametrize("light", [lamp("AREA"), lamp("POINT"), lamp("SPOT"), wide_sun, shining_mesh],
                         ids=["area", "point", "spot", "sun", "mesh"])  # fmt: skip
@pytest.mark.parametrize("roughness", [0.0, 0.25])
def test_photons_bring_what_paths_find_where_they_find_it(light: Callable[[Scene], None], roughness: float) -> None:
    """Light large enough to be met by chance: every way from it to the eye counts once."""

    def scene_of(integrator: str, samples: int) -> Scene:
        scene = scene_through_glass(samples, integrator=integrator, threads=2)
        light(scene)
        scene.materials[1] = Material("Glass", program(lambda b: glass(b, roughness)))
        return scene

    paths, photons = render(scene_of("PATH", 2048)), render(scene_of("PHOTON", 128))
    assert photons.stats["photons_landed"] > 1000
    told = 2.0 * paths.stats["error"] / np.sqrt(paths.passes["Combined"][..., 0].size)
    assert photons.passes["Combined"][..., :3].mean() == pytest.approx(
        float(paths.passes["Combined"][..., :3].mean()), rel=0.02 + told
    )


def test_a_surface_that_also_scatters_counts_each_of_its_lobes_once() -> None:
    """A floor that is half mirror, half rough, and lit over a mirror that hangs beside it."""

    def floor(b: Any) -> None:
        closure(b, "CLOSURE_DIFFUSE", {"color": (ALBEDO,) * 3}, (0.5,) * 3)
        closure(b, "CLOSURE_GLOSSY", {"color": (0.9,) * 3, "roughness": 0.2}, (0.5,) * 3)

    def scene_of(integrator: str, samples: int) -> Scene:
        scene = scene_through_glass(samples, integrator=integrator, threads=2)
        lamp("AREA")(scene)
        scene.materials[0] = Material("Floor", program(floor))
        return scene

    paths, photons = picture(scene_of("PATH", 4096)), picture(scene_of("PHOTON", 256))
    assert photons.mean() == pytest.approx(float(paths.mean()), rel=0.03)


def test_another_view_has_photons_of_its_own() -> None:
    scene, kept = scene_through_glass(samples=4), Kept()
    render(scene, kept=kept)
    other = replace(scene, film=replace(scene.film, width=12), settings=replace(scene.settings, seed=5))
    again = render(other, kept=kept)
    assert again.stats["reused"]
    np.testing.assert_array_equal(again.passes["Combined"], render(other).passes["Combined"])


def test_the_error_that_a_render_tells_is_the_one_it_has() -> None:
    """Photons are shared by all pixels of a map, but not by the parts that tell the error."""
    told, pictures = [], []
    for seed in range(12):
        result = render(scene_through_glass(samples=64, seed=seed))
        told.append(result.stats["error"])
        pictures.append(result.passes["Combined"][..., :3].astype(np.float64))
    mean = np.mean(pictures, axis=0)
    truth = np.sqrt(np.mean([((p - mean) / (mean + 0.01)) ** 2 for p in pictures]) * 12 / 11)
    assert 0.8 < np.sqrt(np.mean(np.square(told))) / truth < 1.25


def test_a_caster_that_lamps_do_not_light_or_shadows_do_not_see_casts_none() -> None:
    scene = scene_through_glass(samples=2)
    scene.objects[1].visibility = 63 & ~32  # as Ray Visibility > Shadow
    hidden = render(scene)
    assert hidden.stats["photons"] == 0
    # Then light passes it straight.
    assert hidden.passes["Combined"][..., :3].mean() > 0.3


def test_effects_say_whether_photons_are_traced_and_why() -> None:
    scene = scene_through_glass()
    assert effects_of(scene)["photon maps"].on
    path = replace(scene, settings=replace(scene.settings, integrator="PATH"))
    assert effects_of(path)["photon maps"].reason == "the integrator is another"
    plain = replace(scene, materials=[Material("Grey", program(grey))] * 2)
    assert effects_of(plain)["photon maps"].reason == "there are no caustics"
    dark = replace(scene, lights=[])
    assert "no light can be chosen" in effects_of(dark)["photon maps"].reason
    blurred = replace(scene, settings=replace(scene.settings, filter_glossy=1.0))
    assert effects_of(blurred)["filter glossy"].reason == "photon maps need none"


@pytest.mark.parametrize("after", [0.0, 0.002, 0.01, 0.03, 0.06])
def test_a_cancel_is_heard_while_photons_are_traced_and_sorted(after: float) -> None:
    """Whatever it breaks off, the film holds whole samples."""
    scene = scene_through_glass(samples=4096, threads=2)
    renderer = core.render.Renderer(scene)
    assert renderer.prepare()
    timer = threading.Timer(after, renderer.cancel)
    timer.start()
    try:
        assert not renderer.render(0, 4096)
    finally:
        timer.join()
    assert np.isfinite(renderer.passes()["Combined"]).all()


def test_an_unknown_integrator_is_told() -> None:
    with pytest.raises(ValueError, match="the integrator is 'BIDIRECTIONAL'; it can be PATH, PHOTON or DISTRIBUTION"):
        render(scene_through_glass(integrator="BIDIRECTIONAL"))


def test_adaptive_sampling_is_left_out_and_said_so() -> None:
    scene = scene_through_glass(samples=64, adaptive=True, error_limit=0.5)
    result = render(scene)
    assert any("photon maps" in warning for warning in result.stats["warnings"])
