"""Nodes against Cycles: one small tile of a picture per case, drawn by Cycles and computed by Luch.

Every tile is the same bent patch of eight triangles, with smooth normals, two UV maps and attributes,
placed, turned and scaled in the world. A case makes an output socket in a node tree; it is shown as
emission. Cycles takes one sample per pixel and says where (its Position pass); Luch's compiled program
is run natively for the very same points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from luch import core
from luch.scene import Mesh, Program, Scene
from mathutils import Matrix
from numpy.typing import NDArray

from support.blender import empty_scene, render_passes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Case = Callable[[bpy.types.NodeTree], bpy.types.NodeSocket]

TILE = 6  # pixels per tile and side
PITCH = 1.2  # metres between tiles
PIXEL = PITCH / TILE


@dataclass
class Tiles:
    """Cases laid out on a square, and what both engines make of them: float32 (cases, TILE, TILE, 3)."""

    names: list[str]
    cycles: F32
    luch: F32
    drawn: F32  # by Luch's renderer, within a hundredth of a pixel of Cycles' points
    hit: NDArray[np.bool_]  # (cases, TILE, TILE): the pixel shows the patch
    warnings: list[str]


def patch_mesh() -> bpy.types.Mesh:
    """A bent 2 x 2 patch with everything that input nodes may ask for."""
    mesh = bpy.data.meshes.new("Patch")
    xs = (-0.5, 0.05, 0.5)
    vertices = [(x, y, 0.2 * x * y - 0.15 * x * x + 0.1 * y) for y in xs for x in xs]
    faces = [(i, i + 1, i + 4, i + 3) for i in (0, 1, 3, 4)]
    mesh.from_pydata(vertices, [], faces)
    mesh.shade_smooth()
    for name, scale in (("UVMap", 1.0), ("Second", 0.5)):
        layer = mesh.uv_layers.new(name=name)
        for corner, loop in zip(layer.data, mesh.loops, strict=True):
            x, y, _ = vertices[loop.vertex_index]
            corner.uv = ((x + 0.5) * scale + 0.1 * y, (y + 0.5) * scale + 0.2 * x * x)
    colors = mesh.color_attributes.new("Tint", "FLOAT_COLOR", "CORNER")
    for k, item in enumerate(colors.data):
        item.color = (0.1 + 0.05 * k, 0.9 - 0.04 * k, 0.3 + 0.02 * k, 0.25 + 0.03 * k)
    warmth = mesh.attributes.new("warmth", "FLOAT", "POINT")
    warmth.data.foreach_set("value", [0.1 * k for k in range(9)])
    flow = mesh.attributes.new("flow", "FLOAT_VECTOR", "FACE")
    for k, item in enumerate(flow.data):
        item.vector = (0.2 * k, 1.0 - 0.1 * k, 0.5)
    return mesh


def placement(column: int, row: int, mirrored: bool = False) -> Matrix:
    """Where a tile lies, how it is turned and scaled (not uniformly, or to its mirror image)."""
    turn = Matrix.Rotation(0.3, 4, "X") @ Matrix.Rotation(-0.25, 4, "Y") @ Matrix.Rotation(0.2, 4, "Z")
    size = Matrix.Diagonal((-1.0 if mirrored else 1.0, 0.85, 1.3, 1.0))
    return Matrix.Translation((column * PITCH, row * PITCH, 0.3)) @ turn @ size


def build(cases: dict[str, Case], mirrored: bool = False) -> tuple[bpy.types.Scene, list[bpy.types.Object], int]:
    """A scene of tiles seen from straight above by an orthographic camera; tiles per side."""
    scene = empty_scene()
    side = int(np.ceil(np.sqrt(len(cases))))
    mesh = patch_mesh()
    mesh.materials.append(None)
    other = bpy.data.objects.new("Other", None)
    other.matrix_world = Matrix.Translation((1.0, 2.0, 3.0)) @ Matrix.Rotation(0.5, 4, "Y")
    scene.collection.objects.link(other)
    objects = []
    for index, (name, case) in enumerate(cases.items()):
        tile = bpy.data.objects.new(name, mesh)
        tile.matrix_world = placement(index % side, index // side, mirrored)
        tile.pass_index, tile.color = 7, (0.2, 0.4, 0.6, 0.8)
        tile["level"], tile["hue"] = 0.3, (0.2, 0.7, 0.9)
        scene.collection.objects.link(tile)
        material = bpy.data.materials.new(name)
        material.pass_index = 3
        material.cycles.emission_sampling = "NONE"
        tree = material.node_tree
        tree.nodes.clear()
        output, emission = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
        tree.links.new(emission.outputs[0], output.inputs[0])
        tree.links.new(case(tree), emission.inputs["Color"])
        tile.material_slots[0].link = "OBJECT"
        tile.material_slots[0].material = material
        objects.append(tile)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", side * PITCH
    centre = (side - 1) * PITCH / 2
    camera.location = (centre, centre, 5.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.view_layers[0].use_pass_position = True
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    scene.luch.pixel_filter_type, scene.luch.filter_width = "GAUSSIAN", 0.01
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    bpy.context.view_layer.update()
    return scene, objects, side


def compare(cases: dict[str, Case], folder: Path) -> Tiles:
    """Draws all cases with Cycles, computes them with Luch."""
    from addon.export.attributes import wishes
    from addon.export.context import ExportContext
    from addon.export.meshes import export_mesh
    from addon.export.nodes import compile_material

    scene, objects, side = build(cases)
    size = side * TILE
    passes = render_passes("CYCLES", folder, width=size, height=size, samples=1)
    picture, position = passes["Combined"][::-1], passes["Position"][::-1].astype(np.float64)
    ours = render_passes("LUCH", folder, width=size, height=size, samples=1)["Combined"][::-1]
    context = ExportContext(bpy.context.evaluated_depsgraph_get(), Scene())
    cycles = np.zeros((len(objects), TILE, TILE, 3), np.float32)
    luch, drawn, hit = np.zeros_like(cycles), np.zeros_like(cycles), np.zeros(cycles.shape[:3], np.bool_)
    for index, tile in enumerate(objects):
        column, row = index % side, index // side
        cut = np.s_[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE]
        cycles[index], drawn[index] = picture[cut][..., :3], ours[cut][..., :3]
        program = compile_material(tile.material_slots[0].material, context).surface
        mesh = export_mesh(tile.data, wishes(program), tile.data, context)
        assert mesh is not None
        points, hit[index] = tile_points(mesh, tile, position[cut])
        values = evaluate(program, mesh, tile, points, scene, size)
        luch[index][hit[index]] = values
    return Tiles(list(cases), cycles, luch, drawn, hit, context.result.warnings)


def draw(cases: dict[str, Case], folder: Path, *, mirrored: bool, behind: bool) -> dict[str, F32]:
    """Both engines' pictures of the cases, float32 (size, size, 3), of mirrored tiles or seen from below."""
    scene, _, side = build(cases, mirrored)
    if behind:
        scene.camera.location.z, scene.camera.rotation_euler = -5.0, (np.pi, 0.0, 0.0)
        bpy.context.view_layer.update()
    size = side * TILE
    return {
        engine: render_passes(engine, folder, width=size, height=size, samples=1)["Combined"][..., :3]
        for engine in ("CYCLES", "LUCH")
    }


def tile_points(mesh: Mesh, tile: Any, seen: F64) -> tuple[dict[str, Any], NDArray[np.bool_]]:
    """The shading points of a tile, looked at along -Z, and which pixels have one.

    seen: Cycles' Position pass, (TILE, TILE, 3), zero where nothing is.
    """
    matrix = np.array(tile.matrix_world, np.float64)
    corners = (mesh.positions @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles].astype(np.float64)  # (T, 3, 3)
    x, y = seen[..., 0], seen[..., 1]
    edges_u, edges_v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    det = edges_u[:, 0] * edges_v[:, 1] - edges_v[:, 0] * edges_u[:, 1]
    dx, dy = x[..., None] - corners[:, 0, 0], y[..., None] - corners[:, 0, 1]
    u = (dx * edges_v[:, 1] - dy * edges_v[:, 0]) / det
    v = (dy * edges_u[:, 0] - dx * edges_u[:, 1]) / det
    inside = np.minimum(np.minimum(u, v), 1 - u - v)
    prim = inside.argmax(-1)
    hit = seen.any(-1) & (inside.max(-1) > 1e-4)  # on an edge between triangles either may be met
    prim = prim[hit]
    u, v = u[hit][np.arange(prim.size), prim], v[hit][np.arange(prim.size), prim]
    weights = np.stack([1 - u - v, u, v], 1)
    position = np.einsum("nk,nkc->nc", weights, corners[prim])
    inverse = np.linalg.inv(matrix[:3, :3])
    assert mesh.normals is not None
    smooth = (
        mesh.normals[mesh.triangles[prim]] if mesh.normals_domain == "POINT" else mesh.normals.reshape(-1, 3, 3)[prim]
    )
    normal = unit(np.einsum("nk,nkc->nc", weights, smooth) @ inverse)
    flat = unit(np.cross(edges_u, edges_v))[prim]
    count = prim.size
    points = {
        "position": position,
        "normal": normal,
        "geometric_normal": flat,
        "incoming": np.tile([0.0, 0.0, 1.0], (count, 1)),
        "uv": np.stack([u, v], 1),
        "prim": prim.astype(np.uint32),
        "ray_length": 5.0 - 0.1 - position[:, 2],
        "footprint": np.full(count, PIXEL),
    }
    return points, hit


def unit(vectors: F64) -> F64:
    """Rows of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def evaluate(program: Program, mesh: Mesh, tile: Any, points: dict[str, Any], scene: Any, size: int) -> F32:
    """Emission of the program at the points, (N, 3)."""
    matrix, camera = np.array(tile.matrix_world), np.array(scene.camera.matrix_world)
    to_camera = np.diag([1.0, 1.0, -1.0, 1.0]) @ np.linalg.inv(camera)
    names = [*program.attributes]
    rows = [
        (mesh.attributes[n].data, mesh.attributes[n].domain) if n in mesh.attributes else (np.zeros((1, 1)), "NONE")
        for n in names
    ]
    for active in (mesh.uv_active, mesh.color_active):
        attribute = mesh.attributes.get(active)
        rows.append((attribute.data, attribute.domain) if attribute else (np.zeros((1, 1)), "NONE"))
    description = {
        "mesh": {
            "positions": mesh.positions,
            "triangles": mesh.triangles,
            "normals": mesh.normals,
            "texture_location": mesh.texture_location,
            "texture_size": mesh.texture_size,
            "attributes": rows,
        },
        "uv_attribute": len(names),
        "color_attribute": len(names) + 1,
        "to_world": matrix[:3],
        "to_object": np.linalg.inv(matrix)[:3],
        "object_index": tile.pass_index,
        "object_color": list(tile.color),
        "camera": {
            "to_world": np.linalg.inv(to_camera)[:3],
            "to_camera": to_camera[:3],
            "pixel_size": PIXEL,
            "width": size,
            "height": size,
        },
    }
    run = core.shade.run_program(
        program.code,
        program.constants,
        program.register_count,
        program.tables,
        len(points["prim"]),
        points,
        description,
    )
    return np.asarray(run["emission"])
