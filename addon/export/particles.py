"""Particle hair: paths of an evaluated particle system and its children, as curves in the object's space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from luch.bounds import LEAST_HAIR_SHAPE
from luch.scene import F32, Attribute, Curves, Mesh

from .attributes import ACTIVE_COLOR
from .context import ExportContext
from .curves import NOT_FOR_SHADERS, derived, mesh_of

_STRAYS = 16.0  # units in the last place of a path's coordinates, through Blender's transforms and back


def hair_systems(subject: Any, for_view: bool = False) -> list[tuple[Any, Any]]:
    """(modifier, particle system) of what an evaluated object draws as hair, in renders or in 3D views."""
    return [
        (modifier, modifier.particle_system)
        for modifier in subject.modifiers
        if modifier.type == "PARTICLE_SYSTEM"
        and (modifier.show_viewport if for_view else modifier.show_render)
        and modifier.particle_system.settings.type == "HAIR"
        and modifier.particle_system.settings.render_type == "PATH"
    ]


@dataclass
class Grown:
    """The paths of a system that were computed, in the object's space."""

    numbers: list[int]  # as Blender counts a system's particles and children
    points: F32  # (len(numbers) * steps, 4) place and radius, path by path
    steps: int
    noise: float  # how far a place may stray: Blender tells it in the world, in single precision


def grow(subject: Any, system: Any, for_view: bool = False) -> Grown | None:
    """Every path of an evaluated system, or of its children where it has those; None if there is none. 3D views have
    their own number of steps and share of the children."""
    settings = system.settings
    parents, children = len(system.particles), len(system.child_particles)
    if for_view:
        children = children * settings.display_percentage // 100
    start = 0 if children == 0 or settings.child_type == "NONE" else parents
    numbers = range(start, parents + children)
    steps = (
        (1 << (settings.display_step if for_view else settings.render_step))
        + 1
        + (settings.kink_extra_steps if settings.kink == "SPIRAL" else 0)
    )
    if not numbers:
        return None
    world = np.array(
        [system.co_hair(object=subject, particle_no=n, step=s) for n in numbers for s in range(steps)], np.float64
    )
    to_object = np.linalg.inv(np.array(subject.matrix_world, np.float64))
    place = (world @ to_object[:3, :3].T + to_object[:3, 3]).reshape(len(numbers), steps, 3)
    # A path that was not computed stays at the world's origin for all its steps.
    lengths = np.linalg.norm(np.diff(place, axis=1), axis=2)
    there = np.isfinite(place).all(axis=(1, 2)) & (lengths.sum(1) > 0.0)
    place, lengths = place[there], lengths[there]
    if not len(place):
        return None
    arc = np.concatenate([np.zeros((len(place), 1)), np.cumsum(lengths, axis=1)], axis=1)
    along = arc / arc[:, -1:]
    points = np.concatenate([place, _radii(settings, along)[..., None]], axis=2).astype(np.float32)
    far = np.abs(world.reshape(len(numbers), -1)[there]).max()
    noise = float(_STRAYS * np.finfo(np.float32).eps * far * np.abs(to_object[:3, :3]).sum(1).max())
    return Grown([n for n, t in zip(numbers, there, strict=True) if t], points.reshape(-1, 4), steps, noise)


def export_hair(subject: Any, modifier: Any, system: Any, wanted: set[str], context: ExportContext) -> Mesh | None:
    """Curves of one system; None if it has none."""
    grown = grow(subject, system, context.for_view)
    if grown is None:
        return None
    count = len(grown.numbers)
    first = np.arange(count, dtype=np.uint32) * np.uint32(grown.steps)
    slots = np.full(count, max(system.settings.material - 1, 0), np.uint16)
    mesh = mesh_of(f"{subject.name} {system.name}", Curves(grown.points, first, slots))
    mesh.attributes = derived(mesh, wanted)
    _add_emitter_values(mesh, subject, modifier, system, grown.numbers, wanted)
    return mesh


def _radii(settings: Any, along: Any) -> Any:
    """Half the diameters that the panel Hair Shape states, from root (0) to tip (1)."""
    rest = 1.0 - along
    shape = settings.shape
    if shape != 0.0:
        with np.errstate(divide="ignore"):
            rest = rest ** (1.0 + shape if shape < 0.0 else 1.0 / max(1.0 - shape, LEAST_HAIR_SHAPE))
    scale = 0.5 * settings.radius_scale
    radius = scale * (settings.tip_radius + rest * (settings.root_radius - settings.tip_radius))
    if settings.use_close_tip:
        radius[:, -1] = 0.0
    return radius


def _add_emitter_values(
    mesh: Mesh, subject: Any, modifier: Any, system: Any, numbers: list[int], wanted: set[str]
) -> None:
    """UV maps and colours of the emitter where each hair grows."""
    layers = list(subject.data.uv_layers)
    active = next((layer.name for layer in layers if layer.active_render), "")
    mesh.uv_active = active
    parents = len(system.particles)
    for index, layer in enumerate(layers):
        if layer.name == active or layer.name in wanted:
            uv = [system.uv_on_emitter(modifier, particle=_particle(system, n, parents), particle_no=n, uv_no=index)
                  for n in numbers]  # fmt: skip
            mesh.attributes[layer.name] = Attribute(_rows(uv), "CURVE")
    colors = subject.data.vertex_colors
    mesh.color_active = next((layer.name for layer in colors if layer.active_render), "")
    for index, layer in enumerate(colors):
        if layer.name in wanted - NOT_FOR_SHADERS or (ACTIVE_COLOR in wanted and layer.name == mesh.color_active):
            color = [system.mcol_on_emitter(modifier, _particle(system, n, parents), particle_no=n, vcol_no=index)
                     for n in numbers]  # fmt: skip
            mesh.attributes[layer.name] = Attribute(_rows(color), "CURVE")


def _particle(system: Any, number: int, parents: int) -> Any:
    return system.particles[min(number, parents - 1)]


def _rows(values: list[Any]) -> F32:
    return np.array([tuple(value) for value in values], np.float32)
