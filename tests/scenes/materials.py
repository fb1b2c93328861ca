"""The demo's materials: Principled BSDF and procedural textures only."""

from __future__ import annotations

from collections.abc import Callable

import bpy

Rgb = tuple[float, float, float]


class Tree:
    """Building a node tree in a few words; sockets go by identifier (names differ between versions)."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, inputs: dict[str | int, object] | None = None, **properties: object) -> bpy.types.Node:
        """A new node; inputs: name, identifier or index -> value or the socket to link from."""
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        for name, value in (inputs or {}).items():
            if isinstance(name, int):
                socket = node.inputs[name]
            else:
                socket = next(s for s in node.inputs if s.enabled and name in (s.name, s.identifier))
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node

    def math(self, operation: str, *inputs: object) -> bpy.types.NodeSocket:
        return self.node("ShaderNodeMath", dict(enumerate(inputs)), operation=operation).outputs[0]

    def vector_math(self, operation: str, *inputs: object) -> bpy.types.NodeSocket:
        return self.node("ShaderNodeVectorMath", dict(enumerate(inputs)), operation=operation).outputs[0]

    def ramp(self, factor: bpy.types.NodeSocket, stops: list[tuple[float, Rgb]]) -> bpy.types.NodeSocket:
        node = self.tree.nodes.new("ShaderNodeValToRGB")
        elements = node.color_ramp.elements
        while len(elements) < len(stops):
            elements.new(0.5)
        for element, (position, color) in zip(elements, stops, strict=True):
            element.position, element.color = position, (*color, 1.0)
        self.tree.links.new(factor, node.inputs[0])
        return node.outputs["Color"]

    def object_space(self, scale: Rgb = (1, 1, 1), turn: Rgb = (0, 0, 0)) -> bpy.types.NodeSocket:
        place = self.node("ShaderNodeTexCoord").outputs["Object"]
        mapped = self.node("ShaderNodeMapping", {"Vector": place, "Scale": scale, "Rotation": turn})
        return mapped.outputs["Vector"]

    def bump(self, height: bpy.types.NodeSocket, strength: float, distance: float = 0.01) -> bpy.types.NodeSocket:
        node = self.node("ShaderNodeBump", {"Height": height, "Strength": strength, "Distance": distance})
        return node.outputs["Normal"]


def material(name: str, build: Callable[[Tree], dict[str, object]] | None = None, **inputs: object) -> bpy.types.Material:  # fmt: skip
    """A Principled material. inputs: socket names with _ for spaces; build(tree) may add linked ones."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.node_tree.nodes.clear()
    tree = Tree(made.node_tree)
    values: dict[str, object] = {key.replace("_", " "): value for key, value in inputs.items()}
    values.update(build(tree) if build else {})
    values = {key: (*value, 1.0) if _is_rgb(key, value) else value for key, value in values.items()}
    shader = tree.node("ShaderNodeBsdfPrincipled", values)
    tree.node("ShaderNodeOutputMaterial", {"Surface": shader.outputs["BSDF"]})
    return made


def _is_rgb(key: str, value: object) -> bool:
    return isinstance(value, tuple) and len(value) == 3 and ("Color" in key or "Tint" in key)


def metal(name: str, color: Rgb, roughness: float, **inputs: object) -> bpy.types.Material:
    return material(name, Base_Color=color, Metallic=1.0, Roughness=roughness, **inputs)


def glass(name: str, color: Rgb = (1, 1, 1), roughness: float = 0.0, ior: float = 1.5) -> bpy.types.Material:
    return material(name, Base_Color=color, Roughness=roughness, IOR=ior, Transmission_Weight=1.0)


def glow(name: str, color: Rgb, strength: float) -> bpy.types.Material:
    return material(name, Base_Color=(0.8, 0.8, 0.8), Emission_Color=color, Emission_Strength=strength)


def parquet() -> bpy.types.Material:
    """Oak planks: brick pattern, a tone per plank, grain along it, worn varnish."""

    def build(tree: Tree) -> dict[str, object]:
        planks = tree.node(
            "ShaderNodeTexBrick",
            {
                "Vector": tree.object_space(turn=(0, 0, 1.5707964)),
                "Color1": (0, 0, 0, 1), "Color2": (1, 1, 1, 1), "Mortar": (0.5, 0.5, 0.5, 1), "Scale": 1.0,
                "Mortar Size": 0.0016, "Mortar Smooth": 0.3, "Brick Width": 1.1, "Row Height": 0.13,
            },
            offset=0.37,
        )  # fmt: skip
        tone = tree.node("ShaderNodeSeparateColor", {"Color": planks.outputs["Color"]}).outputs[0]
        shift = tree.node("ShaderNodeCombineXYZ", {"X": tone, "Y": tone, "Z": tone}).outputs[0]
        along = tree.object_space(scale=(16.0, 1.1, 1.0))
        place = tree.vector_math("MULTIPLY_ADD", shift, (31.0, 17.0, 7.0), along)
        grain = tree.node(
            "ShaderNodeTexNoise",
            {"Vector": place, "Scale": 2.4, "Detail": 6.0, "Roughness": 0.62, "Distortion": 0.9},
        ).outputs[0]
        wood = tree.ramp(
            grain, [(0.28, (0.115, 0.052, 0.022)), (0.5, (0.24, 0.125, 0.056)), (0.75, (0.36, 0.21, 0.105))]
        )
        shade = tree.node("ShaderNodeMapRange", {"Value": tone, "To Min": 0.72, "To Max": 1.16}).outputs[0]
        toned = tree.node("ShaderNodeVectorMath", {0: wood, "Scale": shade}, operation="SCALE").outputs[0]
        joint = planks.outputs[1]  # 1 in the joints
        color = tree.node(
            "ShaderNodeMix", {"Factor_Float": joint, "A_Color": toned, "B_Color": (0.03, 0.015, 0.008, 1)},
            data_type="RGBA",
        ).outputs[2]  # fmt: skip
        rough = tree.node("ShaderNodeMapRange", {"Value": grain, "To Min": 0.42, "To Max": 0.26}).outputs[0]
        relief = tree.math("MULTIPLY_ADD", joint, -1.0, grain)
        return {"Base Color": color, "Roughness": rough, "Normal": tree.bump(relief, 0.25, 0.004)}

    return material("Oak parquet", build)


def plaster(name: str, color: Rgb) -> bpy.types.Material:
    """Painted plaster: flat colour, a hand's unevenness."""

    def build(tree: Tree) -> dict[str, object]:
        noise = tree.node("ShaderNodeTexNoise", {"Vector": tree.object_space(), "Scale": 22.0, "Detail": 5.0})
        return {"Normal": tree.bump(noise.outputs[0], 0.12, 0.01)}

    return material(name, build, Base_Color=color, Roughness=0.85)


def walnut() -> bpy.types.Material:
    def build(tree: Tree) -> dict[str, object]:
        wave = tree.node(
            "ShaderNodeTexWave",
            {"Vector": tree.object_space(scale=(0.35, 1.0, 2.2)), "Scale": 3.2, "Distortion": 6.5, "Detail": 4.0,
             "Detail Scale": 1.6},
            bands_direction="Z",
        )  # fmt: skip
        color = tree.ramp(
            wave.outputs[1], [(0.1, (0.055, 0.026, 0.013)), (0.6, (0.115, 0.055, 0.027)), (1.0, (0.17, 0.09, 0.045))]
        )
        return {"Base Color": color, "Normal": tree.bump(wave.outputs[1], 0.06, 0.003)}

    return material("Walnut", build, Roughness=0.33)


def marble() -> bpy.types.Material:
    def build(tree: Tree) -> dict[str, object]:
        place = tree.object_space(scale=(1.6, 1.6, 1.6), turn=(0.3, 0.5, 0.9))
        cloud = tree.node("ShaderNodeTexNoise", {"Vector": place, "Scale": 2.2, "Detail": 8.0, "Distortion": 1.4})
        thin = tree.math("ABSOLUTE", tree.math("SUBTRACT", cloud.outputs[0], 0.5))
        color = tree.ramp(thin, [(0.0, (0.2, 0.19, 0.18)), (0.035, (0.62, 0.6, 0.57)), (0.16, (0.86, 0.85, 0.82))])
        return {"Base Color": color}

    return material("Marble", build, Roughness=0.12, Coat_Weight=0.4, Coat_Roughness=0.04)


def rug() -> bpy.types.Material:
    """Concentric woven bands, broken up by the weave."""

    def build(tree: Tree) -> dict[str, object]:
        place = tree.object_space()
        bands = tree.node(
            "ShaderNodeTexWave", {"Vector": place, "Scale": 1.7, "Distortion": 0.4, "Detail": 2.0, "Detail Scale": 3.0},
            wave_type="RINGS", rings_direction="Z", wave_profile="SIN",
        ).outputs[1]  # fmt: skip
        weave = tree.node("ShaderNodeTexVoronoi", {"Vector": place, "Scale": 110.0}).outputs["Distance"]
        color = tree.ramp(
            bands,
            [
                (0.0, (0.62, 0.55, 0.44)),
                (0.46, (0.6, 0.52, 0.41)),
                (0.54, (0.115, 0.16, 0.2)),
                (1.0, (0.08, 0.12, 0.16)),
            ],
        )
        return {"Base Color": color, "Normal": tree.bump(weave, 0.8, 0.01)}

    return material("Rug", build, Roughness=0.95, Sheen_Weight=0.3, Sheen_Roughness=0.5)


def velvet(color: Rgb) -> bpy.types.Material:
    def build(tree: Tree) -> dict[str, object]:
        nap = tree.node("ShaderNodeTexNoise", {"Vector": tree.object_space(), "Scale": 5.0, "Detail": 3.0}).outputs[0]
        dark = tuple(0.72 * channel for channel in color)
        return {"Base Color": tree.ramp(nap, [(0.3, dark), (0.7, color)])}

    return material(
        "Velvet", build, Roughness=0.85, Sheen_Weight=0.7, Sheen_Roughness=0.35, Sheen_Tint=(1.0, 0.85, 0.6)
    )


def glaze(name: str, color: Rgb) -> bpy.types.Material:
    """Ceramic under a clear coat, speckled."""

    def build(tree: Tree) -> dict[str, object]:
        specks = tree.node("ShaderNodeTexNoise", {"Vector": tree.object_space(), "Scale": 70.0, "Detail": 2.0}).outputs[
            0
        ]
        pale = tuple(min(1.0, 1.25 * channel + 0.05) for channel in color)
        return {"Base Color": tree.ramp(specks, [(0.36, tuple(0.5 * c for c in color)), (0.42, color), (0.75, pale)])}

    return material(name, build, Roughness=0.45, Coat_Weight=1.0, Coat_Roughness=0.03)
