"""The figures of the hard cases: where the best systems stand, and Luch beside them.

  build.py bench hard-cases [--device cuda] [--long] [--only rays,rooms]

Every figure is computed by the functions that the tests of tests/hard_cases bound (tests/support/hard_*.py), with more
rays: 1e6 a structure, or 1e8 with --long. Prints the table with its goals, then FAST, WATERTIGHT and DOUBLE: rays a
second beside misses. Writes tests/bench/records/hard-cases-DEVICE.json, kept in the repository: a row of it is replaced when
it is measured anew, with the number of rays that it comes from.

Figures of the others were measured once, on one machine: Blender 5.2.3's Cycles on the CPU, Mitsuba 3.9.1, Embree 4.4
ROBUST. Case 65, by hand: `build.py test --sanitize`; on a GPU `compute-sanitizer --tool memcheck .venv/bin/python -m
pytest -m cuda tests/hard_cases`.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "native"), str(ROOT / "tests")]

import numpy as np  # noqa: E402
from luch.accel import KINDS, PRECISIONS, Accel  # noqa: E402
from luch.scene import Camera, Mesh  # noqa: E402
from support import accel_meshes, closed_meshes  # noqa: E402
from support.checkout import commit  # noqa: E402
from support.endings import LATE_STAGES, STAGES, break_stages, cancel, interrupt, veils  # noqa: E402
from support.frames import frame_growth  # noqa: E402
from support.hard_furnace import closed_glass_energy, closure_energy, plane_energy  # noqa: E402
from support.hard_geometry import edge_energy, far_plane, leak, room_scene, stack, sun  # noqa: E402
from support.hard_lights import glass_against_nothing  # noqa: E402
from support.hard_scenes import at, diffuse, glass, glow, looking, mesh_of, mirror, picture, scene_of  # noqa: E402

TRACED = [kind for kind in KINDS if kind != "BRUTE_FORCE"]
ROUGHNESS = (0.0, 0.05, 0.2, 0.5, 0.8, 1.0)


@dataclass
class Figure:
    """A row of the table. ours: as people read it; good: at its goal."""

    quantity: str
    cycles: str
    mitsuba: str
    embree: str
    goal: str
    ours: str
    good: bool
    note: str = ""


@dataclass
class Options:
    device: str
    rays: int


def misses(mesh: closed_meshes.Mesh, kind: str, device: str, rays: str, count: int, **more: Any) -> tuple[int, int]:
    """Rays that leave a closed mesh, and rays traced."""
    accel = Accel(*mesh, kind=kind, device=device, **more)
    out = traced = 0
    rng = np.random.default_rng([7, *map(ord, rays)])
    while traced < count:
        made = closed_meshes.RAYS[rays](mesh, rng, min(count - traced, closed_meshes.RAYS_AT_ONCE))
        _, prim, _, _ = accel.closest(made)
        out += int((np.asarray(prim) < 0).sum())
        traced += len(made)
    return out, traced


def missed(o: Options, mesh: closed_meshes.Mesh, rays: str) -> tuple[str, bool]:
    """Over every structure."""
    found = {kind: misses(mesh, kind, o.device, rays, o.rays) for kind in TRACED}
    out, traced = (sum(pair[k] for pair in found.values()) for k in (0, 1))
    named = ", ".join(f"{kind} {pair[0]}" for kind, pair in found.items() if pair[0])
    return f"{out} of {traced:.0e} ({len(TRACED)} structures{', ' + named if named else ''})", out == 0


def ray_figures(o: Options) -> Iterator[Figure]:
    ours, good = missed(o, closed_meshes.BALL, "edges")
    yield Figure("misses in 1e8 edge rays, closed mesh R = 1", "0", "2.6e6", "0", "0", ours, good)
    ours, good = missed(o, closed_meshes.BALL, "vertices")
    yield Figure("misses in 1e8 vertex rays", "5.8e5", "5.6e6", "584,143", "0", ours, good)
    fewer = Options(o.device, o.rays // 4)
    places = [missed(fewer, closed_meshes.moved(closed_meshes.BALL, 100.0, d), "edges") for d in (1e5, 1e6, 1e7)]
    yield Figure("misses in 1e8 edge rays at 1e5 / 1e6 / 1e7, R = 100", "as Embree", "", "200 / 1,500 / 11,500", "0",
                 " / ".join(p[0].split(" (")[0] for p in places), all(p[1] for p in places))  # fmt: skip
    sizes = [power for power in range(-18, 19, 3)
             if all(misses(closed_meshes.moved(accel_meshes.icosphere(4), 10.0**power), kind, o.device, "edges",
                           max(2000, o.rays // 100))[0] == 0 for kind in TRACED)]  # fmt: skip
    whole = sizes == list(range(min(sizes), max(sizes) + 1, 3)) if sizes else False
    yield Figure("scale at which rays still hit", "", "", "1e-15..1e12", "1e-15..1e15",
                 f"1e{min(sizes)}..1e{max(sizes)}" if whole else f"{sizes}", whole and sizes[0] <= -15 and sizes[-1] >= 15)  # fmt: skip


def room_figures(o: Options) -> Iterator[Figure]:
    made = [leak(room_scene(d, mode, 0.8, size=64, samples=64, device=o.device))
            for mode in ("object", "vertices") for d in (1e3, 1e5, 1e6, 1e7)]  # fmt: skip
    shown = [" / ".join(f"{x:.0e}" if x else "0" for x in part) for part in (made[:4], made[4:])]
    yield Figure("light leaking into a closed room at 1e3 / 1e5 / 1e6 / 1e7 (placed there)",
                 "1.2e-5 / 8.7e-4 / .055 / .76", "8.8e-5 / 7.7e-3 / .81 / .88", "", "<= 1e-7 each", shown[0],
                 max(made[:4]) <= 1e-7)  # fmt: skip
    yield Figure("the same, vertices that far from their object", "1.2e-5 / 8.7e-4 / .055 / .74", "", "",
                 "<= 1e-6 to 1e5", shown[1], max(made[4:6]) <= 1e-6)  # fmt: skip
    wrong = max(far_plane(d, 1e6, tilt, sun_at, samples=4, device=o.device)
                for d in (1.0, 1e3, 1e6) for tilt in (0.0, 33.0) for sun_at in (60.0, 1.0))  # fmt: skip
    yield Figure("wrong pixels, far plane at 1e6", "up to 92 %", "up to 100 %", "", "0", f"{wrong:.1%}", wrong == 0.0)
    one, two = (stack(n, size=(32, 32), samples=16, device=o.device) for n in (1, 2))
    off = float(np.abs(two / one - 1.0).max())
    yield Figure("two coincident quads", "black (-100 %)", "+.03 %", "", "<= .5 %", f"{off:.2%}", off <= 5e-3)
    mean, worst = edge_energy(1e4, glass(), size=64, samples=64, device=o.device)
    yield Figure("glass, energy on inner edges of a 1e4 m quad", "-3.4 % (pixels -75 %)", "0", "", "<= 1e-4",
                 f"{mean:.1e} (pixels {worst:.1e})", mean <= 1e-4)  # fmt: skip


def furnace_figures(o: Options) -> Iterator[Figure]:
    energies = [plane_energy(m, a, 128, device=o.device) for a in (0.0, 60.0, 85.0)
                for m in (diffuse(), *(mirror(r) for r in ROUGHNESS))]  # fmt: skip
    off = max(abs(e - 1.0) for e in energies)
    yield Figure("furnace, diffuse and multiple-scatter metal to 85 degrees", "1.4e-3", ".69", "",
                 "<= 2e-3, never above 1.002", f"{off:.1e} (most {max(energies):.4f})", off <= 2e-3)  # fmt: skip
    white = {r: [closure_energy("principled", {"base_color": 1.0, "roughness": r}, a) - 1.0 for a in (0.0, 60.0, 85.0)]
             for r in ROUGHNESS[1:]}  # fmt: skip
    low, high = min(map(min, white.values())), max(map(max, white.values()))
    at_worst = max(white, key=lambda r: max(map(abs, white[r])))
    yield Figure("furnace, Principled dielectric to 85 degrees", "-1.0..+.9 %", "+1.7..+59 %", "", "<= 1 %",
                 f"{low:+.1%}..{high:+.1%}", max(-low, high) <= 0.01,
                 f"largest at roughness {at_worst}: the layering is Blender's estimate of what lies under a layer")  # fmt: skip
    closed = [closed_glass_energy(r, 256, device=o.device) - 1.0 for r in (0.2, 0.5, 1.0)]
    yield Figure("closed rough glass, roughness .2 / .5 / 1", "-.1 / -1.0 / -1.9 %", "", "", "<= .2 / .5 / 1 %",
                 " / ".join(f"{e:+.2%}" for e in closed),
                 all(abs(e) <= g for e, g in zip(closed, (2e-3, 5e-3, 1e-2), strict=True)))  # fmt: skip
    rms = glass_against_nothing(1.0001, 0.3, samples=256, size=(16, 16), device=o.device)
    yield Figure("glass of IOR 1.0001 against nothing, roughness .3, rms", ".0152", "", "", "<= 3e-3, continuous",
                 f"{rms:.1e}", rms <= 3e-3)  # fmt: skip


def empty_scene(strength: float, samples: int, device: str) -> Any:
    return scene_of([], [], camera=Camera(matrix=at((0, 0, 0))), world=strength, samples=samples, size=(2, 2),
                    device=device)  # fmt: skip


def film_figures(o: Options) -> Iterator[Figure]:
    off = max(abs(float(picture(empty_scene(s, 65536, o.device)).astype(np.float64).mean()) / float(np.float32(s)) - 1.0)
              for s in (0.1, 1e4))  # fmt: skip
    yield Figure("sum of 65,536 equal samples", "6.2e-4", "6.2e-4", "", "<= 1e-6", f"{off:.0e}", off <= 1e-6)


def lit_ball(emitter: Mesh | None, device: str) -> float:
    ball = mesh_of("Ball", accel_meshes.icosphere(3))
    camera = Camera(kind="ORTHO", matrix=looking((0.1, 0.2, 9.0), (0.1, 0.2, 0.0)), ortho_scale=4.0)
    meshes = [ball] if emitter is None else [ball, emitter]
    return float(picture(scene_of(meshes, [diffuse(0.8), glow()], camera=camera, world=0.2, lights=[sun(50.0)],
                                  samples=64, device=device)).mean())  # fmt: skip


def stress_figures(o: Options) -> Iterator[Figure]:
    count, rng = 100_000, np.random.default_rng(31)
    one = accel_meshes.separate(np.array([[(-1, -1, 0), (1, -1, 0), (0, 1, 0)]]))
    same = (np.tile(one[0], (count, 1)), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))
    eye = np.column_stack([rng.uniform(-1, 1, (20_000, 2)), np.full(20_000, 5.0)])
    rays = accel_meshes.rows(eye, rng.uniform(-0.5, 0.5, (20_000, 3)) - eye)
    ratios = {}
    for kind in TRACED:
        Accel(*accel_meshes.soup(10), kind=kind, device=o.device).closest(rays[:1])  # a device loads its kernels once
        seconds = []
        for mesh in (same, accel_meshes.soup(count, 0.02)):
            start = time.perf_counter()
            Accel(*mesh, kind=kind, device=o.device).closest(rays)
            seconds.append(time.perf_counter() - start)
        ratios[kind] = seconds[0] / seconds[1]
    worst = max(ratios, key=lambda kind: ratios[kind])
    yield Figure("1e5 identical triangles against 1e5 random ones, time", "> 500 s against .26 s", "", "", "<= 3x",
                 f"{ratios[worst]:.2f}x ({worst})", ratios[worst] <= 3.0)  # fmt: skip
    alone = lit_ball(None, o.device)
    far = accel_meshes.separate(np.array([[(1e30, -1e30, 1e30), (1e30, 1e30, 1e30), (1e30, 0, -1e30)]]))
    broken = accel_meshes.separate(np.full((1, 3, 3), np.nan))
    lost = max(1.0 - lit_ball(mesh_of("Emitter", mesh), o.device) / alone for mesh in (far, broken))
    yield Figure(
        "scene light lost to one broken emitter", "-28.6 %", "0", "", "<= 1 %", f"{max(lost, 0.0):.2%}", lost <= 0.01
    )
    scene = room_scene(0.0, "object", 0.8, size=32, samples=2, device=o.device)
    growth = frame_growth(scene)
    yield Figure("memory growth over 100 frames, MiB a frame", ".03", "", "", "<= .05", f"{growth:.3f}", growth <= 0.05)


def ending_figures(o: Options) -> Iterator[Figure]:
    """How renders end that were told to stop, or broke; and what all the cases' tests say."""
    no = max(cancel(veils(o.device), after) for after in (0.4, 0.7))
    ended, error, goes_on = interrupt()
    yield Figure("interrupt (SIGINT, cancel) to stopped", "never in bpy", "", "", "<= 0.5 s cancel, <= 2 s SIGINT",
                 f"{no:.2f} s cancel, {ended:.2f} s SIGINT", no <= 0.5 and ended <= 2.0 and goes_on and "interrupted" in error)  # fmt: skip
    stages = STAGES + LATE_STAGES
    silent, status = break_stages(stages)
    yield Figure("a failed render", "", "", "", "always an error the caller sees, never a crash",
                 f"{len(stages) - len(silent)} of {len(stages)} stages' errors seen, exit status {status}",
                 not silent and status == 0, ", ".join(silent))  # fmt: skip
    bad, crashes, hangs, ran = all_cases()
    yield Figure("non-finite pixels, crashes, hangs over all cases", "0 / 0 / 3", "2 + a black frame", "", "0 / 0 / 0",
                 f"{bad} / {crashes} / {hangs} ({ran} tests)", bad == crashes == hangs == 0 and ran > 0)  # fmt: skip


CASES_LIMIT_S = 1800.0
CASE_FILES = ("tests/hard_cases", "tests/addon/test_hard_cases.py")


def all_cases() -> tuple[int, int, int, int]:
    """The tests of every case, a process a file: those that failed with pixels that are not finite, processes that
    ended by a signal, processes that did not end, and tests that ran. Raises RuntimeError for tests that fail otherwise.
    """
    bad = crashes = hangs = ran = 0
    for path in (file for name in CASE_FILES for file in sorted((ROOT / name).rglob("test_*.py")) or [ROOT / name]):
        command = [sys.executable, "-m", "pytest", "-q", "-rN", "--tb=line", "-p", "no:cacheprovider", str(path)]
        try:
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=CASES_LIMIT_S, check=False)
        except subprocess.TimeoutExpired:
            hangs += 1
            continue
        crashes += done.returncode < 0 or done.returncode >= 128
        last = done.stdout.strip().splitlines()[-1] if done.stdout.strip() else ""
        counts = {word: int(number) for number, word in re.findall(r"(\d+) (passed|failed|error)", last)}
        of_pixels = len(re.findall(r"^.*(?:not finite|isfinite|non.finite).*$", done.stdout, re.MULTILINE))
        bad += of_pixels
        ran += counts.get("passed", 0) + counts.get("failed", 0)
        if done.returncode == 1 and not of_pixels:
            raise RuntimeError(f"{path.name}: {last}")
    return bad, crashes, hangs, ran


PARTS: dict[str, Callable[[Options], Iterator[Figure]]] = {
    "rays": ray_figures,
    "rooms": room_figures,
    "furnace": furnace_figures,
    "film": film_figures,
    "stress": stress_figures,
    "endings": ending_figures,
}


def precision_race(o: Options) -> list[dict[str, Any]]:
    """Rays a second beside misses, edge rays and vertex rays within a ball of 20,480 triangles."""
    rows = []
    rng = np.random.default_rng(5)
    rays = closed_meshes.RAYS["random"](closed_meshes.BALL, rng, closed_meshes.RAYS_AT_ONCE)
    for kind in ("BVH", "BVH2", "CWBVH", "KD_TREE", "GRID"):
        for precision in PRECISIONS:
            accel = Accel(*closed_meshes.BALL, kind=kind, device=o.device, precision=precision)
            seconds = []
            for _ in range(4):
                start = time.perf_counter()
                accel.closest(rays)
                seconds.append(time.perf_counter() - start)
            out = {name: misses(closed_meshes.BALL, kind, o.device, name, o.rays, precision=precision)
                   for name in ("edges", "vertices")}  # fmt: skip
            rows.append({"kind": kind, "precision": precision, "mrays_per_s": len(rays) / min(seconds) / 1e6,
                         **{f"{name}_missed_per_1e8": pair[0] * 1e8 / pair[1] for name, pair in out.items()}})  # fmt: skip
            row = rows[-1]
            print(f"{kind:8} {precision:11} {row['mrays_per_s']:8.2f} Mrays/s   misses per 1e8: edges "
                  f"{row['edges_missed_per_1e8']:.0f}, vertices {row['vertices_missed_per_1e8']:.0f}", flush=True)  # fmt: skip
    return rows


def machine() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").splitlines():
        if line.startswith("model name"):
            return f"{line.split(':', 1)[1].strip()}, {os.cpu_count()} threads"
    return platform.processor()


def keep(target: Path, o: Options, found: list[Figure], race: list[dict[str, Any]]) -> None:
    """Puts what was measured into the record, each row in place of the one that it measures anew."""
    made = {"date": datetime.date.today().isoformat(), "commit": commit(), "machine": machine(), "rays": o.rays}
    record = json.loads(target.read_text(encoding="utf-8")) if target.exists() else {}
    rows = {"figures": [asdict(figure) for figure in found], "precisions": race}
    for part, keys in (("figures", ("quantity",)), ("precisions", ("kind", "precision"))):
        by_name = {tuple(row[key] for key in keys): row for row in record.get(part, [])}
        for row in rows[part]:
            name = tuple(row[key] for key in keys)
            old = by_name.get(name, {})
            if (
                "mrays_per_s" in row and old.get("machine") == made["machine"]
            ):  # other work slows a run, nothing speeds it
                row["mrays_per_s"] = max(row["mrays_per_s"], old["mrays_per_s"])
            by_name[name] = row | made
        rows[part] = list(by_name.values())
    target.write_text(json.dumps({"device": o.device, **rows}, indent=1) + "\n", encoding="utf-8")


def main() -> int:
    """0 when every figure is at its goal."""
    parser = argparse.ArgumentParser(prog="build.py bench hard-cases", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--device", default="CPU", type=str.upper, choices=["CPU", "CUDA"])
    parser.add_argument("--long", action="store_true", help="1e8 rays a structure where the list speaks of as many")
    parser.add_argument("--rays", type=float, default=1e6, help="a structure and kind of rays (default 1e6)")
    parser.add_argument("--only", default=",".join([*PARTS, "race"]), help=f"of {', '.join(PARTS)}, race")
    parser.add_argument("--no-record", action="store_true", help="print alone")
    given = parser.parse_args()
    options = Options(given.device, int(1e8 if given.long else given.rays))
    asked, found = given.only.split(","), []
    for name, part in PARTS.items():
        for figure in part(options) if name in asked else ():
            found.append(figure)
            print(f"{'ok ' if figure.good else 'NOT'} {figure.quantity}: {figure.ours}  (goal {figure.goal}; Cycles "
                  f"{figure.cycles or '-'}, Mitsuba {figure.mitsuba or '-'}, Embree {figure.embree or '-'})"
                  + (f"\n      {figure.note}" if figure.note and not figure.good else ""), flush=True)  # fmt: skip
    race = precision_race(options) if "race" in asked else []
    if not given.no_record:
        target = ROOT / "tests" / "bench" / "records" / f"hard-cases-{options.device.lower()}.json"
        keep(target, options, found, race)
        print(f"{target.relative_to(ROOT)} written")
    bad = [figure.quantity for figure in found if not figure.good]
    print(
        f"{len(found) - len(bad)} of {len(found)} figures at their goal" + (f"; not: {'; '.join(bad)}" if bad else "")
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
