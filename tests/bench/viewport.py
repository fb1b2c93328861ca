"""A 3D view at work: the camera moves, the file changes.

  .venv/bin/python tests/bench/viewport.py [--edits 1000] [--seconds 10] [--device CUDA]
  .venv/bin/python tests/bench/viewport.py --scene conference_room.luch [--size 1280x720] [--seconds 10] [--device CUDA]

Without a scene: view_update so many times in so many seconds (bpy), then the view must show the last state. Says how
long an update took Blender's thread, how much memory grew, and whether the picture is the right one.

With a scene (`build.py export` writes one; no Blender is needed): the camera goes around what it looks at. Says when the
first picture was there, how long each move then waited for its first picture, how many pictures a second a view shows
that turns without pause, how long a cancel takes, what was built anew, and how much memory grew.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests")]

import numpy as np  # noqa: E402
from luch.preview import Preview  # noqa: E402
from luch.scene import Scene  # noqa: E402
from luch.scenefile import read_scene  # noqa: E402
from support.frames import resident_mib  # noqa: E402

WAIT_S = 600.0
TURN_DEG = 2.0  # of a move
FRAME_SECONDS = 1.0 / 60.0  # between two events of a mouse


# -- The camera moves -------------------------------------------------------------------------------------------------


def view_of(path: Path, size: str, device: str) -> Scene:
    """The scene as a 3D view shows it (addon/export/settings.py)."""
    scene = read_scene(path)
    width, height = (int(side) for side in size.split("x"))
    film = replace(scene.film, width=width, height=height, border=None, passes=["Combined"])
    settings = replace(
        scene.settings, samples=1 << 20, time_limit=0.0, device=device, accelerator="BVH", quality="CUSTOM",
        denoise=False, verify=False, mergeable=False,
    )  # fmt: skip
    camera = replace(scene.camera, motion=None)
    return replace(scene, film=film, settings=settings, camera=camera, shutter=None)


def orbit(scene: Scene, pivot_m: float) -> Iterator[Scene]:
    """About the vertical through what lies so far before the camera, on and on."""
    matrix = scene.camera.matrix
    pivot = matrix[:, 3] - pivot_m * matrix[:, 2]
    number = 0
    while True:
        number += 1
        angle = math.radians(TURN_DEG) * number
        turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1.0]])
        place = np.c_[turn @ matrix[:, :3], turn @ (matrix[:, 3] - pivot) + pivot]
        origin = (float(place[0, 3]), float(place[1, 3]), float(place[2, 3]))
        yield replace(scene, camera=replace(scene.camera, matrix=place), origin=origin)


def wait_for(preview: Preview, version: int) -> None:
    """Until a picture of that version is there."""
    began = time.perf_counter()
    while preview.picture is None or preview.picture.version != version:
        if preview.failed or time.perf_counter() - began > WAIT_S:
            raise SystemExit(f"No picture: {preview.text}")
        time.sleep(0.0005)


def first_pictures(preview: Preview, views: Iterator[Scene], count: int, pause: float) -> list[float]:
    """Seconds from each move to its first picture; after it the view stands still for a moment, and is refined."""
    waits = []
    for _ in range(count):
        began = time.perf_counter()
        wait_for(preview, preview.submit(next(views)))
        waits.append(time.perf_counter() - began)
        time.sleep(pause)
    return waits


def turning(preview: Preview, views: Iterator[Scene], seconds: float) -> tuple[int, int]:
    """Moves and pictures of a view that turns without pause."""
    ends, moves, seen = time.perf_counter() + seconds, 0, set[int]()
    while time.perf_counter() < ends:
        preview.submit(next(views))
        moves += 1
        until = time.perf_counter() + FRAME_SECONDS
        while time.perf_counter() < until:
            if preview.picture is not None:
                seen.add(preview.picture.version)
            time.sleep(0.001)
    return moves, len(seen)


def cancels(preview: Preview, views: Iterator[Scene], count: int) -> list[float]:
    """Seconds until nothing is rendered any more, from within the finished size."""
    waits = []
    for _ in range(count):
        wait_for(preview, preview.submit(next(views)))
        time.sleep(0.5)
        began = time.perf_counter()
        preview.clear()
        if not preview.wait(WAIT_S):
            raise SystemExit("A cancelled view goes on.")
        waits.append(time.perf_counter() - began)
    return waits


def told(name: str, waits: list[float]) -> str:
    milliseconds = sorted(1e3 * wait for wait in waits)
    return f"{name} {milliseconds[len(milliseconds) // 2]:.0f} ms (median), at most {milliseconds[-1]:.0f}"


def moves(asked: argparse.Namespace) -> int:
    scene, preview = view_of(asked.scene, asked.size, asked.device), Preview()
    began = time.perf_counter()
    wait_for(preview, preview.submit(scene))
    first = time.perf_counter() - began
    views = orbit(scene, asked.pivot)
    first_pictures(preview, views, 3, 1.0)  # learns how fast it is
    builds, before = preview.kept.builds, resident_mib()
    waits = first_pictures(preview, views, 20, asked.seconds / 20)
    count, pictures = turning(preview, views, asked.seconds)
    anew, more = preview.kept.builds - builds, resident_mib() - before
    stops = cancels(preview, views, 3)
    print(f"{asked.scene.name}, {asked.size}: first picture after {first:.2f} s")
    print(told("a move's first picture after", waits))
    print(
        f"turning for {asked.seconds:g} s: {count / asked.seconds:.0f} moves and {pictures / asked.seconds:.1f} pictures a second"
    )
    print(told("a cancel takes", stops))
    print(f"whole rebuilds (a camera that comes close to something may ask for one): {anew}; {more:.1f} MiB more")
    preview.stop(wait=True)
    return 0


# -- The file changes -------------------------------------------------------------------------------------------------


def edited(asked: argparse.Namespace) -> int:
    import bpy
    from support.viewports import Window, as_fresh, edits, room_with_a_cube, shown

    import addon
    from addon.viewport import Viewport

    addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    room_with_a_cube(bpy.context.scene)
    setattr(bpy.context.scene.luch, "device", asked.device)
    window, view = Window(), Viewport()
    shown(view, window)
    before, spent = resident_mib(), []
    update = view.update

    def timed(*arguments: Any) -> None:
        began = time.perf_counter()
        update(*arguments)
        spent.append(time.perf_counter() - began)

    setattr(view, "update", timed)
    began = time.perf_counter()
    edits(asked.edits, asked.seconds, window, view)
    took = time.perf_counter() - began
    assert view.preview.wait(WAIT_S) and view.preview.picture is not None, view.text
    right = np.array_equal(view.preview.picture.pixels, as_fresh(view, window))
    print(
        f"{view.preview.stats['device']}: {asked.edits} edits in {took:.1f} s; an update takes {1e3 * np.median(spent):.1f} ms, at most"
        f" {1e3 * max(spent):.1f}; {resident_mib() - before:.1f} MiB more; the last state"
        f" {'is shown' if right else 'IS NOT SHOWN'}"
    )
    view.stop(wait=True)
    addon.unregister()
    return 0 if right else 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", type=Path, help="a .luch file: moves of its camera")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--pivot", type=float, default=3.0, help="how far before the camera it turns about, m")
    parser.add_argument("--edits", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--device", choices=["CPU", "CUDA"], default="CPU")
    asked = parser.parse_args()
    return moves(asked) if asked.scene else edited(asked)


if __name__ == "__main__":
    sys.exit(main())
