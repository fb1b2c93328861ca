"""Texture nodes: every one is an operation of native/include/luch/shade/textures/ or two."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from luch import sky, spectrum, textures
from luch.bounds import LEAST_MAPPING_SCALE
from luch.ies import IesError, constant_ies, parse_ies
from luch.shader import Value, Vector, float_word
from numpy.typing import NDArray

from .inputs import generated, position, uv
from .tree import Compiler, Outputs, emitter


def texture_vector(c: Compiler, node: bpy.types.Node, default: Callable[[Compiler], Vector] = generated) -> Vector:
    """The Vector input, ``default`` where nothing is linked, through the node's own (old) mapping."""
    vector = c.vector_or(node, "Vector", lambda: default(c))
    mapping = getattr(node, "texture_mapping", None)
    return vector if mapping is None else map_vector(c, vector, mapping)


def map_vector(c: Compiler, vector: Vector, mapping: bpy.types.TexMapping) -> Vector:
    """Texture Mapping of a node (its Sidebar panel): projection, then scale, rotation and translation."""
    matrix = mapping_matrix(mapping)
    b = c.builder
    if not np.array_equal(matrix, np.eye(3, 4)):
        rows = []
        for row in matrix:
            total = b.constant(float(row[3]))
            for k in range(3):
                total = b.op1("MATH_ADD", (total, b.multiply(vector[k], b.constant(float(row[k])))))
            rows.append(total)
        vector = rows[0], rows[1], rows[2]
    if mapping.use_min:
        vector = b.each("MATH_MAXIMUM", vector, b.vector(*mapping.min))
    if mapping.use_max:
        vector = b.each("MATH_MINIMUM", vector, b.vector(*mapping.max))
    return b.op3("VECTOR_NORMALIZE", vector) if mapping.vector_type == "NORMAL" else vector


def mapping_matrix(mapping: bpy.types.TexMapping) -> NDArray[np.float64]:
    """The (3, 4) matrix of a Texture Mapping."""
    kind = mapping.vector_type
    scale = np.array(mapping.scale, np.float64)
    if kind in ("TEXTURE", "NORMAL"):  # these divide
        scale = np.where(np.abs(scale) < LEAST_MAPPING_SCALE, np.copysign(LEAST_MAPPING_SCALE, scale), scale)
    linear = np.array(mapping.rotation.to_matrix(), np.float64)
    linear = linear @ np.diag(1.0 / scale if kind == "NORMAL" else scale)
    offset = np.zeros(3) if kind in ("VECTOR", "NORMAL") else np.array(mapping.translation, np.float64)
    if kind == "TEXTURE":
        linear = np.linalg.inv(linear)
        offset = -linear @ offset
    axes = np.zeros((3, 3))
    for row, source in enumerate((mapping.mapping_x, mapping.mapping_y, mapping.mapping_z)):
        if source != "NONE":
            axes[row, "XYZ".index(source)] = 1.0
    return np.column_stack([linear @ axes, offset])


def floats(c: Compiler, node: bpy.types.Node, sockets: tuple[str, ...], unused: tuple[str, ...] = ()) -> list[Value]:
    """One value per socket; those named unused are not followed and are zero."""
    return [c.builder.constant(0.0) if name in unused else c.float(node, name) for name in sockets]


def dimension_inputs(
    c: Compiler, node: bpy.types.Node, dimensions: str, sockets: tuple[str, ...], unused: tuple[str, ...]
) -> list[Value]:
    """Vector (unless 1D), then the sockets, W only for 1D and 4D."""
    vector = c.builder.vector(0.0, 0.0, 0.0) if dimensions == "1D" else texture_vector(c, node)
    without = unused if dimensions in ("1D", "4D") else (*unused, "W")
    return [*vector, *floats(c, node, sockets, without)]


@emitter("ShaderNodeTexNoise")
def noise(c: Compiler, node: bpy.types.ShaderNodeTexNoise) -> Outputs:
    """Noise Texture; its colour costs three times the value and is left out where nobody asks."""
    kind = node.noise_type
    gain = ("HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL")
    unused = () if kind in gain else ("Gain",) if kind == "HETERO_TERRAIN" else ("Gain", "Offset")
    inputs = dimension_inputs(c, node, node.noise_dimensions, textures.NOISE_SOCKETS, unused)
    params = (textures.NOISE_TYPES[kind], int(node.normalize))
    if not c.output_used(node, "Color"):
        return {"Fac": c.builder.op1(f"NOISE_{node.noise_dimensions}", inputs, params)}
    value, red, green, blue = c.builder.op(f"NOISE_COLOR_{node.noise_dimensions}", inputs, params)
    return {"Fac": value, "Color": (red, green, blue)}


@emitter("ShaderNodeTexVoronoi")
def voronoi(c: Compiler, node: bpy.types.ShaderNodeTexVoronoi) -> Outputs:
    """Voronoi Texture; outputs that a feature does not have are zero, as in Cycles."""
    dimensions, feature = node.voronoi_dimensions, node.feature
    metric = "EUCLIDEAN" if dimensions == "1D" else node.distance
    unused = (
        *(() if feature == "SMOOTH_F1" else ("Smoothness",)),
        *(() if metric == "MINKOWSKI" else ("Exponent",)),
    )
    inputs = dimension_inputs(c, node, dimensions, textures.VORONOI_SOCKETS, unused)
    b = c.builder
    none, black = b.constant(0.0), b.vector(0.0, 0.0, 0.0)
    outputs: Outputs = {"Distance": none, "Color": black, "Position": black, "W": none, "Radius": none}
    if feature == "DISTANCE_TO_EDGE":
        outputs["Distance"] = b.op1(f"VORONOI_EDGE_{dimensions}", inputs, (int(node.normalize),))
    elif feature == "N_SPHERE_RADIUS":
        outputs["Radius"] = b.op1(f"VORONOI_RADIUS_{dimensions}", inputs)
    else:
        params = (textures.VORONOI_FEATURES[feature], textures.VORONOI_METRICS[metric], int(node.normalize))
        out = b.op(f"VORONOI_{dimensions}", inputs, params)
        outputs |= {"Distance": out[0], "Color": out[1:4], "Position": out[4:7], "W": out[7]}  # type: ignore[dict-item]
    return outputs


@emitter("ShaderNodeTexWhiteNoise")
def white_noise(c: Compiler, node: bpy.types.ShaderNodeTexWhiteNoise) -> Outputs:
    """White Noise Texture."""
    dimensions = node.noise_dimensions
    vector = c.builder.vector(0.0, 0.0, 0.0) if dimensions == "1D" else c.vector(node, "Vector")
    w = c.float(node, "W") if dimensions in ("1D", "4D") else c.builder.constant(0.0)
    value, red, green, blue = c.builder.op(f"WHITE_NOISE_{dimensions}", (*vector, w))
    return {"Value": value, "Color": (red, green, blue)}


@emitter("ShaderNodeTexGabor")
def gabor(c: Compiler, node: bpy.types.ShaderNodeTexGabor) -> Outputs:
    """Gabor Texture."""
    kind = node.gabor_type
    inputs = [*texture_vector(c, node), *floats(c, node, ("Scale", "Frequency", "Anisotropy"))]
    inputs.append(c.float(node, "Orientation 2D") if kind == "2D" else c.builder.constant(0.0))
    inputs.extend(c.vector(node, "Orientation 3D") if kind == "3D" else c.builder.vector(0.0, 0.0, 1.0))
    value, phase, intensity = c.builder.op(f"GABOR_{kind}", inputs)
    return {"Value": value, "Phase": phase, "Intensity": intensity}


@emitter("ShaderNodeTexGradient")
def gradient(c: Compiler, node: bpy.types.ShaderNodeTexGradient) -> Outputs:
    """Gradient Texture."""
    params = (textures.GRADIENT_TYPES[node.gradient_type],)
    factor = c.builder.op1("GRADIENT", texture_vector(c, node), params)
    return {"Color": (factor, factor, factor), "Fac": factor}


@emitter("ShaderNodeTexWave")
def wave(c: Compiler, node: bpy.types.ShaderNodeTexWave) -> Outputs:
    """Wave Texture."""
    rings = node.wave_type == "RINGS"
    direction = textures.WAVE_DIRECTIONS[node.rings_direction if rings else node.bands_direction]
    inputs = [*texture_vector(c, node), *floats(c, node, textures.WAVE_SOCKETS)]
    factor = c.builder.op1("WAVE", inputs, (int(rings), direction, textures.WAVE_PROFILES[node.wave_profile]))
    return {"Color": (factor, factor, factor), "Fac": factor}


@emitter("ShaderNodeTexChecker")
def checker(c: Compiler, node: bpy.types.ShaderNodeTexChecker) -> Outputs:
    """Checker Texture."""
    inputs = [*texture_vector(c, node), *c.color(node, "Color1"), *c.color(node, "Color2"), c.float(node, "Scale")]
    red, green, blue, factor = c.builder.op("CHECKER", inputs)
    return {"Color": (red, green, blue), "Fac": factor}


@emitter("ShaderNodeTexBrick")
def brick(c: Compiler, node: bpy.types.ShaderNodeTexBrick) -> Outputs:
    """Brick Texture."""
    colors = [value for name in ("Color1", "Color2", "Mortar") for value in c.color(node, name)]
    inputs = [*texture_vector(c, node), *colors, *floats(c, node, textures.BRICK_SOCKETS)]
    params = textures.brick_params(node.offset, node.offset_frequency, node.squash, node.squash_frequency)
    red, green, blue, factor = c.builder.op("BRICK", inputs, params)
    return {"Color": (red, green, blue), "Fac": factor}


@emitter("ShaderNodeTexMagic")
def magic(c: Compiler, node: bpy.types.ShaderNodeTexMagic) -> Outputs:
    """Magic Texture."""
    inputs = [*texture_vector(c, node), *floats(c, node, ("Scale", "Distortion"))]
    red, green, blue, factor = c.builder.op("MAGIC", inputs, (node.turbulence_depth,))
    return {"Color": (red, green, blue), "Fac": factor}


@emitter("ShaderNodeTexImage")
def image(c: Compiler, node: bpy.types.ShaderNodeTexImage) -> Outputs:
    """Image Texture."""
    vector = texture_vector(c, node, uv)
    flags = textures.UNASSOCIATE if c.output_used(node, "Alpha") else 0
    look_up = (textures.INTERPOLATIONS[node.interpolation], textures.EXTENSIONS[node.extension])
    if node.projection == "BOX":
        normal = c.builder.op3("POINT_OBJECT_NORMAL")
        params = (image_slot(c, node), *look_up, float_word(node.projection_blend), flags)
        red, green, blue, alpha = c.builder.op("IMAGE_BOX", (*vector, *normal), params)
    else:
        if node.image is not None and node.image.source == "TILED":
            tiles = [(tile.number, image_slot(c, node, tile.number)) for tile in node.image.tiles]
            words = textures.tiled_image_params(tiles, node.interpolation, node.extension, node.projection, flags)
        else:
            words = (image_slot(c, node), *look_up, textures.PROJECTIONS[node.projection], flags)
        red, green, blue, alpha = c.builder.op("IMAGE", vector, words)
    return {"Color": (red, green, blue), "Alpha": alpha}


def image_slot(
    c: Compiler, node: bpy.types.ShaderNodeTexImage | bpy.types.ShaderNodeTexEnvironment, tile: int = 0
) -> int:
    """The program's slot of the node's image."""
    return c.builder.image(c.context.image_index(node.image, node.image_user, tile=tile))


@emitter("ShaderNodeTexEnvironment")
def environment(c: Compiler, node: bpy.types.ShaderNodeTexEnvironment) -> Outputs:
    """Environment Texture; unlinked, the direction of a world and the position of a surface."""
    params = (
        image_slot(c, node),
        textures.INTERPOLATIONS[node.interpolation],
        int(node.projection == "MIRROR_BALL"),
    )
    red, green, blue, _alpha = c.builder.op("ENVIRONMENT", texture_vector(c, node, position), params)
    return {"Color": (red, green, blue)}


@emitter("ShaderNodeTexSky")
def sky_texture(c: Compiler, node: bpy.types.ShaderNodeTexSky) -> Outputs:
    """Sky Texture; Hosek/Wilkie needs its authors' data, which Luch does not carry: Preetham stands in."""
    kind = node.sky_type
    vector = texture_vector(c, node)
    if kind in ("SINGLE_SCATTERING", "MULTIPLE_SCATTERING"):
        settings = sky.Atmosphere(
            multiple_scattering=kind == "MULTIPLE_SCATTERING",
            sun_disc=node.sun_disc,
            sun_size=node.sun_size,
            sun_intensity=node.sun_intensity,
            sun_elevation=node.sun_elevation,
            sun_rotation=node.sun_rotation,
            altitude=node.altitude,
            air_density=node.air_density,
            aerosol_density=node.aerosol_density,
            ozone_density=node.ozone_density,
        )
        table = c.builder.table(sky.atmosphere_table(settings))
        return {"Color": c.builder.op3("SKY_ATMOSPHERE", vector, (table,))}
    if kind == "HOSEK_WILKIE":
        c.warn(node, "uses the Preetham sky in place of Hosek/Wilkie; choose Multiple Scattering for a better sky")
    direction: Any = node.sun_direction
    table = c.builder.table(sky.preetham_table(tuple(direction), node.turbidity))
    return {"Color": c.builder.op3("SKY_PREETHAM", vector, (table,))}


@emitter("ShaderNodeTexIES")
def ies(c: Compiler, node: bpy.types.ShaderNodeTexIES) -> Outputs:
    """IES Texture."""
    vector = c.vector_or(node, "Vector", lambda: c.builder.op3("POINT_INCOMING"))
    table = c.builder.table(ies_table(c, node))
    return {"Fac": c.builder.op1("IES", (*vector, c.float(node, "Strength")), (table,))}


def ies_table(c: Compiler, node: bpy.types.ShaderNodeTexIES) -> NDArray[np.float32]:
    """The luminaire's table; constant (and a warning) if its text or file cannot be read."""
    try:
        if node.mode == "EXTERNAL":
            with open(bpy.path.abspath(node.filepath), encoding="latin-1") as file:
                return parse_ies(file.read())
        return parse_ies(node.ies.as_string() if node.ies else "")
    except (OSError, IesError) as error:
        c.warn(node, f"gives {constant_ies()[-1]:g} everywhere: {error}")
        return constant_ies()


@emitter("ShaderNodeBlackbody")
def blackbody(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Blackbody."""
    table = c.builder.table(spectrum.blackbody_table())
    return {"Color": c.builder.op3("BLACKBODY", (c.float(node, "Temperature"),), (table,))}


@emitter("ShaderNodeWavelength")
def wavelength(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Wavelength."""
    table = c.builder.table(spectrum.wavelength_table())
    return {"Color": c.builder.op3("WAVELENGTH", (c.float(node, "Wavelength"),), (table,))}


@emitter("ShaderNodeRadialTiling")
def radial_tiling(c: Compiler, node: bpy.types.Node) -> Outputs:
    """Radial Tiling; a fractional number of sides cannot be rounded yet."""
    tiling: Any = node
    x, y = c.vector(node, "Vector")[:2]  # the socket itself has two components
    sides, roundness = c.float(node, "Sides"), c.float(node, "Roundness")
    number = c.builder.known(sides)
    if (number is None or number % 1.0 != 0.0) and c.builder.known(roundness) != 0.0:
        c.warn(node, "shows sharp corners where its number of sides is not whole")
    out = c.builder.op("RADIAL_TILING", (x, y, sides, roundness), (int(tiling.normalize),))
    coordinates = out[0], out[1], c.builder.constant(0.0)
    return {
        "Segment Coordinates": coordinates,
        "Segment ID": out[2],
        "Segment Width": out[3],
        "Segment Rotation": out[4],
    }
