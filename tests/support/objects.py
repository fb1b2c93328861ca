"""Objects that several tests of the add-on build, and how they are looked at."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np

Render = Callable[..., np.ndarray]


def grid_of_instances(count: int) -> bpy.types.Object:
    """A geometry-nodes object that shows a cube on every point of a grid of count x count."""
    group = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    grid = nodes.new("GeometryNodeMeshGrid")
    grid.inputs["Vertices X"].default_value = count
    grid.inputs["Vertices Y"].default_value = count
    grid.inputs["Size X"].default_value = count - 1.0
    grid.inputs["Size Y"].default_value = count - 1.0
    cube = nodes.new("GeometryNodeMeshCube")
    scatter = nodes.new("GeometryNodeInstanceOnPoints")
    output = nodes.new("NodeGroupOutput")
    links.new(grid.outputs["Mesh"], scatter.inputs["Points"])
    links.new(cube.outputs["Mesh"], scatter.inputs["Instance"])
    links.new(scatter.outputs["Instances"], output.inputs[0])
    bpy.ops.mesh.primitive_plane_add()
    owner = bpy.context.object
    owner.modifiers.new("Scatter", "NODES").node_group = group
    return owner


def point_cloud(name: str, points: Sequence[Sequence[float]], radii: Sequence[float] | None = None) -> bpy.types.Object:
    """A point cloud of the scene; without radii it has no such attribute."""
    cloud = bpy.data.pointclouds.new(name)
    cloud.resize(len(points))
    cloud.attributes["position"].data.foreach_set("vector", np.array(points, np.float32).ravel())
    if radii is not None:
        layer = cloud.attributes.get("radius") or cloud.attributes.new("radius", "FLOAT", "POINT")
        layer.data.foreach_set("value", np.array(radii, np.float32))
    subject = bpy.data.objects.new(name, cloud)
    bpy.context.scene.collection.objects.link(subject)
    return subject


def show(node_type: str, output: str) -> bpy.types.Material:
    """A material that glows with what a node gives."""
    material = bpy.data.materials.new("Show")
    tree = material.node_tree
    tree.nodes.clear()
    emission = tree.nodes.new("ShaderNodeEmission")
    source = tree.nodes.new(node_type)
    tree.links.new(source.outputs[output], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def look_down(scene: bpy.types.Scene, width: float) -> None:
    """An orthographic camera above the origin."""
    bpy.ops.object.camera_add(location=(0.0, 0.0, 20.0))
    scene.camera = bpy.context.object
    scene.camera.data.type = "ORTHO"
    scene.camera.data.ortho_scale = width


def assert_same_picture(render: Render, edge_share: float = 0.15) -> None:
    """Equal but for pixels on edges, where each engine's samples fall elsewhere."""
    cycles = bpy.context.scene.cycles
    cycles.pixel_filter_type, cycles.filter_width = "GAUSSIAN", 0.01  # all samples at the pixel's centre
    ours, theirs = (render(engine, width=24, height=24, samples=4) for engine in ("LUCH", "CYCLES"))
    assert theirs[..., :3].any(), "the picture must show something"
    different = np.abs(ours - theirs).max(axis=2) > 2e-3 + 1e-3 * np.abs(theirs).max()
    assert different.mean() <= edge_share, f"{different.mean():.0%} of the pixels differ"
