"""Rays at their limits, for every structure. Numbers: the rows of the list of hard cases.

Rows 9 to 16 are renders, row 35 is of instances (tests/native/test_accel_instances.py); rows 27
to 30 of the exporter stand in tests/addon. The long runs of rows 1 to 8 are `build.py bench leaks`.
"""

from __future__ import annotations

import numpy as np
import pytest
from luch import core
from luch.accel import Accel, Device, Kind
from support import closed_meshes
from support.accel_meshes import F32, aimed_rays, cube, icosphere, random_rays, rows, separate, soup
from support.asked import every_device, every_kind
from support.hard_rays import assert_same_hits

# Rays a case: what each kind traces in some tenths of a second on one core.
COUNT: dict[str, int] = {"BVH": 200_000, "BVH2": 50_000, "BRUTE_FORCE": 50}
OTHERS = 20_000


@every_device
@every_kind
@pytest.mark.parametrize("each", [0, pytest.param(1_000_000, marks=pytest.mark.full)])
@pytest.mark.parametrize("name", closed_meshes.MESHES)
def test_rows_1_to_8_no_ray_leaves_a_closed_mesh(name: str, each: int, kind: Kind, device: Device) -> None:
    """each: rays of every sort; 0: some tenths of a second of them."""
    some = COUNT.get(kind, OTHERS) // len(closed_meshes.RAYS)
    count = each if each and kind != "BRUTE_FORCE" else some
    accel = Accel(*closed_meshes.MESHES[name], kind=kind, device=device)
    for rays in closed_meshes.RAYS:
        out, traced = closed_meshes.leaks(accel, name, rays, count)
        assert out == 0, f"{rays}: {out} of {traced}"


@every_device
@every_kind
@pytest.mark.parametrize("count", [60_000, pytest.param(3_000_000, marks=pytest.mark.full)])
def test_row_17_rays_off_a_face_do_not_hit_it_and_rays_into_the_cube_leave_it(
    kind: Kind, device: Device, count: int
) -> None:
    """From vertices, edges and faces of the cube, of which half are their middles, moved off as the integrator does."""
    mesh = cube(1, 1)
    rng = np.random.default_rng(17)
    own = rng.integers(len(mesh[1]), size=count)
    corners = mesh[0][mesh[1][own]]
    weights = rng.dirichlet(np.ones(3), count)
    weights[::3] = [1, 0, 0]
    weights[1::3] = np.stack([weights[1::3, 0], 1 - weights[1::3, 0], 0 * weights[1::3, 0]], 1)
    weights[1::6], weights[2::6] = [0.5, 0.5, 0], [1 / 3, 1 / 3, 1 / 3]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal *= np.sign((normal * corners.mean(1)).sum(1, keepdims=True))
    direction = np.float32(rng.normal(size=(count, 3)))
    outward = direction * np.sign((direction * normal).sum(1, keepdims=True))
    accel = Accel(*mesh, kind=kind, device=device)
    for away in (outward, -outward):
        rays = core.spawn_rays(corners.reshape(-1, 9), np.float32(weights[:, 1:]), np.float32(away))
        _, prim, _, _ = accel.closest(rays)
        assert (prim != own).all()
        # Off a vertex or an edge a ray may still pass into the cube, or out of it, through a neighbour.
        assert ((prim[2::3] >= 0) == (away is not outward)).all()


@every_device
@every_kind
def test_row_18_rays_that_start_on_split_planes_hit_as_by_brute_force(kind: Kind, device: Device) -> None:
    """A mesh of a grid's corners: planes and node bounds lie where its vertices do."""
    mesh = cube(6, 6)
    coordinates = np.unique(mesh[0])
    rng = np.random.default_rng(18)
    origin = rng.choice(coordinates, (4000, 3)) * rng.choice(np.float32([1, 1, 3]), (4000, 3))
    direction = rng.choice(np.float32([0.0, -0.0, 1.0, -1.0, 0.5]), (4000, 3))
    assert assert_same_hits(Accel(*mesh, kind=kind, device=device), mesh, rows(origin, direction)) > 500


def spawned(rng: np.random.Generator, count: int, far: bool, each: int = 100) -> tuple[F32, F32]:
    """Triangles (N, 9) with corners from 1e-8 to 1e8, or such ones far away, and rays (N, 8) that leave them, `each` of
    every one: from corners and elsewhere, half of them almost along its plane.
    """
    corners = 10.0 ** rng.uniform(-8, 8, (count, 3, 3)) * rng.choice([-1, 1], (count, 3, 3))
    if far:
        place = 10.0 ** rng.uniform(-4, 8, (count, 1, 1)) * rng.normal(size=(count, 1, 3))
        corners = place + 10.0 ** rng.uniform(-4, 4, (count, 1, 1)) * rng.normal(size=(count, 3, 3))
    corners = corners.astype(np.float32)
    exact = corners.astype(np.float64)
    normal = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    size = np.linalg.norm(normal, axis=1)
    corners, normal = corners[size > 1e-20], (normal[size > 1e-20].T / size[size > 1e-20]).T[:, None]
    count = len(corners)
    weights = rng.dirichlet(np.ones(3), (count, each))
    weights[:, : each // 5] = np.eye(3)[rng.integers(3, size=(count, each // 5))]
    direction = rng.normal(size=(count, each, 3))
    flat = direction - (direction * normal).sum(-1, keepdims=True) * normal
    lifted = 10.0 ** rng.uniform(-6, 0, (count, each // 2, 1)) * rng.choice([-1, 1], (count, each // 2, 1))
    direction[:, ::2] = flat[:, ::2] + normal * lifted
    triangles = np.repeat(corners.reshape(count, 9), each, axis=0)
    rays = core.spawn_rays(triangles, np.float32(weights[..., 1:].reshape(-1, 2)), np.float32(direction.reshape(-1, 3)))
    return triangles, rays


@pytest.mark.parametrize("count", [2000, pytest.param(1_000_000, marks=pytest.mark.full)])
@pytest.mark.parametrize("far", [False, True])
def test_row_19_rays_that_leave_triangles_by_their_error_bound_do_not_meet_them_again(far: bool, count: int) -> None:
    rng, again = np.random.default_rng(19), 0
    for _ in range(0, count, 2000):
        triangles, rays = spawned(rng, 2000, far)
        again += int(np.isfinite(core.test_triangles("watertight", rays, triangles)[:, 0]).sum())
    assert again == 0


@every_device
@every_kind
def test_row_21_a_degenerate_triangle_that_fooled_others_is_not_hit(kind: Kind, device: Device) -> None:
    x, z = -1113.45459, -56.2431908
    line = separate(np.array([[(x, -79.049614, z), (x, -87.0922699, z), (x, -79.2090149, z)]]))
    ray = rows(np.array([[-1081.47925, 99.9999542, 87.7701111]]), np.array([[-32.1072998, -183.355865, -144.607635]]),
               t_max=0.9999)  # fmt: skip
    assert not Accel(*line, kind=kind, device=device).any(ray).any()


@every_device
@every_kind
def test_row_22_rays_that_are_none_miss(kind: Kind, device: Device) -> None:
    accel = Accel(*icosphere(2), kind=kind, device=device)
    good = random_rays(1000, scale=0.2)
    for place in range(8):
        for value in (np.nan, np.inf, -np.inf):
            bad = good.copy()
            bad[:, place] = value
            if (place, value) in ((3, -np.inf), (7, np.inf)):
                continue  # an interval without end is one
            assert not accel.any(bad).any(), (place, value)
    still = good.copy()
    still[:, 4:7] = 0.0
    backwards = good.copy()
    backwards[:, 3], backwards[:, 7] = 5.0, 2.0
    for bad in (still, backwards):
        t, prim, _, _ = accel.closest(bad)
        assert (prim == -1).all() and (t == np.inf).all()
        spent = [sum(accel.count(rays)[part] for part in ("nodes", "primitives")) for rays in (bad, good)]
        assert spent[0] <= 2.5 * spent[1]


@every_device
@every_kind
def test_rows_23_to_26_bad_triangles_change_no_hit_on_good_ones(kind: Kind, device: Device) -> None:
    ball = icosphere(3)
    rng = np.random.default_rng(23)
    point = np.repeat(rng.normal(size=(1000, 1, 3)), 3, axis=1)
    line = point + np.array([0.0, 0.5, 1.0])[:, None] * rng.normal(size=(1000, 1, 3))
    odd = np.array([[(np.nan, 0, 0), (1, 0, 0), (0, 1, 0)], [(np.inf, 0, 0), (1, 0, 0), (0, 1, 0)],
                    [(3e38, 0, 0), (0, 3e38, 0), (0, 0, 3e38)], [(1e-40, 0, 0), (0, 1e-40, 0), (0, 0, 1e-40)]])  # fmt: skip
    extra = np.concatenate([point, line, odd]).astype(np.float32).reshape(-1, 3)
    count = len(ball[0])
    mesh = (
        np.concatenate([ball[0], extra]),
        np.concatenate([ball[1], np.arange(len(extra), dtype=np.uint32).reshape(-1, 3) + count, [[0, 0, 1]]]),
    )
    rays = np.concatenate([random_rays(2000), aimed_rays(ball, 2000)])
    alone, among = (
        Accel(*each, kind=kind, device=device).closest(rays) for each in (ball, (mesh[0], mesh[1].astype(np.uint32)))
    )
    for a, b in zip(alone, among, strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))


@every_device
@every_kind
def test_row_25_huge_triangles_are_hit_without_overflow(kind: Kind, device: Device) -> None:
    mesh = separate(np.array([[(-1e30, -1e30, 1e30), (1e30, -1e30, 1e30), (0, 1e30, 1e30)]]))
    t, prim, _, _ = Accel(*mesh, kind=kind, device=device).closest(rows(np.zeros((1, 3)), np.array([[0, 0, 1.0]])))
    assert (prim[0], t[0]) == (0, np.float32(1e30))


@every_device
@every_kind
@pytest.mark.parametrize("count", [1, 10_000])
def test_rows_31_and_32_identical_and_coplanar_triangles_cost_memory_in_proportion(
    kind: Kind, count: int, device: Device
) -> None:
    one = separate(np.array([[(-1, -1, 0), (1, -1, 0), (0, 1, 0)]]))
    same = (np.tile(one[0], (count, 1)), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))
    rng = np.random.default_rng(31)
    plane = separate(np.concatenate([rng.uniform(-1, 1, (count, 3, 2)), np.zeros((count, 3, 1))], axis=2))
    ray = rows(np.array([[0.1, 0.1, 1.0]]), np.array([[0, 0, -1.0]]))
    for mesh in (same, plane):
        accel = Accel(*mesh, kind=kind, device=device)
        # 100 bytes a triangle are what these structures take on soups; 64 kB are a grid's own cells.
        assert accel.stats["bytes"] <= 65536 + 400 * count
        assert_same_hits(accel, mesh, ray)
    assert Accel(*same, kind=kind, device=device).closest(ray)[1][0] == 0


@every_device
@every_kind
@pytest.mark.parametrize(
    ("ratio", "count"), [(0.5, 120), (0.9999, 20_000), pytest.param(0.9999, 100_000, marks=pytest.mark.full)]
)
def test_row_33_ever_smaller_triangles_make_no_endless_tree(
    kind: Kind, device: Device, ratio: float, count: int
) -> None:
    size = ratio ** np.arange(count)[:, None, None]
    mesh = separate(size * (np.array([1.0, 0.3, -0.2]) + 0.01 * np.random.default_rng(33).normal(size=(count, 3, 3))))
    accel = Accel(*mesh, kind=kind, device=device)
    assert accel.stats.get("depth", 0) <= 96
    assert assert_same_hits(accel, mesh, aimed_rays(mesh, 60)) >= 20


@every_device
@pytest.mark.parametrize("kind", ["BVH2", "BVH2_STACKLESS", "CWBVH", "KD_TREE", "HIERARCHICAL_GRID"])
def test_row_34_a_stadium_around_a_teapot_costs_its_rays_little(kind: Kind, device: Device) -> None:
    ball = closed_meshes.moved(icosphere(6), 0.01)
    stadium = soup(20_000, 0.01, seed=34)
    around = (np.concatenate([ball[0], stadium[0] * np.float32(500)]),
              np.concatenate([ball[1], stadium[1] + np.uint32(len(ball[0]))]))  # fmt: skip
    rng = np.random.default_rng(34)
    eye = np.float32([0.03, 0, 0])
    rays = rows(np.tile(eye, (2000, 1)), closed_meshes.targets(ball, rng, 2000, 3) - eye)
    alone, among = (Accel(*mesh, kind=kind, device=device).count(rays) for mesh in (ball, around))
    work = [counts["nodes"] + counts["primitives"] for counts in (alone, among)]
    assert work[1] <= 3 * work[0]
