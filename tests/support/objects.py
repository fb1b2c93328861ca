"""Objects that several tests of the add-on build."""

from __future__ import annotations

import bpy


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
