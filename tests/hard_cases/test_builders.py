"""What structures cost where geometry is hard, and rays at more places and sizes. Numbers: the rows of the hard cases."""

from __future__ import annotations

import numpy as np
import pytest
from luch.accel import KINDS, Accel, Device, Kind
from support import closed_meshes
from support.accel_meshes import F32, Mesh, icosphere, rows, separate, soup
from support.asked import every_device, every_kind
from support.instances import Scene

TREES: list[Kind] = [kind for kind in KINDS if kind not in ("BRUTE_FORCE", "GRID")]
AT_ONCE = 50_000
# Rays a mesh; `build.py bench leaks` traces up to 1e8.
COUNTS = pytest.mark.parametrize("rays", [2000, pytest.param(1_000_000, marks=pytest.mark.full)])


def leaks_of(mesh: Mesh, kind: Kind, device: Device, seed: int, count: int) -> int:
    """Rays to vertices, edges and faces and of random directions that leave a closed mesh."""
    return leaks_through(Accel(*mesh, kind=kind, device=device), mesh, seed, count)


def leaks_through(accel: Accel, mesh: Mesh, seed: int, count: int = 2000) -> int:
    out = 0
    for number, rays in enumerate(("vertices", "edges", "faces", "random")):
        rng = np.random.default_rng([seed, number])
        for _ in range(0, count // 4, AT_ONCE):
            made = closed_meshes.RAYS[rays](mesh, rng, min(count // 4, AT_ONCE))
            _, prim, _, _ = accel.closest(made[np.abs(made[:, 4:7]).max(1) > 0])
            out += int((np.asarray(prim) < 0).sum())
    return out


@every_device
@every_kind
@COUNTS
def test_05_no_ray_leaves_a_ball_at_any_distance(rays: int, kind: Kind, device: Device) -> None:
    level = 2 if kind == "BRUTE_FORCE" else 5
    for power in range(3, 8):
        mesh = closed_meshes.moved(icosphere(level), 100.0, 10.0**power)
        assert leaks_of(mesh, kind, device, power, rays) == 0, f"1e{power}"


@every_device
@every_kind
@COUNTS
def test_06_no_ray_leaves_a_ball_of_any_size(rays: int, kind: Kind, device: Device) -> None:
    level = 2 if kind == "BRUTE_FORCE" else 4
    for power in range(-18, 19, 3):
        mesh = closed_meshes.moved(icosphere(level), 10.0**power)
        assert leaks_of(mesh, kind, device, power + 18, rays) == 0, f"1e{power}"


def work(accel: Accel, rays: F32) -> float:
    """Nodes and primitives a ray."""
    counts = accel.count(rays)
    return (counts["nodes"] + counts["primitives"]) / len(rays)


@every_device
@pytest.mark.parametrize(
    "kind", [kind if kind != "HIERARCHICAL_GRID" else pytest.param(kind, marks=pytest.mark.full) for kind in TREES]
)
def test_08_a_fan_of_a_hundred_times_the_slivers_costs_a_ray_twenty_times_as_much_at_most(
    kind: Kind, device: Device
) -> None:
    """The builders cut slivers (cpu/accel/slivers.h). The uniform grid cannot: 400 times."""
    rng = np.random.default_rng(8)
    directions, inside = rng.normal(size=(300, 3)), rng.normal(size=(300, 3))
    inside *= 0.3 * rng.random((300, 1)) ** (1 / 3) / np.linalg.norm(inside, axis=1, keepdims=True)
    few, many = (Accel(*closed_meshes.bipyramid(sides), kind=kind, device=device) for sides in (1000, 100_000))
    for origins in (np.zeros((300, 3)), inside):
        rays = rows(origins, directions)
        assert work(many, rays) <= 20 * work(few, rays)
    assert many.stats["bytes"] <= 450 * 200_000, "eight pieces a sliver"
    assert leaks_through(many, closed_meshes.bipyramid(100_000), 8) == 0


@every_kind
def test_08_slivers_in_pieces_are_hit_as_whole_ones(kind: Kind) -> None:
    mesh = closed_meshes.bipyramid(10_000)
    rng = np.random.default_rng(18)
    rays = rows(rng.uniform(-0.5, 0.5, (200, 3)), rng.normal(size=(200, 3)))
    accel, oracle = Accel(*mesh, kind=kind), Accel(*mesh, kind="BRUTE_FORCE")
    if kind in ("BVH2", "CWBVH"):
        assert accel.stats["references"] >= 2 * len(mesh[1])
    for ours, true in zip(accel.closest(rays), oracle.closest(rays), strict=True):
        assert np.array_equal(ours.view(np.uint32), true.view(np.uint32))
    assert np.array_equal(accel.any(rays), oracle.any(rays))


def test_08_what_is_no_sliver_stays_whole() -> None:
    """Few slivers, many triangles in a heap whose boxes they fill, slivers along an axis."""
    rng = np.random.default_rng(28)
    heap = separate(rng.uniform(-1, 1, (4000, 1, 3)) + 0.5 * rng.normal(size=(4000, 3, 3)))
    start = rng.uniform(-1, 1, (20_000, 1, 3))
    along = separate(start + np.array([(0, 0, 0), (1, 0, 0), (0.5, 1e-4, 1e-4)]))
    for mesh in (closed_meshes.bipyramid(500), heap, along):
        for kind in ("BVH2", "CWBVH"):
            assert Accel(*mesh, kind=kind).stats["references"] == len(mesh[1])


def test_08_what_is_cut_is_not_left_to_a_device_that_does_not_cut() -> None:
    for mesh, left in (closed_meshes.bipyramid(10_000), 0), (soup(20_000, 0.02), 1):
        trees = Scene([mesh], [(0, np.eye(3, 4), 63)]).trees(leave_from=1000)
        assert len(trees.left_groups()) == left


def copies(count: int) -> Mesh:
    one = separate(np.array([[(-1, -1, 0), (1, -1, 0), (0, 1, 0)]]))
    return np.tile(one[0], (count, 1)), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


@every_device
@every_kind
@pytest.mark.parametrize("count", [10_000, 100_000, pytest.param(1_000_000, marks=pytest.mark.full)])
def test_31_copies_of_one_triangle_cost_no_more_than_as_many_random_ones(
    count: int, kind: Kind, device: Device
) -> None:
    count //= 1000 if kind == "BRUTE_FORCE" else 1
    rng = np.random.default_rng(31)
    eye = np.column_stack([rng.uniform(-1, 1, (200, 2)), np.full(200, 5.0)])
    rays = rows(eye, rng.uniform(-0.5, 0.5, (200, 3)) - eye)
    same, random = (Accel(*mesh, kind=kind, device=device) for mesh in (copies(count), soup(count, 0.02)))
    assert work(same, rays) <= 3 * work(random, rays)
    assert same.stats["bytes"] <= 1.5 * random.stats["bytes"]
    assert (same.closest(rays)[1] <= 0).all(), "the first of them counts"


@every_device
@every_kind
@pytest.mark.parametrize("count", [100_000, pytest.param(1_000_000, marks=pytest.mark.full)])
def test_32_triangles_in_one_plane_cost_no_more_than_as_many_random_ones(
    count: int, kind: Kind, device: Device
) -> None:
    count //= 1000 if kind == "BRUTE_FORCE" else 1
    spread = soup(count, 6.3 / np.sqrt(count))  # as many layers at any count, some thirty
    flat = (spread[0] * np.float32([1, 1, 0]), spread[1])
    rng = np.random.default_rng(32)
    eye = np.column_stack([rng.uniform(-1, 1, (200, 2)), np.full(200, 5.0)])
    rays = rows(eye, np.column_stack([rng.uniform(-1, 1, (200, 2)), np.zeros(200)]) - eye)
    plane, random = (Accel(*mesh, kind=kind, device=device) for mesh in (flat, spread))
    spent = [work(accel, rays) for accel in (plane, random)]
    taken = [accel.stats["bytes"] + accel.stats.get("primitive_bytes", 0) for accel in (plane, random)]
    print(f"{kind}, {count}: {spent[0] / spent[1]:.2f} times the work, {taken[0] / taken[1]:.2f} the memory")
    assert spent[0] <= 3 * spent[1]
    assert taken[0] <= 1.5 * taken[1]


def test_31_copies_are_counted_and_change_no_hit() -> None:
    mesh = soup(20)
    points, triangles = mesh
    rng = np.random.default_rng(1)
    often = (points, np.concatenate([triangles, *(triangles[rng.permutation(20)] for _ in range(9))]))
    whole, among = Accel(*mesh), Accel(*often)
    assert among.stats["duplicate_primitives"] == 180 and among.stats["triangles"] == 20
    rays = rows(rng.uniform(-2, 2, (2000, 3)), rng.normal(size=(2000, 3)))
    for a, b in zip(whole.closest(rays), among.closest(rays), strict=True):
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32))


def test_31_a_copy_that_is_not_as_transparent_stays() -> None:
    points, triangles = copies(3)
    accel = Accel(points, triangles, may_be_transparent=[True, True, False])
    ray = rows(np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]]))
    assert accel.stats["duplicate_primitives"] == 1
    assert accel.stats["triangles"] == 2 and accel.closest(ray)[1][0] == 0


@every_device
@pytest.mark.parametrize("kind", TREES)
@pytest.mark.parametrize("distance", [0.0, 1e5])
def test_34_a_stadium_around_a_teapot_costs_its_rays_little_anywhere(
    kind: Kind, distance: float, device: Device
) -> None:
    ball = closed_meshes.moved(icosphere(6), 0.01)
    around = soup(20_000, 0.01, seed=34)[0] * np.float32(500)
    # Far away the ball has the digits of its place: it is what they leave of it.
    shift = np.float32([distance, 0.0, 0.0])
    many = separate(np.concatenate([ball[0][ball[1]], around.reshape(-1, 3, 3)]) + shift)
    alone = separate(ball[0][ball[1]] + shift)
    rng = np.random.default_rng(34)
    eye = np.float32([0.03, 0, 0])
    rays = rows(np.tile(eye + shift, (500, 1)), closed_meshes.targets(ball, rng, 500, 3) - eye)
    among, by_itself = (Accel(*mesh, kind=kind, device=device) for mesh in (many, alone))
    assert work(among, rays) <= 3.0 * max(work(by_itself, rays), 2.0)
