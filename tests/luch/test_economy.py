"""What a scene does not contain costs nothing: counts of the work that was done, effect by effect.

Each case renders one small scene twice, without and with an effect, and looks at what the core counted. Absent: no
such work at all. Present: it is there, and the picture shows it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from luch.effects import effects_of
from luch.effects.picture import PASSES
from luch.render import Result, render
from luch.scene import Camera, Film, Instances, Light, Material, Medium, Mesh, Object, Scene, Settings, World
from luch.shader import ProgramBuilder
from luch.shader_code import OPS
from support.effects import ONE, closure, principled, program
from support.hair import strands

SIZE, SAMPLES = 12, 4
PATHS = SIZE * SIZE * SAMPLES


def quad(name: str, half: float, z: float) -> Mesh:
    """A square that faces up."""
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh(name, corners, triangles, np.zeros(2, np.uint16))


def grey(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_DIFFUSE", {"color": (0.5, 0.5, 0.5)})


def room(leaf: Callable[[ProgramBuilder], None] = grey) -> Scene:
    """A floor, a leaf half way up to the camera that looks down, a lamp without size above both, no world."""
    camera = Camera(matrix=np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 6.0]]), lens_mm=36.0)
    count = 2
    instances = Instances(
        np.arange(count, dtype=np.uint32), np.repeat(np.eye(3, 4)[None], count, axis=0), np.zeros(count, np.float32),
        np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32),
    )  # fmt: skip
    lamp = Light("Bulb", "POINT", matrix=np.array([[1.0, 0, 0, 1.0], [0, 1.0, 0, 0], [0, 0, 1.0, 9.0]]), power=500.0)
    return Scene(
        meshes=[quad("Floor", 4.0, 0.0), quad("Leaf", 1.0, 2.0)],
        objects=[Object("Floor", 0, [0]), Object("Leaf", 1, [1])],
        instances=instances,
        materials=[Material("Stone", program(grey)), Material("Leaves", program(leaf))],
        lights=[lamp],
        camera=camera,
        film=Film(width=SIZE, height=SIZE),
        settings=Settings(samples=SAMPLES, threads=1, accelerator="BVH", max_bounces=2),
    )


def rendered(scene: Scene) -> tuple[dict[str, Any], Result]:
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    return result.stats, result


def same_bits(a: Result, b: Result, name: str = "Combined") -> bool:
    return np.array_equal(a.passes[name].view(np.uint32), b.passes[name].view(np.uint32))


def test_a_scene_of_plain_surfaces_and_a_point_lamp_does_nothing_else() -> None:
    stats, _ = rendered(room())
    idle = ("lens_samples", "lamp_searches", "transparent_steps", "world_points", "light_points")
    assert {name: stats[name] for name in idle} == dict.fromkeys(idle, 0)
    assert stats["film_pixel_bytes"] == (4 + 2 * 4) * 8 + 4  # Combined, two marks, the count of samples
    assert stats["paths"] == PATHS
    assert stats["shadow_rays"] <= stats["surface_points"], "one light, one shadow ray at a point"


def test_without_depth_of_field_no_path_chooses_a_point_of_the_lens() -> None:
    scene = room()
    scene.camera.use_dof, scene.camera.focus_distance, scene.camera.fstop = True, 6.0, 0.02
    assert effects_of(scene)["depth of field"].on
    stats, blurred = rendered(scene)
    assert stats["lens_samples"] == PATHS
    scene.camera.use_dof = False
    stats, sharp = rendered(scene)
    assert stats["lens_samples"] == 0
    assert not same_bits(sharp, blurred)


@pytest.mark.parametrize("alpha", [1.0, 0.5])
def test_shadow_rays_look_through_surfaces_only_where_one_has_alpha(alpha: float) -> None:
    scene = room(lambda builder: principled(builder, alpha=alpha))
    assert effects_of(scene)["transparent shadows"].on == (alpha < 1.0)
    stats, _ = rendered(scene)
    assert (stats["transparent_steps"] > 0) == (alpha < 1.0)
    if alpha == 1.0:
        assert stats["shadow_rays"] <= stats["surface_points"]
    scene.materials[1].transparent_shadows = False
    assert not effects_of(scene)["transparent shadows"].on
    assert rendered(scene)[0]["transparent_steps"] == 0


@pytest.mark.parametrize("radius", [0.0, 0.5])
def test_rays_look_for_lamps_only_where_one_has_a_size(radius: float) -> None:
    scene = room()
    scene.lights[0].radius = radius
    assert effects_of(scene)["visible lamps"].on == (radius > 0.0)
    stats, _ = rendered(scene)
    assert stats["lamp_searches"] == (stats["rays"] if radius else 0)


def test_a_lamp_that_no_ray_can_see_is_not_looked_for() -> None:
    scene = room()
    scene.lights[0].radius, scene.lights[0].visibility = 0.5, 0
    assert not effects_of(scene)["visible lamps"].on
    assert rendered(scene)[0]["lamp_searches"] == 0


def shining_world(varies: bool, strength: float = 1.0) -> World:
    def build(builder: ProgramBuilder) -> None:
        color = builder.vector(strength, strength, strength)
        if varies:
            direction = builder.op3("POINT_POSITION", (), (0, 0))
            color = (color[0], color[1], builder.op1("MATH_ABSOLUTE", (direction[2],)))
        builder.closure("CLOSURE_EMISSION", color)

    return World("Sky", program(build), map_resolution=16, sampling="MANUAL")


@pytest.mark.parametrize("varies", [False, True])
def test_the_worlds_program_runs_only_where_it_varies(varies: bool) -> None:
    scene = room()
    scene.world = shining_world(varies)
    effects = effects_of(scene)
    assert effects["world light sampling"].on == effects["world colour"].on ^ True == varies
    stats, result = rendered(scene)
    assert (stats["world_points"] > 0) == varies
    assert (stats["light_points"] > 0) == varies
    assert result.passes["Combined"][..., :3].max() > 0.0


def test_a_black_world_is_no_world() -> None:
    none, black = room(), room()
    black.world = shining_world(False, 0.0)
    assert effects_of(black)["world colour"].reason.startswith("world")
    (a, without), (b, dark) = rendered(none), rendered(black)
    counts = ("rays", "shadow_rays", "surface_points")
    assert [a[name] for name in counts] == [b[name] for name in counts]
    assert b["world_points"] == 0, "the program of a black world ran"
    assert same_bits(without, dark)


def test_a_last_ray_is_cast_only_where_it_could_meet_light() -> None:
    lit, scene = room(), room()
    # An emitter far below that nothing sees: last rays have something to look for, and find nothing.
    lit.meshes.append(quad("Lamp", 0.01, -50.0))
    lit.materials.append(Material("Glow", program(lambda b: b.closure("CLOSURE_EMISSION", b.vector(*ONE)))))
    lit.materials[2].emission_sampling = "NONE"
    lit.objects.append(Object("Lamp", 2, [2]))
    lit.instances = Instances(
        np.arange(3, dtype=np.uint32), np.repeat(np.eye(3, 4)[None], 3, axis=0), np.zeros(3, np.float32),
        np.zeros((3, 3), np.float32), np.zeros((3, 2), np.float32),
    )  # fmt: skip
    (a, with_rays), (b, without) = rendered(lit), rendered(scene)
    assert same_bits(with_rays, without)
    assert b["rays"] < a["rays"]
    assert b["surface_points"] == a["surface_points"]
    assert b["shadow_rays"] == a["shadow_rays"]
    # The denoiser's passes wait for what lies behind: they do not end with the light.
    lit.film = scene.film = Film(width=SIZE, height=SIZE, passes=["Combined", "Denoising Albedo"])
    (_, with_rays), (_, without) = rendered(lit), rendered(scene)
    assert same_bits(with_rays, without, "Denoising Albedo") and same_bits(with_rays, without)


def test_the_last_surface_is_shaded_only_where_it_could_give_light() -> None:

    def shining(builder: ProgramBuilder) -> None:
        grey(builder)
        builder.closure("CLOSURE_EMISSION", builder.vector(*ONE))

    counts = []
    for build in (grey, shining):  # the same paths: lights that are not sampled draw no random number
        scene = room()
        scene.world = shining_world(False)
        scene.settings.min_light_bounces = 9  # no roulette: it spares what shines
        scene.settings.samples = 16 * SAMPLES  # few paths meet a third surface
        scene.materials = [Material(name, program(build), emission_sampling="NONE") for name in ("Stone", "Leaves")]
        counts.append(rendered(scene)[0])
    assert counts[0]["rays"] == counts[1]["rays"]
    assert counts[0]["surface_points"] < counts[1]["surface_points"]


@pytest.mark.parametrize("name", [name for name in PASSES if name != "Combined"])
def test_a_pass_takes_its_bytes_and_changes_no_other(name: str) -> None:
    scene = room()
    stats, plain = rendered(scene)
    scene.film.passes = ["Combined", name]
    with_pass, result = rendered(scene)
    # A light pass that is divided by its colour keeps that too.
    color = 3 if name.endswith(("Direct", "Indirect")) and not name.startswith("Volume") else 0
    assert with_pass["film_pixel_bytes"] - stats["film_pixel_bytes"] == 8 * (PASSES[name] + color)
    assert same_bits(plain, result)
    assert with_pass["surface_points"] == stats["surface_points"]
    more = with_pass["shadow_rays"] - stats["shadow_rays"]
    assert (more > 0) == (name == "Ambient Occlusion")
    if name == "Ambient Occlusion":
        assert more <= PATHS, "one at the first surface of a path"


def test_bounces_of_a_kind_that_no_surface_has_cost_nothing() -> None:
    scene = room()
    assert effects_of(scene)["glossy bounces"].reason.endswith("the limit of 4 cannot matter")
    first, a = rendered(scene)
    scene.settings.glossy_bounces = scene.settings.transmission_bounces = 0
    second, b = rendered(scene)
    assert first["rays"] == second["rays"] and same_bits(a, b)


def one_sided(builder: ProgramBuilder) -> None:
    """Shines downwards red, upwards a little blue."""
    behind = builder.op1("POINT_BACKFACING")
    before = builder.op1("MATH_SUBTRACT", (builder.constant(1.0), behind))
    closure(builder, "CLOSURE_EMISSION", {}, weight=(behind, builder.constant(0.0), before))


def test_a_light_whose_sides_are_each_of_one_colour_runs_no_program_to_be_sampled() -> None:
    scene = room(one_sided)
    scene.lights = []
    stats, lean = rendered(scene)
    assert stats["light_points"] == 0
    assert stats["shadow_rays"] > 0, "the leaf is chosen as a light"
    scene.settings.force_effects = ["emissive meshes"]
    stats, full = rendered(scene)
    assert stats["light_points"] > 0
    assert same_bits(lean, full)
    red, green, blue = lean.passes["Combined"][..., :3].reshape(-1, 3).mean(0)
    assert red > 0.01 and green == 0.0 and blue > 0.01


def test_lamp_nodes_run_only_where_a_lamp_has_them() -> None:
    scene = room()
    assert rendered(scene)[0]["light_points"] == 0

    def build(builder: ProgramBuilder) -> None:
        read = [builder.constant(1.0)] * OPS["LIGHT_FALLOFF"].inputs
        strength = builder.op("LIGHT_FALLOFF", read, (0,) * OPS["LIGHT_FALLOFF"].params)
        builder.closure("CLOSURE_EMISSION", (strength[0],) * 3)

    scene.lights[0].program = program(build)
    assert effects_of(scene)["lamp nodes"].on
    assert rendered(scene)[0]["light_points"] > 0


def test_volumes_cost_nothing_where_there_are_none() -> None:
    empty = room()
    without, plain = rendered(empty)
    assert without["flights"] == 0
    assert not effects_of(empty)["volumes"].on
    empty.materials[0].volume = Medium()  # it holds nothing
    same, result = rendered(empty)
    assert same["flights"] == 0 and same_bits(plain, result)
    empty.world = World("Night", program(None), volume=Medium((0.1, 0.1, 0.1)))
    with_fog, foggy = rendered(empty)
    assert with_fog["flights"] >= PATHS
    assert foggy.passes["Combined"][..., :3].mean() < 0.7 * plain.passes["Combined"][..., :3].mean()
    assert effects_of(empty)["volumes"].reason == 'world "Night" absorbs 0.1 0.1 0.1 per metre'
    assert not effects_of(empty)["volume bounces"].on


def test_hair_costs_nothing_where_there_is_none() -> None:
    bald = room()
    without, plain = rendered(bald)
    assert without["curve_pieces"] == 0
    assert not effects_of(bald)["hair"].on and not effects_of(bald)["hair shading"].on
    bald.settings.curve_shape, bald.settings.curve_subdivisions = "THICK", 4
    same, result = rendered(bald)
    assert same_bits(plain, result)
    assert [same[name] for name in ("structure_bytes", "rays")] == [
        without[name] for name in ("structure_bytes", "rays")
    ]
    furry = room()
    furry.meshes[1].curves = strands([[-1.0, 0.0, 2.2, 0.2], [1.0, 0.3, 2.4, 0.2]]).curves
    assert effects_of(furry)["hair"].on and not effects_of(furry)["hair shading"].on
    with_hair, shaggy = rendered(furry)
    assert with_hair["curve_pieces"] == 4
    assert with_hair["structure_bytes"] > without["structure_bytes"]
    assert not same_bits(plain, shaggy)
