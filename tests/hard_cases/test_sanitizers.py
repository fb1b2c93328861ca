"""The device's own headers under AddressSanitizer and UBSan, with what they must not stumble over.

The core itself is watched by `build.py test --sanitize` (tests/native and what stands in its list), kernels by
compute-sanitizer on a GPU.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from luch.accel import Accel
from support.accel_meshes import F32, icosphere, rows, separate

ROOT = Path(__file__).resolve().parents[2]
# Reads triangles and rays, writes each ray's hit. "beyond" as an argument: one triangle more than there are.
PROGRAM = """
#include "luch/accel/brute_force.h"
#include <cstdio>
#include <cstring>
using namespace luch;
template <Precision P>
RefHit closest(const BruteForce& list, const Primitives& all, const Ray& ray) {
    RefHit best = {ray.t_max, NONE, 0.0f, 0.0f};
    NoCounters none;
    if (ray_is_valid(ray)) {
        closest_hit<P>(list, all, ray, &best, none);
        any_hit<P>(list, all, ray, none);
    }
    return best;
}
int main(int count, char** words) {
    u32 sizes[2];
    if (std::fread(sizes, 4, 2, stdin) != 2) return 2;
    float *corners = new float[9 * sizes[0]], *rays = new float[8 * sizes[1]];
    if (std::fread(corners, 36, sizes[0], stdin) != sizes[0]) return 2;
    if (std::fread(rays, 32, sizes[1], stdin) != sizes[1]) return 2;
    u32* refs = new u32[sizes[0] + 1];
    u32 kept = 0;
    for (u32 ref = 0; ref < sizes[0]; ++ref) {
        Vec3 p[3];
        std::memcpy(p, corners + 9 * ref, sizeof(p));
        if (triangle_can_be_traced(p[0], p[1], p[2])) refs[kept++] = ref;
    }
    if (count > 1 && !std::strcmp(words[1], "beyond")) refs[kept++] = sizes[0];
    Primitives all = {};
    all.corners = corners, all.triangle_count = sizes[0] + 1;
    BruteForce list = {refs, kept};
    for (u32 i = 0; i < sizes[1]; ++i) {
        Ray ray;
        std::memcpy(&ray, rays + 8 * i, sizeof(ray));
        if (ray.t_min < 0.0f) ray.t_min = 0.0f;  // as the core's door does
        RefHit hit = closest<Precision::WATERTIGHT>(list, all, ray);
        std::fwrite(&hit.ref, 4, 1, stdout);
    }
    delete[] corners, delete[] rays, delete[] refs;
}
"""


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("watched")
    source, program = folder / "watched.cpp", folder / "watched"
    source.write_text(PROGRAM, encoding="ascii")
    flags = [
        "-std=gnu++20",
        "-ffp-contract=off",
        "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
        "-DLUCH_PLAN_CURVES=0",
    ]
    subprocess.run([os.environ.get("CXX", "c++"), *flags, "-I", str(ROOT / "native/include"), str(source), "-o", str(program)],
                   check=True)  # fmt: skip
    return program


def hostile_triangles() -> F32:
    """A ball, and between its triangles every kind that rows 23 to 26 and 31 to 33 speak of. (T, 3, 3)."""
    points, triangles = icosphere(1)
    rng = np.random.default_rng(65)
    some = rng.normal(size=(8, 3, 3))
    line = some.copy()
    line[:, 2] = 0.5 * (line[:, 0] + line[:, 1])
    broken = some.copy()
    for k, value in enumerate((np.nan, np.inf, -np.inf, 3e38, -3e38, 1e30, 1e-40, 0.0)):
        broken[k, k % 3, k % 3] = value
    parts = [
        points[triangles],
        np.repeat(some[:, :1], 3, axis=1),
        line,
        broken,
        some * 1e-40,
        some * 1e30,
        some[:1].repeat(8, 0),
    ]
    return np.concatenate(parts).astype(np.float32)


def hostile_rays() -> F32:
    """Ordinary ones; along axes with zeros of either sign; rows 17, 18 and 22."""
    rng = np.random.default_rng(66)
    direction = rng.normal(size=(600, 3))
    direction[:200] = np.eye(3)[rng.integers(3, size=200)] * rng.choice([-1.0, 1.0, -0.0], size=(200, 1))
    origin = rng.uniform(-0.5, 0.5, (600, 3))
    origin[200:400] = icosphere(1)[0][rng.integers(len(icosphere(1)[0]), size=200)]
    made = rows(origin, direction)
    hostile = (np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, 0.0)
    for k in range(400, 600):
        made[k, rng.integers(8)] = hostile[k % len(hostile)]
    return made


def run(program: Path, *words: str) -> subprocess.CompletedProcess[bytes]:
    triangles, rays = hostile_triangles(), hostile_rays()
    given = np.array([len(triangles), len(rays)], np.uint32).tobytes() + triangles.tobytes() + rays.tobytes()
    quiet = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}  # looking for leaks needs rights that containers lack
    return subprocess.run([program, *words], input=given, capture_output=True, check=False, env=quiet)


def test_65_hostile_triangles_and_rays_raise_no_report_and_are_hit_alike(watched: Path) -> None:
    triangles, rays = hostile_triangles(), hostile_rays()
    done = run(watched)
    assert done.returncode == 0, done.stderr.decode()
    assert not done.stderr
    found = np.frombuffer(done.stdout, np.int32)
    _, prim, _, _ = Accel(*separate(triangles), kind="BVH").closest(rays)
    assert np.array_equal(found, prim) and (prim >= 0).sum() > 300


def test_65_a_read_beyond_the_end_is_reported(watched: Path) -> None:
    done = run(watched, "beyond")
    assert done.returncode != 0 and b"AddressSanitizer: heap-buffer-overflow" in done.stderr
