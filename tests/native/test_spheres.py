"""Spheres in renders: where they are, what their points tell, in every structure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch.accel import KINDS, PRECISIONS, QUALITIES, Accel, Kind
from luch.render import Result, render
from luch.scene import Attribute, Material, Mesh, Object, Scene
from luch.shader import ProgramBuilder
from numpy.typing import NDArray
from support.accel_meshes import icosphere, random_rays
from support.devices import both, check_equal
from support.effects import closure, program
from support.from_above import Build, add_ball, balls, scene_of, three_places, white

F32 = NDArray[np.float32]
SIZE = 24


def mirror_glass(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_GLASS", {"color": (1.0, 1.0, 1.0), "ior": 1.5})


def see_through(builder: ProgramBuilder) -> None:
    closure(builder, "CLOSURE_TRANSPARENT", {}, weight=(0.5, 0.5, 0.5))


def shows(operation: str, outputs: slice, attribute: str = "") -> Build:
    """A material that glows with what an operation gives."""

    def build(b: ProgramBuilder) -> None:
        params = (0, 0, b.attribute(attribute)) if attribute else ()
        values = b.op(operation, (), params)[outputs]
        b.closure("CLOSURE_EMISSION", tuple(values if len(values) == 3 else values * 3))

    return build


def rendered(scene: Scene) -> Result:
    result = render(scene)
    assert result.stats["non_finite_samples"] == 0
    return result


def mixed() -> Scene:
    """A lumpy ball of triangles among 700 spheres, drawn thrice: as it is, stretched, and mirrored."""
    rng = np.random.default_rng(3)
    mesh = balls(*np.concatenate([rng.uniform(-1.5, 1.5, (700, 3)), rng.exponential(0.05, (700, 1))], 1).tolist())
    add_ball(mesh)
    scene = scene_of(mesh, mirror_glass, width=8.0, matrices=three_places(), world=1.0)
    scene.settings.samples = 4
    return scene


@pytest.fixture(scope="module")
def truth() -> dict[str, F32]:
    scene = mixed()
    scene.settings.accelerator = "BRUTE_FORCE"
    return rendered(scene).passes


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "BRUTE_FORCE"])
def test_every_structure_gives_the_picture_of_brute_force(kind: str, truth: dict[str, F32]) -> None:
    scene = mixed()
    scene.settings.accelerator = kind
    result = rendered(scene)
    assert result.stats["spheres"] == 700
    for name, pixels in truth.items():
        assert np.array_equal(result.passes[name].view(np.uint32), pixels.view(np.uint32)), name


def test_kernels_draw_the_cpus_spheres_and_have_no_code_for_them_without(place: str) -> None:
    scene = mixed()
    cpu, _, ours, stats = both(scene)
    assert stats["kernel_plan"]["SPHERES"]
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)
    bare = replace(scene, meshes=[replace(mesh, spheres=None) for mesh in scene.meshes])
    cpu, _, ours, stats = both(bare)
    assert not stats["kernel_plan"]["SPHERES"]
    check_equal("Combined", cpu["Combined"], ours["Combined"], place)


def test_in_double_precision_the_picture_holds_the_same_surfaces(truth: dict[str, F32]) -> None:
    scene = mixed()
    scene.settings.precision = "DOUBLE"  # of triangles: spheres are tested in double already
    hit = np.isfinite(truth["Depth"]) & (truth["Depth"] < 1e9)
    ours = rendered(scene).passes["Depth"]
    assert np.allclose(ours[hit], truth["Depth"][hit], rtol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_of_a_negative_radius_only_the_outside_is_there(kind: Kind) -> None:
    rng = np.random.default_rng(8)
    centers = np.stack(np.meshgrid(*[np.arange(4.0) - 1.5] * 3), -1).reshape(-1, 3)  # they keep apart
    spheres = np.concatenate([centers, rng.uniform(0.2, 0.45, (64, 1))], axis=1).astype(np.float32)
    outsides = spheres * np.float32([1, 1, 1, -1])
    none = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)
    both, one = (Accel(*none, kind=kind, spheres=balls) for balls in (spheres, outsides))
    rays = random_rays(2000)
    inside = (np.linalg.norm(rays[:, None, :3] - spheres[:, :3], axis=2) < spheres[:, 3]).any(axis=1)
    assert 0 < inside.sum() < 1000
    for of_both, of_one in zip(both.closest(rays[~inside]), one.closest(rays[~inside]), strict=True):
        assert np.array_equal(of_both, of_one)
    rays[:, :3], rays[:, 7] = spheres[rng.integers(0, 64, 2000), :3], 0.1  # from a centre, too short to get out
    assert not one.any(rays).any()
    rays[:, 7] = np.inf
    lonely = Accel(*none, kind=kind, spheres=outsides[:1])
    rays[:, :3] = outsides[0, :3]
    assert not lonely.any(rays).any() and (lonely.closest(rays)[1] == -1).all()


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("away", [0.0, 1e3, 1e7])
def test_the_eight_wide_tree_hits_spheres_as_brute_force_does(precision: Any, quality: Any, away: float) -> None:
    """Of sizes from nothing to the whole scene, one-sided and two-sided, beside triangles, some transparent."""
    rng = np.random.default_rng(11)
    radii = 10.0 ** rng.uniform(-6, 0.3, 900) * rng.choice([-1.0, 1.0], 900)
    spheres = np.concatenate([away + rng.uniform(-2, 2, (900, 3)), radii[:, None]], axis=1).astype(np.float32)
    spheres[::50, 3] = 0.0
    spheres[7] = np.nan
    points, triangles = icosphere(3)
    shared = {
        "precision": precision,
        "spheres": spheres,
        "may_be_transparent": rng.random(len(triangles) + 900) < 0.7,
        "threads": 1,
    }
    mesh = points + np.float32(away), triangles
    ours, truth = Accel(*mesh, kind="BVH", quality=quality, **shared), Accel(*mesh, kind="BRUTE_FORCE", **shared)
    assert ours.stats["spheres"] == 900 - 18 - 1 and ours.stats["dropped_spheres"] == 19
    rays = random_rays(1500, center=away)
    rays[::3, 4:7] = spheres[rng.integers(8, 900, 500), :3] + 0.001 * rng.normal(size=(500, 3)) - rays[::3, :3]
    rays = rays[np.isfinite(rays[:, :7]).all(axis=1)]
    hits = truth.closest(rays)
    assert (hits[1] >= len(triangles)).sum() > 100
    for a, b in zip(ours.closest(rays), hits, strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))
    assert np.array_equal(ours.blocked(rays), truth.blocked(rays))


SIZES = [(0.0, 1.0), (0.0, 1e-6), (0.0, 1e6), (1e4, 1.0), (1e4, 0.05), (1e6, 100.0)]


@pytest.mark.parametrize(("away", "radius"), SIZES)
def test_a_sphere_is_where_it_is_and_its_outside_is_lit(away: float, radius: float) -> None:
    """Diffuse albedo 1 under a sun of pi W/m2: the picture is the cosine. Self-shadowing would make it black."""
    center = np.array([away, -away, 0.5 * away])
    scene = scene_of(balls((*center, radius)), width=2.2 * radius, above=3.0 * radius, at=tuple(center))
    passes = rendered(scene).passes
    hit = np.linalg.norm(passes["Normal"], axis=2) > 0.5
    assert 0.5 < hit.mean() < 0.8, "pi / 4 of the square that holds it"
    ulp = 2.0**-24 * 1.5 * away
    outward = (passes["Position"][hit].astype(np.float64) - center) / radius
    assert np.abs(np.linalg.norm(outward, axis=1) - 1.0).max() < 1e-6 + 4.0 * ulp / radius
    assert np.abs(outward - passes["Normal"][hit]).max() < 1e-6 + 4.0 * ulp / radius
    depth = 3.0 * radius - radius * passes["Normal"][hit][:, 2]
    assert np.abs(passes["Depth"][hit][:, 0] - depth).max() < 1e-5 * radius + 8.0 * ulp
    assert np.allclose(passes["Combined"][hit][:, 0], passes["Normal"][hit][:, 2], atol=1e-5)


def test_a_stretched_instance_is_an_ellipsoid_whose_normal_points_from_its_centre() -> None:
    """As Cycles draws it: the surface is the ellipsoid's, the normal that of a ball."""
    matrix = np.eye(3, 4)[None].copy()
    matrix[0, :, :3] = np.diag([2.0, 1.0, 0.5])
    matrix[0, :, 3] = 0.25, 0.0, 0.0
    passes = rendered(scene_of(balls((0.0, 0.0, 0.0, 1.0)), width=5.0, matrices=matrix)).passes
    hit = np.linalg.norm(passes["Normal"], axis=2) > 0.5
    place = passes["Position"][hit].astype(np.float64) - matrix[0, :, 3]
    assert np.allclose(((place / [2.0, 1.0, 0.5]) ** 2).sum(1), 1.0, atol=1e-5)
    assert np.allclose(passes["Normal"][hit], place / np.linalg.norm(place, axis=1, keepdims=True), atol=1e-5)
    cosine = passes["Normal"][hit][:, 2]
    assert np.allclose(passes["Combined"][hit][:, 0], cosine, atol=1e-4), "no point shadows itself"


def test_from_inside_a_sphere_is_not_there() -> None:
    scene = scene_of(balls((0.0, 0.0, 0.0, 50.0), (0.0, 0.0, 0.0, 1.0)))
    assert np.nanmax(rendered(scene).passes["Position"][SIZE // 2, SIZE // 2, 2]) < 1.0, "the small one shows"
    scene.meshes = [balls((0.0, 0.0, 0.0, 50.0))]
    assert not rendered(scene).passes["Combined"][..., :3].any()


def test_a_radius_of_zero_is_not_drawn() -> None:
    result = rendered(scene_of(balls((0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.4))))
    assert result.stats["spheres"] == 1
    assert result.stats["dropped_spheres"] == 1


@pytest.mark.parametrize(("away", "radius"), SIZES)
def test_glass_spheres_lose_no_light_in_an_even_world(away: float, radius: float) -> None:
    center = (away, -away, 0.5 * away)
    near = (away + 0.7 * radius, -away, 0.5 * away, 0.5 * radius)  # they overlap
    scene = scene_of(
        balls((*center, radius), near), mirror_glass, width=2.5 * radius, above=3.0 * radius, at=center, world=1.0
    )
    scene.settings.samples, scene.settings.max_bounces = 4, 64
    scene.settings.transmission_bounces = scene.settings.glossy_bounces = 64
    scene.settings.min_light_bounces = 64
    assert np.abs(rendered(scene).passes["Combined"][..., :3] - 1.0).max() < 1e-4


def test_light_goes_once_through_each_transparent_sphere() -> None:
    """Only the outside is there: one surface each, of transparency 1/2."""
    floor = np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2], [-9, 9, -2]], np.float32)
    scene = scene_of(balls((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.5)), see_through)
    scene.meshes.append(Mesh("Floor", floor, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), np.zeros(2, np.uint16)))
    scene.objects.append(Object("Floor", 1, [1], visibility=63))
    scene.materials.append(Material("White", program(white)))
    instances = scene.instances
    assert instances is not None
    instances.object = np.array([0, 1], np.uint32)
    instances.matrix = np.repeat(instances.matrix, 2, axis=0)
    instances.random, instances.generated, instances.uv = (np.zeros((2, *s), np.float32) for s in ((), (3,), (2,)))
    scene.objects[0].visibility = 32  # shadow rays alone
    picture = rendered(scene).passes["Combined"][..., 0]
    assert np.allclose(picture[SIZE // 2, SIZE // 2], 0.25, atol=1e-4)


def test_attributes_are_read_by_sphere() -> None:
    mesh = balls((-0.7, 0.0, 0.0, 0.5), (0.7, 0.0, 0.0, 0.5))
    colors = np.array([[0.25, 0.5, 0.75], [1.0, 2.0, 3.0]], np.float32)
    mesh.attributes = {
        "own": Attribute(colors, "SPHERE"),
        "all": Attribute(np.array([[0.5, 0.25, 0.125]], np.float32), "MESH"),
        "vertices": Attribute(np.zeros((0, 3), np.float32), "POINT"),
    }
    middle, left, right = SIZE // 2, SIZE // 4, 3 * SIZE // 4
    row = rendered(scene_of(mesh, shows("ATTRIBUTE_VALUE", slice(0, 3), "own"))).passes["Combined"][middle]
    assert np.array_equal(row[left, :3], colors[0]) and np.array_equal(row[right, :3], colors[1])
    row = rendered(scene_of(mesh, shows("ATTRIBUTE_VALUE", slice(0, 3), "all"))).passes["Combined"][middle]
    assert np.array_equal(row[left, :3], np.float32([0.5, 0.25, 0.125]))
    assert (
        not rendered(scene_of(mesh, shows("ATTRIBUTE_VALUE", slice(0, 3), "vertices")))
        .passes["Combined"][..., :3]
        .any()
    )


def test_point_info_tells_centre_radius_and_a_random_number() -> None:
    """Radius and numbers as Cycles 5.2 showed them for such a cloud."""
    mesh = balls((-0.35, 0.0, 0.0, 0.25), (0.35, 0.0, 0.0, 0.25))
    matrix = np.eye(3, 4)[None].copy()
    matrix[0, :, :3] = np.diag([2.0, 1.0, 1.0])
    matrix[0, :, 3] = 0.0, 0.125, 0.25
    middle, left, right = SIZE // 2 + 1, SIZE // 4, 3 * SIZE // 4
    told = [
        rendered(scene_of(mesh, shows("POINT_INFO", outputs), matrices=matrix)).passes["Combined"][middle, :, :3]
        for outputs in (slice(0, 3), slice(3, 4), slice(4, 5))
    ]
    assert np.allclose(told[0][right], [0.7, 0.125, 0.25], atol=1e-6)
    assert np.allclose(told[1][[left, right]], 0.25 * np.sqrt(2.0), atol=1e-6)
    assert np.allclose(told[2][left], 0.8603128, atol=1e-6) and np.allclose(told[2][right], 0.29501265, atol=1e-6)


@pytest.mark.parametrize(
    ("rows", "fact"),
    [
        (np.zeros((2, 3), np.float32), r"\(S, 4\)"),
        (np.array([[0, 0, 0, 1], [0, np.nan, 0, 1]], np.float32), "sphere 1"),
        (np.array([[0, 0, 0, -1.0]], np.float32), "sphere 0"),
        (np.array([[0, 0, 0, np.inf]], np.float32), "sphere 0"),
    ],
)
def test_spheres_that_mean_nothing_are_refused_by_name(rows: F32, fact: str) -> None:
    scene = scene_of(balls((0.0, 0.0, 0.0, 1.0)))
    scene.meshes[0].spheres = rows
    with pytest.raises(ValueError, match=f'Mesh "Dust".*{fact}'):
        render(scene)
