"""Effects of light: lamps by type, emissive meshes, the world; each on and off, with the reason that a user reads."""

from __future__ import annotations

import pytest
from luch.effects import Effects, effects_of
from luch.scene import Light, World
from luch.shader import ProgramBuilder
from support.effects import ONE, principled, program, scene, sky

LAMP_KINDS = {"POINT": "point lamps", "SPOT": "spot lamps", "SUN": "sun lamps", "AREA": "area lamps"}


@pytest.mark.parametrize(("kind", "effect"), LAMP_KINDS.items())
def test_lamps_are_told_by_type(kind: str, effect: str) -> None:
    lamp = Light("Key", kind, radius=0.1, angle=0.01)
    effects = effects_of(scene(principled, lights=[lamp]))
    assert effects[effect].reason == '"Key"'
    assert effects["soft shadows of lamps"].reason == 'lamp "Key" has a size'
    assert effects["visible lamps"].on == (kind != "SUN")
    others = set(LAMP_KINDS.values()) - {effect}
    assert all(effects[other].reason == "the scene has none" for other in others)
    lamp.power = 0.0
    assert effects_of(scene(principled, lights=[lamp]))[effect].reason == '"Key" has no power'


def test_point_like_lamps_are_neither_soft_nor_visible() -> None:
    lamps = [Light("Bulb", "POINT"), Light("Sun", "SUN")]
    effects = effects_of(scene(principled, lights=lamps))
    assert effects["soft shadows of lamps"].reason == "no lamp has a size"
    assert effects["visible lamps"].reason == "no lamp has a size"
    assert effects["light tree"].reason == "there is one light: nothing to choose"


def test_the_light_tree_counts_lamps_and_emissive_triangles() -> None:
    def build(builder: ProgramBuilder) -> None:
        builder.closure("CLOSURE_EMISSION", builder.vector(*ONE))

    subject = scene(build, copies=3, lights=[Light("Bulb", "POINT")])
    effects = effects_of(subject)
    assert effects["emissive meshes"].cost == "3 triangles are lights to choose from"
    assert effects["light tree"].reason == "chooses among 4 lights"
    subject.materials[0].emission_sampling = "NONE"
    effects = effects_of(subject)
    assert effects["emissive meshes"].cost == "found by chance alone: not sampled"
    assert not effects["light tree"].on
    subject.settings.light_tree = False
    assert effects_of(subject)["light tree"].reason.startswith("Light Tree is disabled")
    assert effects_of(scene(principled))["emissive meshes"].reason == "no material emits light"


@pytest.mark.parametrize(
    ("operation", "effect", "reason"),
    [
        ("ENVIRONMENT", "environment image", 'world "Day" shows an image'),
        ("SKY_ATMOSPHERE", "sky", 'world "Day" shows a Sky Texture'),
        ("NOISE_3D", "procedural world", 'world "Day" shows a procedural texture'),
    ],
)
def test_the_world_is_told_by_what_it_shows(operation: str, effect: str, reason: str) -> None:
    effects = effects_of(scene(principled, world=World("Day", program(lambda b: sky(b, operation)))))
    worlds = {"world colour", "environment image", "sky", "procedural world", "world light sampling"}
    assert worlds & set(effects.names(on=True)) == {effect, "world light sampling"}
    assert effects[effect].reason == reason


def test_a_world_of_one_colour_needs_no_sampling() -> None:
    def grey(strength: float) -> Effects:
        build = program(lambda b: b.closure("CLOSURE_EMISSION", b.vector(strength, strength, strength)))
        return effects_of(scene(principled, world=World("Day", build)))

    assert grey(0.5)["world colour"].reason == 'world "Day" has one colour, 0.5 0.5 0.5'
    assert grey(0.5)["world light sampling"].reason.endswith("no direction is better than another")
    assert grey(0.0)["world colour"].reason == 'world "Day" is black'
    assert effects_of(scene(principled))["sky"].reason == "the scene has no world"
