"""What was left out of a render at the door, by cause and by name: geometry that no ray can meet, broken pixels.

Builders count it (LeftOut of native/cpu/accel/accel.h); here it becomes sentences that name the object. What a user
should mend is a warning; triangles without area and copies of others are ordinary in models, change no picture, and
stand in the statistics alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from luch.scene import Scene

FARTHEST_M = 1e37  # LARGEST_COORDINATE of luch/math/bounds.h


def warnings(stats: Mapping[str, Any], scene: Scene) -> list[str]:
    """One sentence for each thing that is not drawn as it is in the scene."""
    told = list(stats.get("image_warnings", []))
    owners = _owners(stats, scene)
    for mesh, invalid, too_far, _, _ in stats.get("left_out", []):
        if invalid:
            told.append(f"{owners[mesh]}: {_count(invalid, 'face')} with a vertex that is not finite or not there"
                        " are left out. Remove them with Mesh > Clean Up.")  # fmt: skip
        if too_far:
            told.append(f"{owners[mesh]}: {_count(too_far, 'face')} reaching farther than {FARTHEST_M:g} m are"
                        " left out. Scale the object down.")  # fmt: skip
    for index in dict.fromkeys(stats.get("dropped_objects", [])):
        told.append(f'Object "{scene.objects[index].name}": its transform leaves no surface, so it is left out. '
                    "Clear its scale and location.")  # fmt: skip
    return told


def report(stats: Mapping[str, Any], scene: Scene) -> list[str]:
    """What was left out and is missed by nobody, one sentence a mesh."""
    told = []
    owners = _owners(stats, scene)
    for mesh, _, _, empty, copies in stats.get("left_out", []):
        parts = [f"{_count(empty, 'face')} without area"] if empty else []
        parts += [f"{_count(copies, 'face')} on top of another that is the same"] if copies else []
        if parts:
            told.append(f"{owners[mesh]}: {' and '.join(parts)} left out.")
    return told


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}s" if number != 1 else f"1 {noun}"


def _owners(stats: Mapping[str, Any], scene: Scene) -> dict[int, str]:
    """Of each mesh that something was left out of: the first object that shows it."""
    meshes = [mesh for mesh, *_ in stats.get("left_out", [])]
    if not meshes:
        return {}
    objects = {subject.mesh: f'Object "{subject.name}"' for subject in reversed(scene.objects)}
    return {mesh: objects.get(mesh, f'Mesh "{scene.meshes[mesh].name}"') for mesh in meshes}
