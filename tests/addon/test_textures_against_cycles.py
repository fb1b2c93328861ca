"""Texture nodes at the same coordinates: Cycles (an AOV of one sample per pixel) against our programs.

One Cycles render evaluates every case: a plane seen from above, whose material sends each texture to an
AOV of its own. Our side compiles a material per case and runs it at the positions that Cycles shaded.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray
from support.textures import Case, assert_same_pixels, cycles_of_cases, our_pixels

F32 = NDArray[np.float32]
COLOR_1, COLOR_2, COLOR_3 = (0.8, 0.2, 0.1, 1.0), (0.1, 0.5, 0.9, 1.0), (0.3, 0.4, 0.05, 1.0)


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


def tiling_cases() -> list[Case]:
    cases = []
    shapes = ((5.0, 0.0), (5.0, 0.3), (6.0, 1.0), (4.6, 0.0), (2.0, 0.0), (1.0, 0.0))
    for normalize in (True, False):
        for sides, roundness in shapes:
            for output in ("Segment Coordinates", "Segment ID", "Segment Width", "Segment Rotation"):
                name = f"tiling {sides} {roundness} {normalize} {output}"
                inputs = {"Sides": sides, "Roundness": roundness}
                settings = {"normalize": normalize}
                # Angles on the border of two segments may fall to either.
                case = Case(name, "ShaderNodeRadialTiling", output, settings, inputs, "up", 1e-3, outliers=0.005)
                cases.append(case)
    return cases


CASES = [
    *noise_cases(),
    *voronoi_cases(),
    *pattern_cases(),
    *spectrum_cases(),
    *sky_cases(),
    *other_cases(),
    *tiling_cases(),
]


@pytest.fixture(scope="module")
def cycles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, F32]:
    return cycles_of_cases(CASES, tmp_path_factory.mktemp("textures"))


@pytest.mark.parametrize("number", range(len(CASES)), ids=lambda k: CASES[k].name)
def test_texture_node_gives_what_cycles_gives(number: int, cycles: dict[str, F32]) -> None:
    case = CASES[number]
    ours = our_pixels(case, cycles["position"])
    assert_same_pixels(case, ours, cycles[f"case {number}"], cycles["position"])
