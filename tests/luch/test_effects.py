"""Which effects a scene needs: each on and off, with the reason that a user reads."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from luch.effects import Effect, Effects, effects_of, summary
from luch.effects.closures import LAYOUTS, input_places
from luch.effects.picture import PASSES
from luch.effects.programs import decode, read_program
from luch.scene import Camera, Film, Image, Light, Material, Settings
from luch.shader import ProgramBuilder, Value, Vector
from luch.shader_code import OPS
from support.effects import ONE, PLAIN, Inputs, closure, principled, program, scene, sky

HEADER = Path(__file__).resolve().parents[2] / "native/include/luch/shade/nodes/closures.h"


def noise(builder: ProgramBuilder) -> Value:
    """A value that no one knows beforehand."""
    position = builder.op3("POINT_POSITION", (), (0, 0))
    return builder.op1("WHITE_NOISE_3D", position, (0,)) if OPS["WHITE_NOISE_3D"].outputs == 1 else position[0]


def surface(**inputs: object) -> Effects:
    """Effects of one triangle of Principled."""
    return effects_of(scene(lambda b: principled(b, **inputs)))  # type: ignore[arg-type]


def test_inputs_of_closures_are_those_of_the_header() -> None:
    text = HEADER.read_text(encoding="utf-8")
    for name in LAYOUTS:
        assert sum(count for _, count in input_places(name).values()) == OPS[name].inputs, name
    body = {found[0]: found[1] for found in re.findall(r"struct OpClosure(Principled)\b(.*?)return p;", text, re.S)}
    for found in re.finditer(r"LUCH_LOBE_OP\(OpClosure(\w+),(.*?)\n\}\);", text, re.S):
        body[found[1]] = found[2]
    for kind in ("Principled", "Glossy", "Metallic", "Glass", "Refraction"):
        read = re.findall(r"p\.(\w+) = read\.(vec3|number)\(\)", body[kind])
        ours = [(label, count) for label, (_, count) in input_places(f"CLOSURE_{kind.upper()}").items()][1:]
        assert ours == [(label, 3 if kind == "vec3" else 1) for label, kind in read], kind


def test_a_plain_surface_needs_no_more_than_diffuse_and_glossy_bounces() -> None:
    effects = surface()
    assert effects.names(on=True) == [
        "diffuse bounces", "glossy bounces", "indirect light", "reflective caustics", "pass Combined",
    ]  # fmt: skip
    assert effects["transmission"].reason == "no material transmits light: every transmission weight is 0"
    assert effects["transmission bounces"].reason.endswith("the limit of 12 cannot matter")


@pytest.mark.parametrize(
    ("inputs", "effect", "reason"),
    [
        ({"transmission_weight": 1.0}, "transmission", 'material "Leaves" has transmission weight 1'),
        ({"coat_weight": 0.25}, "coat", 'material "Leaves" has coat weight 0.25'),
        ({"sheen_weight": 0.5}, "sheen", 'material "Leaves" has sheen weight 0.5'),
        ({"anisotropic": 0.75}, "anisotropy", 'material "Leaves" has anisotropy 0.75'),
        ({"thin_film_thickness": 300.0}, "thin film", 'material "Leaves" has thin film thickness 300 nm'),
        ({"alpha": 0.25}, "transparency", 'material "Leaves" has alpha 0.25'),
        ({"alpha": 0.25}, "transparent shadows", 'material "Leaves" has alpha 0.25'),
        ({"alpha": 0.25}, "transparent bounces", 'up to 8: material "Leaves" has alpha 0.25'),
        ({"subsurface_weight": 0.5, "thin_wall": 1.0}, "thin subsurface",
         'material "Leaves" has subsurface weight 0.5 in a thin wall'),
        ({"emits": True, "coat_weight": 1.0, "emission_color": ONE}, "emissive meshes",
         'material "Leaves" emits light'),
    ],
)  # fmt: skip
def test_what_a_principled_surface_has_is_on_with_its_value(inputs: Inputs, effect: str, reason: str) -> None:
    effects = surface(**inputs)
    assert effects[effect] == Effect(True, reason, effects[effect].cost, False, effects[effect].group)
    assert not surface()[effect].on


def test_metal_hides_what_lies_under_it() -> None:
    effects = surface(metallic=1.0, transmission_weight=1.0, subsurface_weight=1.0)
    assert not effects["transmission"].on
    assert effects["subsurface"].state == "off"
    assert not effects["diffuse bounces"].on
    assert effects["glossy bounces"].on


def test_a_surface_that_cannot_reflect_uses_no_glossy_bounces() -> None:
    effects = surface(specular_ior_level=0.0)
    assert effects["glossy bounces"].reason == ("no material that is shown reflects: the limit of 4 cannot matter")
    assert effects["indirect light"].reason.startswith("4 at most")


METRES = {"subsurface_radius": (0.01, 0.005, 0.0)}


def skin(**inputs: object) -> Effect:
    """Of a Principled that may scatter inside. method: SubsurfaceMethod of bsdf/params.h."""
    given = {**PLAIN, "subsurface_weight": 0.5, **METRES, **inputs}
    words = (1, 1, 0, 0, int(given.pop("method", 0)))  # type: ignore[call-overload]
    return effects_of(scene(lambda b: closure(b, "CLOSURE_PRINCIPLED_SUBSURFACE", given, params=words)))["subsurface"]


def test_subsurface_is_on_where_it_has_a_weight_and_a_radius() -> None:
    assert skin().on
    assert skin().reason == 'material "Leaves" has subsurface weight 0.5'
    assert skin(method=1).reason.endswith("weight 0.5, by Random Walk (Skin)")
    nothing = (
        {"subsurface_weight": 0.0},
        {"subsurface_radius": (0.0, 0.0, 0.0)},
        {"thin_wall": 1.0},
        {"metallic": 1.0},
    )
    for inputs in nothing:
        effect = skin(**inputs)  # type: ignore[arg-type]
        assert effect.state == "off", inputs
        assert effect.reason.startswith("no material scatters light under its surface")


def test_subsurface_on_spheres_is_named_as_not_supported() -> None:
    inputs = {"color": ONE, "radius": (0.1,) * 3, "ior": 1.4}
    subject = scene(lambda b: closure(b, "CLOSURE_SUBSURFACE", inputs, params=(1, 0)))
    subject.meshes[0].spheres = np.ones((5, 4), np.float32)
    effects = effects_of(subject)
    assert effects["subsurface"].on
    assert effects["subsurface of points"].state == "not yet"
    assert effects["subsurface of points"].reason.endswith("diffuse on the spheres of point clouds")
    subject.meshes[0].triangles = subject.meshes[0].triangles[:0]
    subject.meshes[0].material_slots = subject.meshes[0].material_slots[:0]
    assert effects_of(subject)["subsurface"].state == "off"


def test_a_subsurface_node_is_told_unless_its_radius_is_zero() -> None:
    for radius, on in ((0.01, True), (0.0, False)):
        inputs = {"color": ONE, "radius": (radius,) * 3, "ior": 1.4}
        effects = effects_of(scene(lambda b, given=inputs: closure(b, "CLOSURE_SUBSURFACE", given, params=(1, 3))))
        assert effects["subsurface"].on == on
        assert effects["diffuse bounces"].on
    assert effects_of(scene(principled))["subsurface"].state == "off"


def test_a_value_that_varies_counts_as_there() -> None:
    def build(builder: ProgramBuilder) -> None:
        closure(builder, "CLOSURE_PRINCIPLED", {**PLAIN, "coat_weight": noise(builder)}, params=(1, 1, 0, 0))

    assert effects_of(scene(build))["coat"].reason == 'material "Leaves" has a coat weight that varies'


@pytest.mark.parametrize("weight", [0.0, 0.5])
def test_a_texture_that_feeds_an_absent_layer_is_not_read(weight: float) -> None:
    def build(builder: ProgramBuilder) -> None:
        position = builder.op3("POINT_POSITION", (), (0, 0))
        grain = builder.op("CHECKER", [*position, *([builder.constant(1.0)] * (OPS["CHECKER"].inputs - 3))], (0,))
        inputs = {**PLAIN, "coat_weight": weight, "coat_roughness": grain[0]}
        closure(builder, "CLOSURE_PRINCIPLED", inputs, params=(1, 1, 0, 0))

    effect = effects_of(scene(build))["checker"]
    assert effect.on == (weight > 0.0)
    assert effect.reason == ('material "Leaves" reads it' if weight else "no material reads it")


def bent(operation: str, strength: float) -> Callable[[ProgramBuilder], None]:
    def build(builder: ProgramBuilder) -> None:
        position = builder.op3("POINT_POSITION", (), (0, 0))
        one = builder.constant(1.0)
        rest: tuple[Value, ...] = (one, one, position[0], position[1], position[2], *position)
        if operation == "NORMAL_MAP":
            rest = position
        normal = builder.op3(operation, (builder.constant(strength), *rest), (0, 0, 0)[: OPS[operation].params])
        closure(builder, "CLOSURE_DIFFUSE", {"color": ONE, "normal": normal})

    return build


@pytest.mark.parametrize(("operation", "effect"), [("BUMP", "bump"), ("NORMAL_MAP", "normal maps")])
def test_bent_normals_need_a_strength(operation: str, effect: str) -> None:
    assert effects_of(scene(bent(operation, 1.0)))[effect].reason == 'material "Leaves" bends the normal'
    assert not effects_of(scene(bent(operation, 0.0)))[effect].on


@pytest.mark.parametrize(
    ("name", "inputs", "on"),
    [
        ("CLOSURE_GLASS", {"color": ONE, "ior": 1.5}, ["transmission", "transmission bounces", "glossy bounces"]),
        ("CLOSURE_REFRACTION", {"color": ONE, "ior": 1.5}, ["transmission", "transmission bounces"]),
        ("CLOSURE_TRANSLUCENT", {"color": ONE}, ["translucency", "transmission bounces"]),
        ("CLOSURE_GLOSSY", {"color": ONE, "roughness": 0.5, "anisotropy": -0.5}, ["anisotropy", "glossy bounces"]),
        ("CLOSURE_METALLIC", {"base_color": ONE, "thin_film_thickness": 9.0}, ["thin film", "glossy bounces"]),
        ("CLOSURE_SHEEN", {"color": ONE, "roughness": 0.5}, ["sheen", "glossy bounces"]),
        ("CLOSURE_TOON", {"color": ONE, "size": 0.5}, ["glossy bounces"]),
        ("CLOSURE_DIFFUSE", {"color": ONE}, ["diffuse bounces"]),
    ],
)
def test_closures_alone_bring_their_own_bounces(name: str, inputs: Inputs, on: list[str]) -> None:
    effects = effects_of(scene(lambda b: closure(b, name, inputs)))
    rest = {"indirect light", "pass Combined"}
    assert set(effects.names(on=True)) == {*on, *rest}


def test_a_bounce_limit_of_zero_is_told() -> None:
    subject = scene(principled, settings=Settings(diffuse_bounces=0, max_bounces=3))
    effects = effects_of(subject)
    assert effects["diffuse bounces"].reason == 'set to 0, though material "Leaves" scatters diffusely'
    assert effects["indirect light"].reason == "3 at most: what the kinds that are on allow, up to 3"
    subject.settings.max_bounces = 0
    assert effects_of(subject)["indirect light"].reason == "Max Bounces is 0: direct light alone"


def test_transparent_shadows_can_be_off_where_transparency_is_on() -> None:
    subject = scene(lambda b: principled(b, alpha=0.5))
    subject.materials[0].transparent_shadows = False
    assert effects_of(subject)["transparent shadows"].reason == 'Transparent Shadows is disabled in material "Leaves"'
    subject.objects[0].visibility = 31  # all but shadow
    assert effects_of(subject)["transparent shadows"].reason == 'no object with material "Leaves" casts a shadow'
    assert effects_of(subject)["transparency"].on


def test_a_material_on_no_face_changes_nothing_and_says_so() -> None:
    subject = scene(principled)
    subject.materials.append(Material("Pane", program(lambda b: principled(b, transmission_weight=1.0))))
    subject.objects[0].materials.append(1)
    effect = effects_of(subject)["transmission"]
    assert not effect.on
    assert effect.reason.endswith('(material "Pane" has transmission weight 1, but is on no face that is drawn)')
    subject.meshes[0].material_slots = np.full(1, 7, np.uint16)  # beyond the last: the last
    assert effects_of(subject)["transmission"].on


def test_holdouts_are_objects_or_materials() -> None:
    def build(builder: ProgramBuilder) -> None:
        builder.closure("CLOSURE_HOLDOUT", builder.vector(*ONE))

    assert effects_of(scene(build))["holdout"].reason == 'material "Leaves" has a Holdout'
    subject = scene(principled)
    assert effects_of(subject)["holdout"].reason == "no object and no material is a holdout"
    subject.objects[0].holdout = True
    assert effects_of(subject)["holdout"].reason == 'object "Tree" is a holdout'


def test_depth_of_field_tells_an_f_stop_that_is_set_in_vain() -> None:
    effects = effects_of(scene(principled, camera=Camera(fstop=1.4, use_dof=False)))
    reason = "the f-stop is set (f/1.4) but the camera's Depth of Field is disabled"
    assert effects["depth of field"] == Effect(False, reason, group="Camera")
    effects = effects_of(scene(principled, camera=Camera(fstop=1.4, use_dof=True, focus_distance=3.0, blades=6)))
    assert effects["depth of field"].reason == "f/1.4, in focus at 3 m"
    assert effects["aperture blades"].on


def test_instancing_is_on_where_a_mesh_is_drawn_twice() -> None:
    effect = effects_of(scene(principled, copies=120))["instancing"]
    assert (effect.on, effect.reason, effect.cost) == (True, "1 mesh is drawn 120 times", "saves 119 triangles")
    assert effects_of(scene(principled))["instancing"].reason == "every mesh is drawn once"


def test_point_clouds_are_told_with_their_spheres() -> None:
    subject = scene(principled, copies=3)
    assert effects_of(subject)["point clouds"].reason == "the scene has none"
    subject.meshes[0].spheres = np.ones((5, 4), np.float32)
    effects = effects_of(subject)
    assert (effects["point clouds"].on, effects["point clouds"].reason) == (True, '"Triangle": 5 spheres')
    assert effects["instancing"].cost == "saves 2 triangles and 10 spheres"


@pytest.mark.parametrize("effect", ["hair", "point clouds", "heterogeneous volumes", "displacement", "subsurface"])
def test_what_the_exporter_left_out_is_named_in_its_own_words(effect: str) -> None:
    subject = scene(principled)
    assert effects_of(subject)[effect].state == "off"
    subject.unsupported = {effect: ["It is left out."]}
    assert effects_of(subject)[effect].state == "not yet"
    assert "It is left out." in effects_of(subject)[effect].reason


def test_every_pass_is_an_effect_with_its_bytes() -> None:
    for name, numbers in PASSES.items():
        if name == "Combined":
            continue
        film = Film(passes=["Combined", name])
        effect = effects_of(scene(principled, film=film))[f"pass {name}"]
        assert effect.on
        assert effect.cost.startswith(f"{8 * numbers or 4} bytes a pixel")
        assert not effects_of(scene(principled))[f"pass {name}"].on
    film = Film(passes=["Combined", "CryptoObject00"], cryptomatte_depth=2, aovs=[("Wear", "VALUE")], lightgroups=["A"])
    effects = effects_of(scene(principled, film=film))
    assert effects["cryptomatte"].reason == "Object: 2 names a pixel"
    assert effects["AOVs"].reason == "Wear"
    assert effects["light groups"].cost == "24 bytes a pixel"


def test_settings_that_cut_light_are_effects() -> None:
    settings = Settings(clamp_indirect=10.0, filter_glossy=1.0, caustics_reflective=False)
    effects = effects_of(scene(principled, settings=settings, film=Film(transparent=True)))
    assert effects["clamping"].reason == "indirect light above 10 is cut"
    assert effects["filter glossy"].reason == "Filter Glossy is 1"
    assert effects["reflective caustics"].reason == "Caustics > Reflective is disabled"
    assert effects["transparent film"].on


def test_images_are_counted_once_with_their_bytes() -> None:
    def build(builder: ProgramBuilder) -> None:
        position = builder.op3("POINT_POSITION", (), (0, 0))
        color = builder.op("IMAGE", position, (builder.image(0), 0, 0, 0, 0))
        tiled = builder.op("IMAGE", position, (2, 0, 0, 0, 2, 1001, builder.image(0), 1002, builder.image(1)))
        closure(builder, "CLOSURE_DIFFUSE", {"color": (color[0], tiled[1], color[2])})

    images = [Image("A", np.zeros((500, 500, 4), np.uint8)), Image("B", np.zeros((500, 500, 4), np.uint8))]
    effect = effects_of(scene(build, images=images))["image textures"]
    assert effect.cost == "2 images, 2.0 MB"


def test_the_list_can_be_read_by_people_and_by_programs() -> None:
    effects = surface(alpha=0.5)
    rows = json.loads(json.dumps(effects.as_dict()))
    assert rows["transparency"] == {"on": True, "reason": 'material "Leaves" has alpha 0.5', "group": "Surfaces"}
    assert set(rows) == set(effects)
    text = str(effects)
    assert re.search(r'on +transparency +material "Leaves" has alpha 0\.5', text)
    assert re.search(r"off +depth of field +the f-stop is set", text)
    assert max(map(len, text.splitlines())) <= 118
    assert summary(rows).startswith("transparency, transparent shadows, ")


def test_a_program_is_read_back_as_it_was_built() -> None:
    build = program(bent("BUMP", 1.0))
    nodes, constants = decode(build)
    assert [node.op.name for node in nodes] == ["POINT_POSITION", "BUMP", "CLOSURE_DIFFUSE"]
    assert [constants.get(value) for value in nodes[-1].inputs[:7]] == [1.0] * 6 + [0.0]
    assert read_program(build).has("BUMP")
    build.code[0] = 0xFFFF
    with pytest.raises(ValueError, match="word 0 of a shader program is no operation"):
        decode(build)


def test_an_aov_that_the_film_does_not_keep_is_dead() -> None:
    def build(builder: ProgramBuilder) -> None:
        position = builder.op3("POINT_POSITION", (), (0, 0))
        shade: Vector = builder.op("MAGIC", (*position, *builder.vector(1.0, 1.0, 1.0))[: OPS["MAGIC"].inputs], (2,))[
            :3
        ]  # type: ignore[assignment]
        builder.closure("STORE_AOV", None, (*shade, builder.constant(1.0)), (builder.aov("Wear"),))

    assert not effects_of(scene(build))["magic"].on
    assert effects_of(scene(build, film=Film(aovs=[("Wear", "COLOR")])))["magic"].on


def test_what_lies_beside_the_common_cases_is_told_too() -> None:
    subject = scene(principled, camera=Camera(kind="EQUIRECTANGULAR"), film=Film(transparent=True))
    subject.film.transparent_glass = True
    subject.objects[0].shadow_catcher = True
    subject.unsupported = {"light linking": ['Object "Tree" uses light linking.'], "ray portals": ["A portal."]}
    subject.lights = [Light("Lantern", "POINT", program=program(lambda b: sky(b, "IES")))]
    effects = effects_of(subject)
    assert effects["panorama"].on
    assert effects["transparent glass"].reason == "nothing transmits light"
    assert (
        effects["shadow catcher"].state == effects["light linking"].state == effects["ray portals"].state == "not yet"
    )
    assert effects["lamp nodes"].reason == 'lamp "Lantern" has nodes'
    assert effects["IES profiles"].reason == 'lamp "Lantern" reads one'
    plain = effects_of(scene(principled, lights=[Light("Lantern", "POINT")]))
    assert plain["panorama"].reason == "the camera is perspective"
    assert plain["transparent glass"].reason == "Film > Transparent Glass is disabled"
    assert {plain[name].state for name in ("shadow catcher", "light linking", "lamp nodes", "IES profiles")} == {"off"}
