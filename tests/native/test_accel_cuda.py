"""On CUDA every structure gives the CPU's brute-force hits, bit for bit.

Each test runs twice: on a GPU (marker `cuda`; tests/bench/records tells when last), and anywhere with the kernels'
source run by fibers on the CPU, which proves their logic and the Python around them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch.accel import Accel
from luch.cuda import compiler, device
from support import cuda_on_cpu
from support.accel_meshes import HARD_MESHES, aimed_rays, icosphere, random_rays, rows, soup
from support.cuda_on_cpu import FIBERS, GPU
from support.hard_rays import assert_same_bits, device_rays

from buildtools.kernels import Unit, faults

KINDS = list(compiler.table()["modules"])


@pytest.mark.parametrize(
    ("kind", "precision"), [*((k, "WATERTIGHT") for k in KINDS), ("BVH2", "DOUBLE"), ("CWBVH", "DOUBLE")]
)
def test_spheres_transparency_and_bad_rays_are_as_on_the_cpu(place: str, kind: Any, precision: Any) -> None:
    points, triangles = soup(40)
    rng = np.random.default_rng(4)
    spheres = np.concatenate([rng.uniform(-1, 1, (30, 3)), rng.uniform(-0.02, 0.2, (30, 1))], 1).astype(np.float32)
    flags = rng.random(70) < 0.5
    points[5], triangles[7, 1] = np.nan, 1_000_000
    rays = device_rays((np.nan_to_num(points), soup(40)[1]), place)
    rays[3, 4:7], rays[4, 0], rays[5, 7], rays[6, 3], rays[8, 3] = 0, np.nan, -1, np.nan, -5
    options = {"spheres": spheres, "may_be_transparent": flags, "precision": precision}
    oracle = Accel(points, triangles, kind="BRUTE_FORCE", **options)  # type: ignore[arg-type]
    ours = Accel(points, triangles, kind=kind, device="CUDA", **options)  # type: ignore[arg-type]
    assert_same_bits(ours.closest(rays), oracle.closest(rays))
    assert np.array_equal(ours.blocked(rays) != 0, oracle.blocked(rays) != 0)
    opaque = Accel(points, triangles, kind=kind, device="CUDA", spheres=spheres)
    assert set(np.unique(opaque.blocked(rays))) == {0, 1}


@pytest.mark.parametrize("kernel", ["closest_tiled", "closest_reduced"])
@pytest.mark.parametrize("count", [1, 127, 300])
def test_each_mapping_of_brute_force_gives_the_same_hits(place: str, kernel: str, count: int) -> None:
    mesh = soup(count)
    spheres = np.array([[0, 0, 0, 0.4], [0.2, 0, 0, 0.4], [0, 0, 0, 0.4]], np.float32)
    rays = device_rays(mesh, place)[: None if place == GPU else 150]
    oracle = Accel(*mesh, kind="BRUTE_FORCE", spheres=spheres)
    ours = Accel(*mesh, kind="BRUTE_FORCE", spheres=spheres, device="CUDA").on_device
    assert_same_bits(ours.closest(rays, "WATERTIGHT", False, kernel)[:4], oracle.closest(rays))


@pytest.mark.parametrize(
    ("kind", "kernel"),
    [("BVH2_STACKLESS", "closest_together"), ("CWBVH", "closest_simple"), ("KD_TREE", "closest_full")],
)
@pytest.mark.parametrize("name", ["soup", "needles", "identical"])
def test_other_kernels_of_a_structure_give_the_same_hits(place: str, kind: Any, kernel: str, name: str) -> None:
    mesh = HARD_MESHES[name]
    rays = device_rays(mesh, place)
    ours = Accel(*mesh, kind=kind, device="CUDA").on_device
    oracle = Accel(*mesh, kind="BRUTE_FORCE")
    assert_same_bits(ours.closest(rays, "WATERTIGHT", False, kernel)[:4], oracle.closest(rays))


@pytest.mark.parametrize("kind", KINDS)
def test_empty_mesh_and_no_rays_are_answered(place: str, kind: Any) -> None:
    nothing = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)
    ours = Accel(*nothing, kind=kind, device="CUDA")
    assert (ours.closest(random_rays(10))[1] == -1).all()
    assert not ours.any(random_rays(10)).any()
    assert len(Accel(*soup(5), kind=kind, device="CUDA").closest(np.zeros((0, 8), np.float32))[0]) == 0


def test_kd_tree_starts_again_where_its_short_stack_ran_out(place: str) -> None:
    mesh = HARD_MESHES["size 2^-i"]
    rays = rows(np.zeros(3), np.random.default_rng(5).normal(size=(60, 3)))  # out of the deepest cell
    ours, cpu = Accel(*mesh, kind="KD_TREE", device="CUDA"), Accel(*mesh, kind="KD_TREE")
    assert_same_bits(ours.closest(rays), cpu.closest(rays))
    assert np.array_equal(ours.any(rays), cpu.any(rays))
    assert ours.count(rays)["nodes"] > 1.2 * cpu.count(rays)["nodes"]  # 1.57: it did run out


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "CWBVH"])
def test_device_counts_the_work_that_the_cpu_counts(place: str, kind: Any) -> None:
    mesh = soup(100)
    rays = random_rays(5000 if place == GPU else 100)
    ours, cpu = Accel(*mesh, kind=kind, device="CUDA"), Accel(*mesh, kind=kind)
    assert ours.count(rays) == cpu.count(rays)
    assert ours.count(rays, any_hit=True) == cpu.count(rays, any_hit=True)
    assert ours.count(rays)["primitives"] > 0


@pytest.mark.parametrize("scale", [1e-18, 1e18])
@pytest.mark.parametrize("kind", KINDS)
def test_hits_are_bit_equal_at_any_scale(place: str, kind: Any, scale: float) -> None:
    points, triangles = soup(100)
    mesh = ((points * np.float64(scale)).astype(np.float32), triangles)
    rays = aimed_rays(mesh, 10_000 if place == GPU else 100)
    assert_same_bits(
        Accel(*mesh, kind=kind, device="CUDA").closest(rays), Accel(*mesh, kind="BRUTE_FORCE").closest(rays)
    )


BUILT = ("soup", "slivers", "identical", "duplicates", "coplanar", "size 2^-i", "sphere")


@pytest.mark.parametrize("name", BUILT)
def test_tree_built_on_the_device_gives_brute_force_hits(place: str, name: str) -> None:
    mesh = HARD_MESHES[name]
    rays = device_rays(mesh, place)
    ours = Accel(*mesh, kind="CWBVH", quality="FAST", device="CUDA")
    assert ours.stats["built_on_device"]
    assert ours.stats["references"] == ours.stats["primitives"] > 100
    assert_same_bits(ours.closest(rays), Accel(*mesh, kind="BRUTE_FORCE").closest(rays))
    good = Accel(*mesh, kind="CWBVH", device="CUDA")
    if name != "identical":  # of copies the host's builders keep one, the device's keeps all
        assert ours.count(rays)["boxes"] <= 2.5 * good.count(rays)["boxes"]


def test_a_flat_scene_is_not_cut_along_its_short_axis_first(place: str) -> None:
    """Twelve balls on a wide floor: with a scale for each axis rays visited 1.4 times as many boxes."""
    ball, sides = icosphere(2)
    places = np.stack(np.meshgrid(2.5 * np.arange(4.0), 2.5 * np.arange(3.0), [1.0]), -1).reshape(-1, 3)
    floor = np.array([[-40, -40, 0], [40, -40, 0], [40, 40, 0], [-40, 40, 0]])
    points = np.concatenate([*(ball + at for at in places), floor]).astype(np.float32)
    first = len(places) * len(ball)
    triangles = np.concatenate(
        [
            *(sides + len(ball) * k for k in range(len(places))),
            [[first, first + 1, first + 2], [first, first + 2, first + 3]],
        ]
    )
    rays = aimed_rays((points[:first], triangles[:-2].astype(np.uint32)), 400)
    fast, good = (
        Accel(points, triangles.astype(np.uint32), kind="CWBVH", quality=quality, device="CUDA").count(rays)
        for quality in ("FAST", "NORMAL")
    )
    assert fast["boxes"] <= 1.2 * good["boxes"]


def test_builder_on_the_device_drops_what_the_cpu_drops(place: str) -> None:
    points, triangles = soup(200)
    points[5], triangles[7, 1] = np.nan, 1_000_000
    ours = Accel(points, triangles, kind="CWBVH", quality="FAST", device="CUDA")
    cpu = Accel(points, triangles, kind="CWBVH")
    assert (ours.stats["primitives"], ours.stats["dropped"]) == (cpu.stats["primitives"], cpu.stats["dropped"])
    rays = device_rays(soup(200), place)
    assert_same_bits(ours.closest(rays), cpu.closest(rays))


@pytest.mark.cuda
def test_arrays_on_the_gpu_are_answered_there() -> None:
    import cupy

    accel = Accel(*soup(50), kind="BRUTE_FORCE", device="CUDA")
    rays = random_rays(1000)
    there = accel.closest(cupy.asarray(rays))
    assert all(isinstance(array, cupy.ndarray) for array in there)
    assert_same_bits([array.get() for array in there], accel.closest(rays))
    assert isinstance(accel.any(cupy.asarray(rays)), cupy.ndarray)
    with pytest.raises(ValueError, match="lies on a GPU"):
        Accel(*soup(50)).closest(cupy.asarray(rays))


def test_missing_cupy_is_told_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cupy", None)
    cuda_on_cpu.forget()
    with pytest.raises(device.DeviceError, match="pip install cupy"):
        Accel(*soup(3), kind="BRUTE_FORCE", device="CUDA")
    cuda_on_cpu.forget()


def test_key_of_a_kernel_covers_headers_and_flags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = compiler.ahead_name("BRUTE_FORCE", "WATERTIGHT", 90)
    assert before != compiler.ahead_name("BRUTE_FORCE", "DOUBLE", 90)
    assert before != compiler.ahead_name("BRUTE_FORCE", "WATERTIGHT", 80)
    header = tmp_path / "include" / "luch" / "new.h"
    header.parent.mkdir(parents=True)
    header.write_text("// changed")
    folders = compiler.source_folders()
    monkeypatch.setattr(compiler, "source_folders", lambda: (*folders, tmp_path / "include"))
    compiler._sources_hash.cache_clear()
    assert compiler.ahead_name("BRUTE_FORCE", "WATERTIGHT", 90) != before
    compiler._sources_hash.cache_clear()


def test_rays_of_a_wrong_shape_raise_one_clear_error(place: str) -> None:
    with pytest.raises(ValueError, match=r"rays has shape \(4, 6\)"):
        Accel(*soup(3), kind="BRUTE_FORCE", device="CUDA").closest(rows(np.zeros((4, 3)), np.ones((4, 3)))[:, :6])


@pytest.mark.parametrize(
    ("precision", "line", "wrong"),
    [
        ("FAST", "mul.f64 %fd1", True), ("FAST", "fma.rn.ftz.f32 %f1", False), ("WATERTIGHT", "mul.rn.f64 %fd1", False),
        ("WATERTIGHT", "fma.rn.f32 %f1", True), ("WATERTIGHT", "fma.rn.f64 %fd1", True),
        ("DOUBLE", "add.ftz.f32 %f1", True), ("DOUBLE", "add.rn.f32 %f1", False),
    ],
)  # fmt: skip
def test_gate_sees_instructions_that_a_precision_must_not_have(precision: str, line: str, wrong: bool) -> None:
    assert bool(faults(Unit("BVH2", precision), f"\t{line}, %x;\n")) == wrong


def test_kernels_compiled_ahead_of_time_are_taken_first(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Found under the name that `build.py build --cuda` gives them; another architecture's are not."""

    def compiled(module: str, precision: str, architecture: int, programs: str, defines: Any) -> bytes:
        raise LookupError(f"{module} {precision} {architecture} would be compiled on first use")

    mesh, rays = soup(20), random_rays(30)
    with cuda_on_cpu.standing_in(tmp_path):
        monkeypatch.setattr(compiler, "compiled", compiled)
        ours = Accel(*mesh, kind="BVH2", device="CUDA")
        folders = list(compiler.source_folders())
        library = cuda_on_cpu.compile_module(compiler.source_of("BVH2"), "WATERTIGHT", tmp_path, folders)
        (tmp_path / compiler.ahead_name("BVH2", "WATERTIGHT", 80)).write_text(library)
        with pytest.raises(LookupError, match="BVH2 WATERTIGHT 90"):
            ours.closest(rays)
        (tmp_path / compiler.ahead_name("BVH2", "WATERTIGHT", 90)).write_text(library)
        assert_same_bits(ours.closest(rays), Accel(*mesh).closest(rays))
        monkeypatch.undo()


def test_an_architecture_that_the_build_did_not_know_takes_ptx(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(compiler, "AHEAD", tmp_path)
    assert compiler.ahead("CWBVH", "WATERTIGHT", 130) is None
    (tmp_path / compiler.ahead_name("CWBVH", "WATERTIGHT", 0)).write_bytes(b"ptx")
    assert compiler.ahead("CWBVH", "WATERTIGHT", 130) == b"ptx"
    assert compiler.ahead("CWBVH", "DOUBLE", 130) is None
    (tmp_path / compiler.ahead_name("CWBVH", "WATERTIGHT", 80)).write_bytes(b"cubin")
    assert [compiler.ahead("CWBVH", "WATERTIGHT", a) for a in (80, 86, 89)] == [b"cubin"] * 3
    assert [compiler.ahead("CWBVH", "WATERTIGHT", a) for a in (75, 90)] == [b"ptx"] * 2


@pytest.mark.parametrize("precision", ["WATERTIGHT", "FAST"], ids="fibers-{}".format)
def test_lanes_of_the_wide_tree_keep_out_of_each_others_shared_memory(tmp_path: Path, precision: Any) -> None:
    """With every thread's arrays apart the hits are the same: no thread reads what another wrote, none can race."""
    mesh = HARD_MESHES["soup"]
    rays = device_rays(mesh, FIBERS)
    cpu = Accel(*mesh, kind="CWBVH", precision=precision)
    with cuda_on_cpu.standing_in(tmp_path, shares_memory=False):
        ours = Accel(*mesh, kind="CWBVH", precision=precision, device="CUDA")
        assert_same_bits(ours.closest(rays), cpu.closest(rays))
        assert np.array_equal(ours.any(rays), cpu.any(rays))
