"""Effects of the time that the shutter is open: what moves meanwhile, and what is told not to."""

from __future__ import annotations

import numpy as np

from luch.effects.shown import Shown
from luch.effects.table import Effects
from luch.scene import Scene

NAMES = ("camera motion", "object motion", "deformation motion")
_TIME_BYTES = 12  # of a path under way: its ray's time, its next ray's, its shadow ray's


def add_motion(effects: Effects, shown: Shown) -> None:
    """Motion of the camera, of objects, of their shapes."""
    scene = shown.scene
    if scene.shutter is None:
        missing = scene.unsupported.get("motion blur", [])
        for name in NAMES:
            effects.add("Camera", name, False, missing[0] if missing else "the scene asks for no motion blur",
                        missing=bool(missing))  # fmt: skip
        return
    cost = f"one more random number and {_TIME_BYTES} bytes per path"
    facts = (_camera(scene), _objects(scene), _shapes(scene, shown))
    for name, fact in zip(NAMES, facts, strict=True):
        effects.add("Camera", name, bool(fact), fact or _nothing(scene, name), cost=cost if fact else "")


def _open(scene: Scene) -> str:
    shutter = scene.shutter
    assert shutter is not None
    return f"while the shutter is open for {shutter.length:g} frames"


def _nothing(scene: Scene, name: str) -> str:
    shutter = scene.shutter
    assert shutter is not None
    still = [fact for fact in shutter.still if fact.startswith("the camera") == (name == NAMES[0])]
    if still:
        return still[0] + (f", as is that of {len(still) - 1} more" if len(still) > 1 else "")
    return f"nothing of it moves {_open(scene)}"


def _camera(scene: Scene) -> str:
    motion = scene.camera.motion
    if motion is None:
        return ""
    moves = len(motion.matrix) > 1 and bool((motion.matrix != motion.matrix[0]).any())
    zooms = motion.lens_mm is not None and motion.lens_mm != (scene.camera.lens_mm, scene.camera.lens_mm)
    what = " and ".join(["moves"] * moves + ["zooms"] * zooms)
    return f"the camera {what} {_open(scene)}" if what else ""


def _objects(scene: Scene) -> str:
    instances = scene.instances
    if instances is None or instances.motion is None or not len(instances.motion.instance):
        return ""
    moving = np.unique(instances.motion.instance)
    first = scene.objects[int(instances.object[moving[0]])].name
    of = f"{len(moving):,} of {len(instances.object):,} instances"
    return f'object "{first}" {"moves" if len(moving) == 1 else "and others move"} {_open(scene)}: {of}'


def _shapes(scene: Scene, shown: Shown) -> str:
    meshes = (scene.meshes[mesh] for mesh in shown.uses)
    names = [
        m.name for m in meshes if m.motion_positions is not None or (m.curves and m.curves.motion_points is not None)
    ]
    if not names:
        return ""
    more = f" and {len(names) - 1} more change" if len(names) > 1 else " changes"
    return f'mesh "{names[0]}"{more} shape {_open(scene)}'
