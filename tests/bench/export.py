"""How long the export from Blender takes: a million triangles, a hundred thousand instances.

    PYTHONPATH=native:. .venv/bin/python tests/bench/export.py

Each row: seconds of the first export, Blender's own work of triangulating and computing normals included (the
wall clock, and the processor time, which a loaded machine does not lengthen), and of the second one, where Blender
has both already. Goals: 1 M triangles 0.3 s, 100,000 instances 1 s.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import bpy
import numpy as np

import addon
from addon.export import export_scene

TRIANGLE_GRID = 708  # 2 * 708^2 = 1,002,528 triangles
INSTANCE_GRID = 317  # 317^2 = 100,489 instances


def plain_scene() -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    return scene


def million_triangles(smooth: bool) -> None:
    """A waved grid with a UV map."""
    plain_scene()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=TRIANGLE_GRID, y_subdivisions=TRIANGLE_GRID, size=2.0)
    data = bpy.context.object.data
    positions = np.empty(3 * len(data.vertices), dtype=np.float32)
    data.attributes["position"].data.foreach_get("vector", positions)
    grid = positions.reshape(-1, 3)
    grid[:, 2] = 0.1 * np.sin(9.0 * grid[:, 0]) * np.cos(7.0 * grid[:, 1])
    data.attributes["position"].data.foreach_set("vector", positions)
    data.polygons.foreach_set("use_smooth", np.full(len(data.polygons), smooth))
    data.update()


def instances_by_geometry_nodes() -> None:
    """Cubes on the points of a grid."""
    plain_scene()
    group = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    grid, cube, scatter, output = (
        nodes.new(kind)
        for kind in ("GeometryNodeMeshGrid", "GeometryNodeMeshCube", "GeometryNodeInstanceOnPoints", "NodeGroupOutput")
    )
    grid.inputs["Vertices X"].default_value = grid.inputs["Vertices Y"].default_value = INSTANCE_GRID
    links.new(grid.outputs["Mesh"], scatter.inputs["Points"])
    links.new(cube.outputs["Mesh"], scatter.inputs["Instance"])
    links.new(scatter.outputs["Instances"], output.inputs[0])
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.modifiers.new("Scatter", "NODES").node_group = group


def instances_by_faces() -> None:
    """Cubes on the faces of a grid: Blender's oldest way."""
    plain_scene()
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=INSTANCE_GRID, y_subdivisions=INSTANCE_GRID, size=100.0)
    grid = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=0.1)
    bpy.context.object.parent = grid
    grid.instance_type = "FACES"


def race(name: str, build: Callable[[], None]) -> None:
    """Print one row."""
    build()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    cells = []
    for _ in range(2):
        wall, cpu = time.perf_counter(), time.process_time()
        result = export_scene(depsgraph)
        cells.append(f"{time.perf_counter() - wall:7.3f} {time.process_time() - cpu:7.3f}")
    triangles = sum(len(mesh.triangles) for mesh in result.meshes)
    rows = 0 if result.instances is None else len(result.instances.object)
    print(f"{name:34} {triangles:>10,} {rows:>10,}   {'   '.join(cells)}")


def main() -> None:
    addon.register()
    print(f"{'':34} {'triangles':>10} {'instances':>10}   first: wall cpu    second: wall cpu")
    race("one flat mesh", lambda: million_triangles(smooth=False))
    race("one smooth mesh", lambda: million_triangles(smooth=True))
    race("instances by geometry nodes", instances_by_geometry_nodes)
    race("instances by faces", instances_by_faces)


if __name__ == "__main__":
    main()
