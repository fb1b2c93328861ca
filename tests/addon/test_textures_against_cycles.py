"""Texture nodes at the same coordinates: Cycles (an AOV of one sample per pixel) against our programs.

One Cycles render evaluates every case: a plane seen from above, whose material sends each texture to an
AOV of its own. Our side compiles a material per case and runs it at the positions that Cycles shaded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from luch import core
from numpy.typing import NDArray
from support import blender

F32 = NDArray[np.float32]
SIZE = 24  # pixels
COLOR_1, COLOR_2, COLOR_3 = (0.8, 0.2, 0.1, 1.0), (0.1, 0.5, 0.9, 1.0), (0.3, 0.4, 0.05, 1.0)


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


def noise_cases() -> list[Case]:
    inputs = {"W": 0.37, "Scale": 1.3, "Detail": 2.4, "Roughness": 0.6, "Lacunarity": 2.1, "Offset": 0.3, "Gain": 1.2}
    cases = []
    for dimensions in ("1D", "2D", "3D", "4D"):
        for kind in ("MULTIFRACTAL", "FBM", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN"):
            settings = {"noise_dimensions": dimensions, "noise_type": kind, "normalize": False}
            cases.append(Case(f"noise {dimensions} {kind}", "ShaderNodeTexNoise", "Fac", settings, inputs))
        settings = {"noise_dimensions": dimensions, "normalize": True}
        distorted = inputs | {"Distortion": 0.7}
        cases.append(Case(f"noise {dimensions} color", "ShaderNodeTexNoise", "Color", settings, distorted))
    far = inputs | {"Scale": 1e6}
    cases.append(Case("noise far away", "ShaderNodeTexNoise", "Fac", {}, far))
    cases.append(Case("noise generated", "ShaderNodeTexNoise", "Fac", {}, {}, "default"))
    return cases


def voronoi_cases() -> list[Case]:
    inputs = {"W": 0.37, "Scale": 1.3, "Roughness": 0.6, "Lacunarity": 2.1, "Smoothness": 0.7, "Exponent": 0.7}
    inputs |= {"Randomness": 0.9}
    cases = []

    def add(dimensions: str, feature: str, metric: str, output: str, detail: float = 0.0) -> None:
        settings = {"voronoi_dimensions": dimensions, "feature": feature, "distance": metric, "normalize": detail > 0}
        name = f"voronoi {dimensions} {feature} {metric} {output} {detail:g}"
        cases.append(Case(name, "ShaderNodeTexVoronoi", output, settings, inputs | {"Detail": detail}))

    for dimensions in ("1D", "2D", "3D", "4D"):
        for feature in ("F1", "F2", "SMOOTH_F1"):
            add(dimensions, feature, "EUCLIDEAN", "Color")
            add(dimensions, feature, "EUCLIDEAN", "W" if dimensions == "1D" else "Position", 2.6)
            if dimensions != "1D":
                for metric in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"):
                    add(dimensions, feature, metric, "Distance")
        add(dimensions, "DISTANCE_TO_EDGE", "EUCLIDEAN", "Distance")
        add(dimensions, "DISTANCE_TO_EDGE", "EUCLIDEAN", "Distance", 2.3)
        add(dimensions, "N_SPHERE_RADIUS", "EUCLIDEAN", "Radius")
    return cases


def pattern_cases() -> list[Case]:
    cases = []
    for kind in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE", "SPHERICAL"):
        cases.append(Case(f"gradient {kind}", "ShaderNodeTexGradient", "Color", {"gradient_type": kind}, {}, "up"))
    colors = {"Color1": COLOR_1, "Color2": COLOR_2, "Scale": 1.7}
    cases.append(Case("checker", "ShaderNodeTexChecker", "Color", {}, colors))
    for smooth in (0.1, 0.0):
        settings = {"offset": 0.3, "offset_frequency": 2, "squash": 0.6, "squash_frequency": 3}
        inputs = colors | {"Mortar": COLOR_3, "Mortar Size": 0.05, "Mortar Smooth": smooth, "Bias": -0.2}
        inputs |= {"Brick Width": 0.6, "Row Height": 0.3}
        cases.append(Case(f"brick {smooth}", "ShaderNodeTexBrick", "Color", settings, inputs))
    for depth in range(11):
        inputs = {"Scale": 1.3, "Distortion": 1.4}
        cases.append(Case(f"magic {depth}", "ShaderNodeTexMagic", "Color", {"turbulence_depth": depth}, inputs))
    for profile in ("SIN", "SAW", "TRI"):
        for kind, way in (("BANDS", "Y"), ("BANDS", "DIAGONAL"), ("RINGS", "Z"), ("RINGS", "SPHERICAL")):
            settings = {"wave_type": kind, f"{kind.lower()}_direction": way, "wave_profile": profile}
            inputs = {"Scale": 0.3, "Distortion": 1.5, "Detail": 2.3, "Detail Scale": 1.2, "Phase Offset": 0.4}
            cases.append(Case(f"wave {kind} {way} {profile}", "ShaderNodeTexWave", "Fac", settings, inputs))
    for dimensions in ("1D", "2D", "3D", "4D"):
        settings = {"noise_dimensions": dimensions}
        cases.append(Case(f"white noise {dimensions}", "ShaderNodeTexWhiteNoise", "Color", settings, {"W": 0.37}))
    for kind in ("2D", "3D"):
        for output in ("Value", "Phase", "Intensity"):
            inputs = {"Scale": 1.1, "Frequency": 2.3, "Anisotropy": 0.3, "Orientation 2D": 0.6}
            cases.append(Case(f"gabor {kind} {output}", "ShaderNodeTexGabor", output, {"gabor_type": kind}, inputs))
    return cases


def spectrum_cases() -> list[Case]:
    cases = []
    for kelvin in (500.0, 1200.0, 3000.0, 6500.0, 11000.0, 15000.0):
        name, inputs = f"blackbody {kelvin:g}", {"Temperature": kelvin}
        cases.append(Case(name, "ShaderNodeBlackbody", "Color", {}, inputs, "default", tolerance=1e-3))
    for nm in (400.0, 452.0, 500.0, 573.0, 620.0, 699.0, 800.0):
        name, inputs = f"wavelength {nm:g}", {"Wavelength": nm}
        cases.append(Case(name, "ShaderNodeWavelength", "Color", {}, inputs, "default", tolerance=1e-3))
    return cases


def sky_cases() -> list[Case]:
    cases = []
    for kind, tolerance in (("MULTIPLE_SCATTERING", 2e-3), ("SINGLE_SCATTERING", 2e-3)):
        for elevation, altitude in ((0.4, 100.0), (0.02, 3000.0)):
            settings = {"sky_type": kind, "sun_elevation": elevation, "sun_rotation": 0.8, "altitude": altitude}
            settings |= {"sun_disc": False, "air_density": 1.2, "aerosol_density": 0.7, "ozone_density": 1.4}
            for source in ("up", "down"):
                name = f"sky {kind} {elevation} {source}"
                cases.append(Case(name, "ShaderNodeTexSky", "Color", settings, {}, source, tolerance))
        settings = {"sky_type": kind, "sun_elevation": 0.6, "sun_size": 0.9, "sun_disc": True}
        # With a sun disc the node has no Vector: on a surface it reads the generated coordinates, unit or not.
        settings["sun_rotation"] = -0.6
        cases.append(Case(f"sun {kind}", "ShaderNodeTexSky", "Color", settings, {}, "default", tolerance, 0.01))
    settings = {"sky_type": "PREETHAM", "sun_direction": (0.3, 0.4, 0.866), "turbidity": 3.1}
    cases.append(Case("sky PREETHAM", "ShaderNodeTexSky", "Color", settings, {}, "up", tolerance=5e-4))
    return cases


IES_TEXT = (
    "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1.5 5 3 1 2 0 0 0 1 1 100\n0 30 60 90 120\n0 45 90\n"
    "900 800 500 200 0\n950 820 400 150 10\n700 650 480 260 20\n"
)


def set_ies_text(node: bpy.types.Node) -> None:
    text = bpy.data.texts.get("lamp.ies") or bpy.data.texts.new("lamp.ies")
    text.from_string(IES_TEXT)
    node.mode, node.ies = "INTERNAL", text


def set_mapping(node: bpy.types.Node) -> None:
    mapping = node.texture_mapping
    mapping.translation, mapping.rotation, mapping.scale = (0.3, -0.2, 0.1), (0.1, 0.5, -0.4), (1.5, 0.7, -1.1)
    mapping.mapping_x, mapping.mapping_y = "Y", "X"


def other_cases() -> list[Case]:
    ies = Case("ies", "ShaderNodeTexIES", "Fac", {"setup": set_ies_text}, {"Strength": 0.8}, "down", 1e-3)
    cases = [ies]
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):

        def setup(node: bpy.types.Node, kind: str = kind) -> None:
            node.texture_mapping.vector_type = kind
            set_mapping(node)

        cases.append(Case(f"mapping {kind}", "ShaderNodeTexNoise", "Color", {"setup": setup}))
    return cases


CASES = [*noise_cases(), *voronoi_cases(), *pattern_cases(), *spectrum_cases(), *sky_cases(), *other_cases()]


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


class Context:
    """The rest of the export, as far as programs ask."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.scene = bpy.context.scene
        self.view_layer = self.scene.view_layers[0]

    def warn(self, text: str) -> None:
        self.warnings.append(text)

    def image_index(self, image: bpy.types.Image | None, user: Any = None, *, tile: int = 0) -> int:
        raise AssertionError("no case here has an image")

    def object_matrix(self, obj: bpy.types.Object) -> Any:
        raise AssertionError("no case here asks for an object")


def our_pixels(case: Case, positions: F32) -> F32:
    from addon.export.nodes import compile_material

    tree = Tree(case.name)
    tree.tree.links.new(tree.add(case), tree.emission.inputs["Color"])
    context = Context()
    program = compile_material(tree.material, context).surface
    assert not context.warnings, context.warnings
    mesh = {"positions": np.zeros((3, 3), np.float32), "triangles": [0, 1, 2]}  # texture space of the plane: 1, 1, 1
    points = {"position": positions, "normal": np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1))}
    count = len(positions)
    arguments = (program.code, program.constants, program.register_count, program.tables, count)
    return core.shade.run_program(*arguments, points, {"mesh": mesh})["emission"]


@pytest.fixture(scope="module")
def cycles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, F32]:
    plane = plane_scene()
    tree = Tree("all")
    tree.aov("position", tree.position)
    for number, case in enumerate(CASES):
        tree.aov(f"case {number}", tree.add(case))
    return cycles_pixels(tree, plane, tmp_path_factory.mktemp("textures"))


@pytest.mark.parametrize("number", range(len(CASES)), ids=lambda k: CASES[k].name)
def test_texture_node_gives_what_cycles_gives(number: int, cycles: dict[str, F32]) -> None:
    case = CASES[number]
    reference = cycles[f"case {number}"]
    picture = our_pixels(case, cycles["position"])
    difference = np.abs(picture - reference).max(axis=1)
    limit = case.tolerance * max(1.0, float(np.abs(reference).max()))
    wrong = difference > limit
    worst = int(difference.argmax())
    assert wrong.mean() <= case.outliers, (
        f"{wrong.sum()} of {wrong.size} pixels differ by more than {limit:.1e}; worst {difference[worst]:.2e} at"
        f" {cycles['position'][worst]}: {picture[worst]} against {reference[worst]}"
    )
