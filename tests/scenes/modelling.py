"""Small modelling vocabulary over bpy.data (no operators, no context): everything in metres, Z up."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import bmesh
import bpy
from mathutils import Matrix, Vector

Point = tuple[float, float, float]


def add(data: bpy.types.ID | None, name: str, at: Point = (0, 0, 0), turn: Point = (0, 0, 0)) -> bpy.types.Object:
    """A new object of the scene at a place, turned by Euler angles in degrees."""
    thing = bpy.data.objects.new(name, data)
    thing.location = at
    thing.rotation_euler = [math.radians(angle) for angle in turn]
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _finish(form: bmesh.types.BMesh, name: str, material: bpy.types.Material | None, smooth: bool) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    form.to_mesh(mesh)
    form.free()
    if material is not None:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    return mesh


def box(
    name: str, size: Point, at: Point, material: bpy.types.Material, *, round_by: float = 0.0, turn: Point = (0, 0, 0)
) -> bpy.types.Object:
    """A box centred at a place; round_by is the radius of its bevelled edges."""
    form = bmesh.new()
    bmesh.ops.create_cube(form, size=1.0, matrix=Matrix.Diagonal((*size, 1.0)))
    thing = add(_finish(form, name, material, False), name, at, turn)
    if round_by > 0:
        bevel = thing.modifiers.new("round", "BEVEL")
        bevel.width, bevel.segments, bevel.harden_normals = round_by, 3, False
        thing.data.polygons.foreach_set("use_smooth", [True] * len(thing.data.polygons))
        weighted = thing.modifiers.new("normals", "WEIGHTED_NORMAL")
        weighted.keep_sharp = True
    return thing


def cushion(
    name: str, size: Point, at: Point, material: bpy.types.Material, *, turn: Point = (0, 0, 0)
) -> bpy.types.Object:
    """A soft box: bevelled wide, then subdivided."""
    thing = box(name, size, at, material, turn=turn)
    bevel = thing.modifiers.new("edge", "BEVEL")
    bevel.width, bevel.segments = min(size) * 0.3, 2
    soft = thing.modifiers.new("soft", "SUBSURF")
    soft.levels = soft.render_levels = 2
    thing.data.polygons.foreach_set("use_smooth", [True] * len(thing.data.polygons))
    return thing


def lathe(
    name: str,
    profile: Sequence[tuple[float, float]],
    at: Point,
    material: bpy.types.Material,
    *,
    steps: int = 64,
    smooth: bool = True,
    turn: Point = (0, 0, 0),
) -> bpy.types.Object:
    """Revolves (radius, height) points about Z; points at radius 0 close the form. Bottom to top: normals out."""
    form = bmesh.new()
    rings: list[list[bmesh.types.BMVert]] = []
    for radius, height in profile:
        if radius == 0:
            rings.append([form.verts.new((0, 0, height))])
        else:
            angles = (2 * math.pi * step / steps for step in range(steps))
            rings.append([form.verts.new((radius * math.cos(a), radius * math.sin(a), height)) for a in angles])
    for low, high in itertools.pairwise(rings):
        for step in range(steps):
            after = (step + 1) % steps
            corners = [low[step % len(low)], low[after % len(low)], high[after % len(high)], high[step % len(high)]]
            form.faces.new(list(dict.fromkeys(corners)))
    return add(_finish(form, name, material, smooth), name, at, turn)


def spline(points: Sequence[tuple[float, float]], per_span: int = 6) -> list[tuple[float, float]]:
    """A smooth profile through the points (Catmull-Rom), for lathe()."""
    padded = [points[0], *points, points[-1]]
    result: list[tuple[float, float]] = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        for step in range(per_span):
            t = step / per_span
            x, y = (
                0.5 * (2 * q + (r - p) * t + (2 * p - 5 * q + 4 * r - s) * t**2 + (3 * q - p - 3 * r + s) * t**3)
                for p, q, r, s in zip(a, b, c, d, strict=True)
            )
            result.append((max(x, 0.0), y))
    return [*result, points[-1]]


def cylinder(
    name: str, radius: float, height: float, at: Point, material: bpy.types.Material, *, turn: Point = (0, 0, 0)
) -> bpy.types.Object:
    """Upright, standing on `at`, its rim rounded a little."""
    rim = min(radius, height) * 0.12
    profile = [(0, 0), (radius - rim, 0), (radius, rim), (radius, height - rim), (radius - rim, height), (0, height)]
    thing = lathe(name, profile, at, material, steps=96, turn=turn)
    thing.data.set_sharp_from_angle(angle=math.radians(50))
    return thing


def ball(name: str, radius: float, at: Point, material: bpy.types.Material) -> bpy.types.Object:
    form = bmesh.new()
    bmesh.ops.create_uvsphere(form, u_segments=48, v_segments=24, radius=radius)
    return add(_finish(form, name, material, True), name, at)


def ring(name: str, radius: float, tube: float, at: Point, material: bpy.types.Material, *, turn: Point = (0, 0, 0)) -> bpy.types.Object:  # fmt: skip
    """A torus about Z."""
    angles = [2 * math.pi * step / 20 for step in range(21)]
    profile = [(radius + tube * math.cos(a), tube * math.sin(a)) for a in angles]
    return lathe(name, profile, at, material, steps=128, turn=turn)


def monkey(name: str, size: float, at: Point, material: bpy.types.Material, *, turn: Point = (0, 0, 0)) -> bpy.types.Object:  # fmt: skip
    """Suzanne, subdivided."""
    form = bmesh.new()
    bmesh.ops.create_monkey(form, matrix=Matrix.Scale(size, 4))
    thing = add(_finish(form, name, material, True), name, at, turn)
    subdivision = thing.modifiers.new("smooth", "SUBSURF")
    subdivision.levels = subdivision.render_levels = 2
    return thing


def tube(name: str, points: Sequence[Point], radius: float, material: bpy.types.Material) -> bpy.types.Object:
    """A curve object with a round section through the points, tapering to its end."""
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", radius, 3
    path = curve.splines.new("POLY")
    path.points.add(len(points) - 1)
    for index, (control, point) in enumerate(zip(path.points, points, strict=True)):
        control.co = (*point, 1.0)
        control.radius = 1.0 - 0.7 * index / max(1, len(points) - 1)
    curve.materials.append(material)
    return add(curve, name)


def aim(thing: bpy.types.Object, target: Point) -> None:
    """Turns -Z (where lamps shine and cameras look) to the target, Y up."""
    direction = Vector(target) - thing.location
    thing.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
