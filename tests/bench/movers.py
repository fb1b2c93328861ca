"""What motion costs where little moves: 24 balls on a floor, none, one or all of them moving.

  build.py bench movers [--device CUDA] [--samples 32] [--rounds 9] [--only NAME ...]

Renders of one process in turns (still, moving, still, ...); the ratio of each pair's seconds, its median and a 95 %
interval. "hidden": a ball moves that no ray can meet, below the floor; "hidden, clear": it stands still and lets light
through, beside the same scene in which it does not, all lit by a sun, so that there are shadow rays to ask it. Rows are kept beside those of the economy bench
(tests/bench/records/economy-DEVICE.json, scene "24 balls") and stand in docs/effects.md.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "native"), str(ROOT / "tests"), str(ROOT / "tests" / "bench")]

import economy  # noqa: E402
import numpy as np  # noqa: E402
from luch.scene import InstanceMotion, Light, Material, Mesh, Object, Scene, Shutter  # noqa: E402
from support.accel_meshes import icosphere  # noqa: E402
from support.effects import closure, program  # noqa: E402
from support.from_above import scene_of  # noqa: E402

SIDE = 4, 6  # balls
APART = 2.5
STEP = 0.5  # what a mover covers while the shutter is open


def ball() -> Mesh:
    """20,480 triangles."""
    positions, triangles = icosphere(5)
    return Mesh("Ball", positions, triangles, material_slots=np.zeros(len(triangles), np.uint16))


def floor() -> Mesh:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32) * np.float32(40.0)
    return Mesh("Floor", corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), material_slots=np.zeros(2, np.uint16))


def balls() -> Scene:
    """Still. The last ball lies under the floor."""
    matrices = [np.eye(3, 4) for _ in range(SIDE[0] * SIDE[1] + 2)]
    for index, matrix in enumerate(matrices[:-2]):
        row, column = divmod(index, SIDE[1])
        matrix[:, 3] = (column - (SIDE[1] - 1) / 2) * APART, (row - (SIDE[0] - 1) / 2) * APART, 1.0
    matrices[-2][:, 3] = 0.0, 0.0, -5.0
    scene = scene_of(
        ball(), width=16.0, size=320, above=30.0, matrices=np.stack(matrices), world=1.0, passes=["Combined"]
    )
    scene.meshes.append(floor())
    scene.objects.append(Object("Floor", 1, [0]))
    scene.instances.object[-1] = 1
    scene.settings = replace(scene.settings, threads=0, accelerator="AUTO")
    return scene


def sunny(scene: Scene, clear: bool) -> Scene:
    """Lit by a sun; the hidden ball is of a material and a mesh of its own, for which objects that share a mesh share
    what shadow rays are told of it: clear or not.
    """
    scene = replace(scene, lights=[Light("Sun", "SUN", power=np.pi)], world=None)
    kind = "CLOSURE_TRANSPARENT" if clear else "CLOSURE_DIFFUSE"
    hidden = Material("Hidden", program(lambda builder: closure(builder, kind, {"color": (0.8, 0.8, 0.8)})))
    scene.materials = [*scene.materials, hidden]
    scene.meshes = [*scene.meshes, replace(scene.meshes[0], name="Hidden")]
    scene.objects = [*scene.objects, Object("Hidden", len(scene.meshes) - 1, [1])]
    scene.instances = replace(scene.instances, object=scene.instances.object.copy())
    scene.instances.object[SIDE[0] * SIDE[1]] = 2
    return scene


def moving(scene: Scene, which: list[int], turns: float = 0.0) -> Scene:
    """Sideways, evenly; turns: radians about the axis upwards, too."""
    keys = []
    for instance in which:
        for side in (-0.5, 0.5):
            matrix = scene.instances.matrix[instance].copy()
            matrix[0, 3] += side * STEP
            c, s = np.cos(side * turns), np.sin(side * turns)
            matrix[:, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ matrix[:, :3]
            keys.append(matrix)
    motion = InstanceMotion(np.array(which, np.uint32), np.full(len(which), 2, np.uint32), np.stack(keys))
    return replace(scene, instances=replace(scene.instances, motion=motion), shutter=Shutter())


def main() -> int:
    """Prints and keeps a row a case."""
    parser = argparse.ArgumentParser(prog="build.py bench movers", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--device", default="CPU", type=str.upper, choices=["CPU", "CUDA"])
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--only", nargs="+", metavar="NAME")
    options = parser.parse_args()
    still = economy.asking(balls(), samples=options.samples, device=options.device)
    count = SIDE[0] * SIDE[1]
    every, one = list(range(count)), [count // 2 + SIDE[1] // 2]
    cases = {
        "hidden": (still, moving(still, [count])),
        "1 of 24": (still, moving(still, one)),
        "all 24": (still, moving(still, every)),
        "all 24, which turn": (still, moving(still, every, 0.5)),
        "hidden, clear": (sunny(still, False), sunny(still, True)),
    }
    for name in options.only or cases:
        row = economy.compare(*cases[name], options.rounds)
        economy.keep(options.device, "24 balls", "moving", name, row)
        print(f"{name:20} {row['ratio']:.3f} ({row['low']:.3f} to {row['high']:.3f})", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
