"""Effects that a user leaves out, or forces, to see what they cost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch.cli import main
from luch.effects import effects_of
from luch.effects.editing import rewrite
from luch.effects.forcing import IN_CORE, forcible
from luch.effects.removal import REMOVALS, without
from luch.render import Result, render
from luch.scene import Attribute, Scene
from luch.scenefile import write_scene
from luch.shader import ProgramBuilder
from support.effects import closure, principled, program, scene
from support.everything import everything
from support.hair import strands


def bits(result: Result, name: str = "Combined") -> Any:
    return result.passes[name].view(np.uint32)


def asking(subject: Scene, **settings: Any) -> Scene:
    return replace(subject, settings=replace(subject.settings, **settings))


def rich(builder: ProgramBuilder) -> None:
    """A surface with every layer."""
    principled(builder, alpha=0.8, base_color=(0.6, 0.3, 0.2), coat_weight=0.4, sheen_weight=0.5, anisotropic=0.6,
               thin_film_thickness=300.0, transmission_weight=0.3, roughness=0.3)  # fmt: skip
    closure(builder, "CLOSURE_TRANSLUCENT", {"color": (0.1, 0.2, 0.3)}, weight=(0.2, 0.2, 0.2))


def test_a_program_that_nothing_was_changed_in_draws_the_same_picture() -> None:
    subject = everything()
    same = replace(
        subject, materials=[replace(m, surface=rewrite(m.surface, lambda _, node: node)) for m in subject.materials]
    )
    assert [m.surface.flags for m in same.materials] == [m.surface.flags for m in subject.materials]
    assert np.array_equal(bits(render(same)), bits(render(subject)))


@pytest.mark.parametrize("name", ["coat", "sheen", "anisotropy", "thin film", "transmission", "translucency",
                                  "transparency"])  # fmt: skip
def test_a_layer_that_is_left_out_is_gone_and_told(name: str) -> None:
    subject = scene(rich)
    assert effects_of(subject)[name].on
    effects = effects_of(asking(subject, without_effects=[name]))
    assert not effects[name].on
    assert effects[name].state == "left out"
    assert effects[name].reason == effects_of(subject)[name].reason, "what asks for it is still told"
    others = [other for other in effects_of(subject).names(on=True) if other != name]
    gone = [other for other in others if not effects[other].on]
    assert all("bounces" in other or "transparen" in other or "caustics" in other for other in gone), gone
    assert effects_of(subject)[name].on, "the scene itself stays as it is"


@pytest.mark.parametrize("name", ["depth of field", "sun lamps", "area lamps", "point lamps", "emissive meshes",
                                  "procedural world", "transparency", "transmission", "coat", "indirect light",
                                  "transparent shadows"])  # fmt: skip
def test_a_picture_without_an_effect_is_another(name: str) -> None:
    subject = everything(max_bounces=3)
    subject.camera.fstop = 0.2
    subject.world = subject.world and replace(subject.world, sampling="NONE")
    effects = effects_of(subject)
    wanted = name if effects[name].on or name != "procedural world" else "world colour"
    result = render(asking(subject, without_effects=[wanted]))
    assert not np.array_equal(bits(result), bits(render(subject)))
    assert np.isfinite(result.passes["Combined"]).all()
    assert not result.stats["effects"][wanted]["on"]


def test_every_effect_that_can_be_left_out_is_one_and_leaves_a_scene_that_renders() -> None:
    subject = everything(max_bounces=1)
    subject.film.passes = ["Combined", "Depth", "Error", "CryptoObject00"]
    known = effects_of(subject)
    for name in REMOVALS:
        assert name in known, name
        without(subject, [name])
    result = render(asking(subject, without_effects=list(REMOVALS)))
    assert set(result.passes) == {"Combined"}
    assert result.passes["Combined"][..., :3].max() == 0.0, "no light is left"


def test_hair_and_points_leave_with_what_they_know_of_themselves() -> None:
    """Attributes of curves that were gone did not fit their domain: no render began."""
    plain = everything(max_bounces=1)
    furry = everything(max_bounces=1)
    fur = strands([[0.0, 0.0, 2.0, 0.2], [0.5, 0.3, 2.4, 0.2]], [[0.2, 0.0, 2.0, 0.2], [0.7, 0.3, 2.4, 0.2]])
    furry.meshes[0] = replace(
        furry.meshes[0], curves=fur.curves, spheres=np.array([[0.0, 0.0, 3.0, 0.3]], np.float32),
        attributes={
            **furry.meshes[0].attributes,
            "curves:random": Attribute(np.ones((2, 1), np.float32), "CURVE"),
            "along": Attribute(np.ones((4, 1), np.float32), "CURVE_POINT"),
            "of points": Attribute(np.ones((1, 1), np.float32), "SPHERE"),
        },
    )  # fmt: skip
    assert not np.array_equal(bits(render(furry)), bits(render(plain)))
    shaved = render(asking(furry, without_effects=["hair", "point clouds"]))
    assert np.array_equal(bits(shaved), bits(render(plain)))


def test_a_name_that_is_no_effect_is_told_with_those_that_are() -> None:
    with pytest.raises(ValueError, match=r'"coats" cannot be left out. These can: .*coat'):
        effects_of(asking(everything(), without_effects=["coats"]))
    with pytest.raises(ValueError, match=r'"coats" cannot be simulated where a scene lacks it. .* ALL: depth of field'):
        effects_of(asking(everything(), force_effects=["coats"]))


def bare() -> Scene:
    """Chalk, lit by a point: nothing that can be forced is there."""
    subject = everything(max_bounces=3)
    subject.camera.use_dof = False
    subject.lights = [replace(subject.lights[0], radius=0.0)]
    builder = ProgramBuilder()
    closure(builder, "CLOSURE_EMISSION", {}, weight=(0.2, 0.3, 0.4))
    subject.world = subject.world and replace(subject.world, program=builder.finish())

    def chalk(builder: ProgramBuilder) -> None:
        closure(builder, "CLOSURE_DIFFUSE", {"color": (0.6, 0.5, 0.4)})

    subject.materials = [replace(m, surface=program(chalk)) for m in subject.materials]
    return subject


WORK = {"depth of field": "lens_samples", "visible lamps": "lamp_searches", "transparent shadows": "",
        "procedural world": "world_points", "emissive meshes": ""}  # fmt: skip


@pytest.mark.parametrize("name", [*WORK, "ALL"])
def test_forced_work_is_done_and_changes_no_bit(name: str) -> None:
    lean, full = render(bare()), render(asking(bare(), force_effects=[name]))
    assert np.array_equal(bits(lean), bits(full))
    assert set(WORK) == set(IN_CORE)
    for effect, count in WORK.items():
        if not count:
            continue
        assert lean.stats[count] == 0
        assert (full.stats[count] > 0) == (name in (effect, "ALL")), effect
    looked_through = full.stats["shadow_rays"] > lean.stats["shadow_rays"]
    assert looked_through == (name in ("transparent shadows", "ALL"))
    if name != "ALL":
        assert full.stats["effects"][name]["on"]
        assert full.stats["effects"][name]["reason"].startswith("simulated on request, though ")


def test_what_can_be_forced_are_effects() -> None:
    known = effects_of(everything())
    assert [name for name in forcible() if name not in known and not name.startswith("pass ")] == []


def test_the_command_line_leaves_out_and_forces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "all.luch", tmp_path / "all.png"
    write_scene(everything(max_bounces=1), path)
    assert main(["render", str(path), "-o", str(out), "--quiet", "--without-effect", "depth of field",
                 "--force-effect", "ALL"]) == 0  # fmt: skip
    assert main(["render", str(path), "-o", str(out), "--quiet", "--without-effect", "fog"]) == 1
    assert '"fog" cannot be left out' in capsys.readouterr().err
