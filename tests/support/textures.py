"""Texture nodes at the same coordinates, by Cycles and by our programs.

One Cycles render evaluates every case: a plane seen from above, whose material sends each texture to an
AOV of its own. Our side compiles a material per case and runs it at the positions that Cycles shaded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import luch.scene
import numpy as np
from luch import core
from numpy.typing import NDArray

from addon.export.images import export_image
from addon.export.nodes import compile_material
from support import blender

F32 = NDArray[np.float32]
SIZE = 24  # pixels
ALPHA = ("STRAIGHT", "PREMULTIPLIED", "CHANNEL_PACKED", "NONE")


@dataclass
class Case:
    """A texture node, how it is set, which output is looked at."""

    name: str
    kind: str
    output: str
    settings: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, Any] = field(default_factory=dict)
    source: str = "point"  # what feeds Vector: "point", "up", "down", "default" (nothing)
    tolerance: float = 1e-4  # of the largest value
    outliers: float = 0.0  # share of pixels that may lie on the other side of an edge


class Tree:
    """A material's tree with the three sources of coordinates."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.emission = self.new("ShaderNodeEmission")
        output = self.new("ShaderNodeOutputMaterial")
        self.tree.links.new(self.emission.outputs[0], output.inputs[0])
        self.position = self.new("ShaderNodeNewGeometry").outputs["Position"]
        self.sources = {
            "point": self.math("MULTIPLY_ADD", self.tilted(), (3.7, 2.9, 1.0), (-5.1, -3.3, 0.7)),
            "up": self.math("NORMALIZE", self.math("ADD", self.position, (0.0, 0.0, 0.35))),
            "down": self.math("NORMALIZE", self.math("ADD", self.position, (0.1, 0.0, -0.3))),
        }

    def new(self, kind: str) -> bpy.types.Node:
        return self.tree.nodes.new(kind)

    def math(self, operation: str, vector: bpy.types.NodeSocket, *constants: tuple[float, ...]) -> bpy.types.NodeSocket:
        node = self.new("ShaderNodeVectorMath")
        node.operation = operation
        self.tree.links.new(vector, node.inputs[0])
        for socket, constant in zip(list(node.inputs)[1:], constants, strict=False):
            socket.default_value = constant
        return node.outputs["Value"] if operation == "DOT_PRODUCT" else node.outputs[0]

    def tilted(self) -> bpy.types.NodeSocket:
        """Position with z = 0.7 x + 1.3 y, so that no coordinate is constant."""
        separate, combine = self.new("ShaderNodeSeparateXYZ"), self.new("ShaderNodeCombineXYZ")
        self.tree.links.new(self.position, separate.inputs[0])
        for k in range(2):
            self.tree.links.new(separate.outputs[k], combine.inputs[k])
        self.tree.links.new(self.math("DOT_PRODUCT", self.position, (0.7, 1.3, 0.0)), combine.inputs[2])
        return combine.outputs[0]

    def add(self, case: Case) -> bpy.types.NodeSocket:
        node = self.new(case.kind)
        for name, value in case.settings.items():
            value(node) if name == "setup" else setattr(node, name, value)
        for socket in node.inputs:
            if socket.name in case.inputs:
                socket.default_value = case.inputs[socket.name]
        vector = node.inputs.get("Vector")
        if vector is not None and vector.enabled and case.source != "default":
            self.tree.links.new(self.sources[case.source], vector)
        return next(socket for socket in node.outputs if socket.identifier == case.output)

    def aov(self, name: str, socket: bpy.types.NodeSocket) -> None:
        node = self.new("ShaderNodeOutputAOV")
        node.aov_name = name
        self.tree.links.new(socket, node.inputs["Color"])
        layer = bpy.context.scene.view_layers[0].aovs.add()
        layer.name, layer.type = name, "COLOR"


def plane_scene() -> bpy.types.Object:
    scene = blender.empty_scene()
    bpy.ops.mesh.primitive_plane_add(size=2)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 2.0
    viewer = bpy.data.objects.new("Camera", camera)
    viewer.location = (0.0, 0.0, 3.0)
    scene.collection.objects.link(viewer)
    scene.camera = viewer
    scene.cycles.pixel_filter_type = "BOX"
    return next(obj for obj in scene.objects if obj.type == "MESH")


def cycles_pixels(tree: Tree, plane: bpy.types.Object, folder: Path) -> dict[str, F32]:
    """AOV -> float32 (pixels, 3)."""
    plane.data.materials.clear()
    plane.data.materials.append(tree.material)
    passes = blender.render_passes("CYCLES", folder, width=SIZE, height=SIZE, samples=1)
    return {name: pixels.reshape(SIZE * SIZE, -1)[:, :3] for name, pixels in passes.items()}


def cycles_of_cases(cases: Sequence[Case], folder: Path) -> dict[str, F32]:
    """Cycles' pixels of "position" and of "case 0", "case 1", ...: one render shows them all, each as an AOV."""
    plane = plane_scene()
    tree = Tree("all")
    tree.aov("position", tree.position)
    for number, case in enumerate(cases):
        tree.aov(f"case {number}", tree.add(case))
    return cycles_pixels(tree, plane, folder)


class Context:
    """The rest of the export, as far as programs ask."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.images: list[luch.scene.Image] = []
        self.scene = bpy.context.scene
        self.view_layer = self.scene.view_layers[0]
        self.frame = self.scene.frame_current

    def warn(self, text: str, effect: str = "") -> None:
        self.warnings.append(text)

    def image_index(self, image: bpy.types.Image | None, user: Any = None, *, tile: int = 0) -> int:
        self.images.append(export_image(image, user, tile, self))
        return len(self.images) - 1

    def object_matrix(self, obj: bpy.types.Object) -> Any:
        raise AssertionError("no case here asks for an object")


def our_pixels(case: Case, positions: F32) -> F32:
    tree = Tree(case.name)
    tree.tree.links.new(tree.add(case), tree.emission.inputs["Color"])
    context = Context()
    program = compile_material(tree.material, context).surface
    assert not context.warnings, context.warnings
    mesh = {"positions": np.zeros((3, 3), np.float32), "triangles": [0, 1, 2]}  # texture space of the plane: 1, 1, 1
    points = {"position": positions, "normal": np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1))}
    count = len(positions)
    arguments = (program.code, program.constants, program.register_count, program.tables, count)
    images = [(i.pixels, i.colorspace == "SRGB", ALPHA.index(i.alpha)) for i in context.images]
    return np.asarray(core.shade.run_program(*arguments, points, {"mesh": mesh, "images": images})["emission"])


def assert_same_pixels(case: Case, ours: F32, reference: F32, positions: F32) -> None:
    """Fails unless all pixels but the case's outliers agree within its tolerance."""
    difference = np.abs(ours - reference).max(axis=1)
    limit = case.tolerance * max(1.0, float(np.abs(reference).max()))
    wrong = ~(difference <= limit)
    worst = int(difference.argmax())
    assert wrong.mean() <= case.outliers, (
        f"{wrong.sum()} of {wrong.size} pixels differ by more than {limit:.1e}; worst {difference[worst]:.2e} at"
        f" {positions[worst]}: {ours[worst]} against {reference[worst]}"
    )
