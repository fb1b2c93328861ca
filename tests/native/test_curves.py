"""Curves in renders: where they are, what their points tell, in every structure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch.accel import KINDS
from luch.render import Result, render
from luch.scene import Attribute, Scene
from luch.shader import ProgramBuilder
from support.from_above import add_ball, three_places
from support.hair import clear_fibre, fur, scene_of, strands, white

SHAPES = ("RIBBON", "THICK", "THICK_LINEAR")
SIZE = 24


def rendered(scene: Scene) -> Result:
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    return result


def mixed(shape: str) -> Scene:
    """A lumpy ball of triangles among 100 strands, drawn thrice: as it is, stretched, and mirrored."""
    mesh = fur(100)
    add_ball(mesh)
    scene = scene_of(mesh, clear_fibre, shape=shape, width=8.0, matrices=three_places(), world=1.0, size=16)
    scene.settings.samples = 2
    return scene


@pytest.fixture(scope="module")
def truth() -> dict[str, Any]:
    pictures = {}
    for shape in SHAPES:
        scene = mixed(shape)
        scene.settings.accelerator = "BRUTE_FORCE"
        pictures[shape] = rendered(scene).passes
    return pictures


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "BRUTE_FORCE"])
def test_every_structure_gives_the_picture_of_brute_force(kind: str, shape: str, truth: dict[str, Any]) -> None:
    scene = mixed(shape)
    scene.settings.accelerator = kind
    result = rendered(scene)
    assert result.stats["curve_pieces"] > 350
    for name, pixels in truth[shape].items():
        assert np.array_equal(result.passes[name].view(np.uint32), pixels.view(np.uint32)), name


@pytest.mark.parametrize("precision", ["FAST", "DOUBLE"])
def test_other_precisions_see_the_same_hair(precision: str, truth: dict[str, Any]) -> None:
    scene = mixed("RIBBON")
    scene.settings.precision = precision
    ours, exact = rendered(scene).passes["Depth"], truth["RIBBON"]["Depth"]
    hit = np.isfinite(exact) & (exact < 1e9)
    assert np.isclose(ours[hit], exact[hit], rtol=1e-4).mean() > 0.97


def straight(shape: str, away: float, scale: float) -> tuple[dict[str, Any], Any, Any, float]:
    """A straight strand, a quarter thick: passes, the pixels that show it, their places in its own measure, and what
    rounding may be off in that.
    """
    rows = [[away + x * scale, away, 0.0, 0.25 * scale] for x in (-1.0, -0.4, 0.3, 1.0)]
    scene = scene_of(strands(rows), shape=shape, width=3.0 * scale, above=4.0 * scale, size=48)
    scene.camera.matrix[:2, 3] = away
    passes = rendered(scene).passes
    hit = np.linalg.norm(passes["Normal"], axis=2) > 0.5
    assert hit.mean() == pytest.approx(2.0 / 3.0 * 0.5 / 3.0, rel=0.06)
    place = (passes["Position"][hit].astype(np.float64) - [away, away, 0.0]) / scale
    return passes, hit, place, 2.0**-24 * 1.5 * away / scale


AWAY = [(0.0, 1.0), (0.0, 1e-4), (0.0, 1e4), (1e3, 1.0), (1e5, 100.0)]


@pytest.mark.parametrize(("away", "scale"), AWAY)
def test_a_straight_round_curve_is_an_open_cylinder(away: float, scale: float) -> None:
    """Diffuse white under a sun from straight above: as bright as the cosine."""
    passes, hit, place, ulp = straight("THICK", away, scale)
    assert np.abs(np.hypot(place[:, 1], place[:, 2]) - 0.25).max() < 1e-4 + 4.0 * ulp
    normal = passes["Normal"][hit].astype(np.float64)
    assert np.abs(normal[:, 1:] - place[:, 1:] / 0.25).max() < 2e-3 + 32.0 * ulp
    assert np.abs(normal[:, 0]).max() < 1e-3
    assert np.allclose(passes["Combined"][hit][:, 0], normal[:, 2], atol=2e-4), "no point shadows itself"


@pytest.mark.parametrize(("away", "scale"), AWAY)
def test_a_straight_ribbon_is_a_rectangle_shaded_as_if_round(away: float, scale: float) -> None:
    passes, hit, place, ulp = straight("RIBBON", away, scale)
    assert np.abs(place[:, 2]).max() < 1e-5 + 4.0 * ulp, "flat"
    normal = passes["Normal"][hit].astype(np.float64)
    assert np.abs(normal[:, 1] - place[:, 1] / 0.25).max() < 1e-4 + 32.0 * ulp
    assert np.allclose(passes["Combined"][hit][:, 0], normal[:, 2], atol=1e-4), "no point shadows itself"


def test_linear_curves_are_cones_with_balls_at_their_ends() -> None:
    scene = scene_of(strands([[-1.0, 0, 0, 0.1], [1.0, 0, 0, 0.3]]), shape="THICK_LINEAR", size=96)
    passes = rendered(scene).passes
    hit = np.linalg.norm(passes["Normal"], axis=2) > 0.5
    place = passes["Position"][hit].astype(np.float64)
    sine = 0.2 / 2.0  # of the cone: the balls differ by 0.2 over a length of 2
    cosine = np.sqrt(1.0 - sine**2)
    x, r = place[:, 0], np.hypot(place[:, 1], place[:, 2])
    at_left, at_right = x < -1.0 - 0.1 * sine, x > 1.0 - 0.3 * sine
    expected = np.where(
        at_left, np.sqrt(np.maximum(0.01 - (x + 1.0) ** 2, 0.0)),
        np.where(at_right, np.sqrt(np.maximum(0.09 - (x - 1.0) ** 2, 0.0)), 0.1 / cosine + (x + 1.0) * sine / cosine),
    )  # fmt: skip
    assert np.abs(r - expected).max() < 2e-3
    assert at_left.any() and at_right.any()


@pytest.mark.parametrize("shape", SHAPES)
def test_hair_that_absorbs_nothing_loses_no_light(shape: str) -> None:
    """A tangle in an even white world, seen through dozens of bounces, is as bright as the world."""
    scene = scene_of(fur(60, radius=0.1), clear_fibre, shape=shape, width=3.0, world=1.0)
    settings = scene.settings
    settings.samples, settings.max_bounces, settings.min_light_bounces = 16, 200, 200
    settings.transmission_bounces = settings.glossy_bounces = 200
    picture = rendered(scene).passes["Combined"][..., 0].astype(float)
    assert picture.mean() == pytest.approx(1.0, abs=0.01)


def test_bent_curves_pass_through_their_points() -> None:
    rows = [[-1.0, -0.5, 0, 0.05], [-0.3, 0.5, 0, 0.05], [0.4, -0.4, 0, 0.05], [1.0, 0.5, 0, 0.05]]
    for shape in SHAPES:
        passes = rendered(scene_of(strands(rows), shape=shape, size=120)).passes
        hit = np.linalg.norm(passes["Normal"], axis=2) > 0.5
        for x, y, *_ in rows[1:3]:
            assert hit[int((y + 1.5) * 40), int((x + 1.5) * 40)], shape


def shows(*names: str, operation: str = "ATTRIBUTE_VALUE", first: int = 0) -> Any:
    def build(b: ProgramBuilder) -> None:
        values = [b.op(operation, (), (0, 0, b.attribute(name)) if name else ())[first] for name in names]
        b.closure("CLOSURE_EMISSION", (values[0], values[-1], values[0]))

    return build


def test_attributes_are_read_by_curve_and_mixed_between_points() -> None:
    mesh = strands([[-1.0, 0.5, 0, 0.3], [1.0, 0.5, 0, 0.3]], [[-1.0, -0.5, 0, 0.3], [1.0, -0.5, 0, 0.3]])
    mesh.attributes = {
        "own": Attribute(np.array([[0.25], [0.75]], np.float32), "CURVE"),
        "along": Attribute(np.array([[0.0], [1.0], [2.0], [4.0]], np.float32), "CURVE_POINT"),
        "spheres": Attribute(np.zeros((0, 3), np.float32), "SPHERE"),
    }
    picture = rendered(scene_of(mesh, shows("own", "along"))).passes
    color, x = picture["Combined"][..., :2], picture["Position"][..., 0]
    low, high = SIZE // 2 - 4, SIZE // 2 + 4
    inner = slice(6, 18)
    assert np.allclose(color[high, inner, 0], 0.25) and np.allclose(color[low, inner, 0], 0.75)
    # The curve's own parameter: at its ends it is not even.
    assert np.allclose(color[high, inner, 1], 0.5 * (x[high, inner] + 1.0), atol=0.06)
    assert np.allclose(color[low, inner, 1], 3.0 + x[low, inner], atol=0.12)
    assert not rendered(scene_of(mesh, shows("spheres"))).passes["Combined"][..., :3].any()


def test_curves_info_tells_strand_thickness_and_the_normal_across() -> None:
    mesh = strands([[-1.0, 0, 0, 0.2], [1.0, 0, 0, 0.2]])
    matrix = np.eye(3, 4)[None].copy()
    matrix[0, :, :3] = np.diag([1.0, 2.0, 1.0])
    middle = SIZE // 2
    for first, expected in ((0, 1.0), (1, 0.4 * np.sqrt(2.0)), (4, 1.0)):
        told = rendered(scene_of(mesh, shows("", operation="CURVES_INFO", first=first), matrices=matrix)).passes
        assert told["Combined"][middle, middle, 0] == pytest.approx(expected, rel=1e-4)


def test_curves_show_the_material_of_their_slot_and_let_light_through_where_it_is_transparent() -> None:
    def half(builder: ProgramBuilder) -> None:
        builder.closure("CLOSURE_TRANSPARENT", builder.vector(0.5, 0.5, 0.5))

    mesh = strands([[-1.0, 0.5, 0, 0.3], [1.0, 0.5, 0, 0.3]], [[-1.0, -0.5, 0, 0.3], [1.0, -0.5, 0, 0.3]])
    assert mesh.curves is not None
    mesh.curves.material_slots[1] = 1
    scene = scene_of(mesh, half, world=1.0)
    scene.materials.append(scene_of(mesh, shows("none")).materials[0])
    scene.objects[0].materials = [0, 1]
    picture = rendered(scene).passes["Combined"][:, SIZE // 2, 0]
    assert picture[SIZE // 2 + 4] == pytest.approx(0.5) and picture[SIZE // 2 - 4] == 0.0


@pytest.mark.parametrize(
    ("points", "first", "fact"),
    [
        (np.zeros((4, 3), np.float32), [0], r"points \(P, 4\)"),
        (np.zeros((4, 4), np.float32), [0, 3, 2], "curve 1"),
        (np.zeros((4, 4), np.float32), [1], "leave points out"),
    ],
)
def test_curves_that_mean_nothing_are_refused_by_name(points: Any, first: list[int], fact: str) -> None:
    scene = scene_of(strands([[0, 0, 0, 1], [1, 0, 0, 1]]), white)
    curves = scene.meshes[0].curves
    assert curves is not None
    curves.points, curves.first = points, np.array(first, np.uint32)
    curves.material_slots = np.zeros(len(first), np.uint16)
    with pytest.raises(ValueError, match=f'Mesh "Fur".*{fact}'):
        render(scene)


def test_a_curve_of_one_point_or_no_radius_is_not_drawn() -> None:
    scene = scene_of(strands([[0, 0, 0, 0.5]], [[-1, 0, 0, 0.0], [1, 0, 0, 0.0]], [[0, 0.5, 0, 0.1], [1, 0.5, 0, 0.1]]))
    stats = rendered(scene).stats
    assert (stats["curve_pieces"], stats["dropped_curve_pieces"]) == (4, 4)
