"""Which scene something was measured on: for reports, which are used later, maybe on another.

A scene is known by what it is made of, not by how it stands: an animation's other frames, another size or other settings
are the same scene; another file is not, nor is one whose objects, materials or lights are others.
"""

from __future__ import annotations

import hashlib

from luch.scene import Program, Scene


def identity_of(scene: Scene) -> str:
    """16 hexadecimal digits: of names, kinds, and of the operations of the shaders."""
    world = scene.world
    parts = [
        scene.name,
        *sorted({f"mesh {mesh.name}" for mesh in scene.meshes}),
        *sorted({f"object {one.name} {one.materials}" for one in scene.objects}),
        *(f"material {one.name} {_words(one.surface)} {one.volume is not None}" for one in scene.materials),
        *sorted({f"image {image.name}" for image in scene.images}),
        *(f"light {light.name} {light.kind} {_words(light.program)}" for light in scene.lights),
        f"world {world.name} {_words(world.program)}" if world is not None else "no world",
        f"camera {scene.camera.kind}",
    ]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _words(program: Program | None) -> str:
    """Its operations; numbers that it reads may be animated."""
    return "" if program is None else hashlib.sha256(program.code.tobytes()).hexdigest()
