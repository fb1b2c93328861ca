"""Distribution ray tracing: what is spread is sampled, light between matt surfaces is not followed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import samplers
from luch.effects import effects_of
from luch.scene import Material, Scene
from luch.shader import ProgramBuilder
from support.effects import closure, program
from support.everything import quad
from support.hard_scenes import instances_of, picture
from support.through_glass import ALBEDO, HALF, grey, objects_of, scene_through_glass


def satin(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_GLOSSY", {"color": (0.9, 0.9, 0.9), "roughness": 0.5})


def under_a_ceiling(leaf: Callable[[ProgramBuilder], None], **settings: Any) -> Scene:
    """A floor that the sun lights from above, through a ceiling that casts no shadow but sends light back."""
    scene = scene_through_glass(**({"integrator": "DISTRIBUTION"} | settings))
    meshes = [scene.meshes[0], quad("Ceiling", HALF, 1.0)]
    scene.camera.matrix[2, 3] = 0.5  # between both
    objects = objects_of(meshes)
    objects[1].visibility = 63 & ~32  # as Ray Visibility > Shadow
    return replace(scene, meshes=meshes, objects=objects, materials=[Material("Leaf", program(leaf))] * 2,
                   instances=instances_of(range(2), [np.eye(3, 4)] * 2))  # fmt: skip


@pytest.mark.parametrize("sampler", samplers.NAMES)
def test_a_matt_floor_has_direct_light_alone(sampler: str) -> None:
    """A sun of pi W/m2 straight above leaves the albedo as radiance; the ceiling's share is what paths add."""
    direct = picture(under_a_ceiling(grey, sampler=sampler))
    np.testing.assert_allclose(direct, ALBEDO, rtol=1e-5)
    paths = picture(under_a_ceiling(grey, sampler=sampler, integrator="PATH"))
    assert paths.mean() > 1.1 * ALBEDO


def test_light_between_glossy_surfaces_is_followed() -> None:
    ours = picture(under_a_ceiling(satin))
    np.testing.assert_array_equal(ours, picture(under_a_ceiling(satin, integrator="PATH")))
    assert ours.mean() > picture(under_a_ceiling(satin, max_bounces=0)).mean()


def test_limits_of_the_user_end_paths_sooner() -> None:
    np.testing.assert_array_equal(
        picture(under_a_ceiling(satin, glossy_bounces=0)),
        picture(under_a_ceiling(satin, glossy_bounces=0, integrator="PATH")),
    )


def test_effects_say_which_bounces_are_not_followed_and_why() -> None:
    effects = effects_of(under_a_ceiling(grey))
    assert not effects["diffuse bounces"].on and not effects["indirect light"].on
    assert effects["diffuse bounces"].reason.startswith("Distribution Ray Tracing follows none, though")
    zero = effects_of(under_a_ceiling(grey, integrator="PATH", diffuse_bounces=0))
    assert zero["diffuse bounces"].reason.startswith("set to 0, though")
    assert effects_of(under_a_ceiling(grey, integrator="PATH"))["diffuse bounces"].on


def test_the_settings_keep_the_limits_for_other_integrators() -> None:
    settings = under_a_ceiling(grey).settings
    assert settings.diffuse_bounces == 32 and settings.bounces("diffuse") == settings.bounces("volume") == 0
    assert settings.bounces("glossy") == 32 and not settings.photon_maps
    assert replace(settings, integrator="PATH").bounces("diffuse") == 32
