"""Settings of texture nodes -> static words of texture operations (shade/textures/*.h).

Names on the left are Blender's; the numbers are the native enums'. What an operation's inputs are is told
in a table at the top of its header; the lists here give the same order by socket.
"""

from __future__ import annotations

from luch.shader import float_word

# noise.h: after the vector (3 registers) come these sockets, one register each.
NOISE_SOCKETS = ("W", "Scale", "Detail", "Roughness", "Lacunarity", "Offset", "Gain", "Distortion")
NOISE_TYPES = {
    "MULTIFRACTAL": 0,
    "FBM": 1,
    "HYBRID_MULTIFRACTAL": 2,
    "RIDGED_MULTIFRACTAL": 3,
    "HETERO_TERRAIN": 4,
}
# voronoi.h: the same way.
VORONOI_SOCKETS = ("W", "Scale", "Detail", "Roughness", "Lacunarity", "Smoothness", "Exponent", "Randomness")
VORONOI_FEATURES = {"F1": 0, "F2": 1, "SMOOTH_F1": 2}
VORONOI_METRICS = {"EUCLIDEAN": 0, "MANHATTAN": 1, "CHEBYCHEV": 2, "MINKOWSKI": 3}
# patterns.h
GRADIENT_TYPES = {
    "LINEAR": 0,
    "QUADRATIC": 1,
    "EASING": 2,
    "DIAGONAL": 3,
    "RADIAL": 4,
    "QUADRATIC_SPHERE": 5,
    "SPHERICAL": 6,
}
WAVE_SOCKETS = ("Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset")
WAVE_DIRECTIONS = {"X": 0, "Y": 1, "Z": 2, "DIAGONAL": 3, "SPHERICAL": 3}
WAVE_PROFILES = {"SIN": 0, "SAW": 1, "TRI": 2}
BRICK_SOCKETS = ("Scale", "Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")
# image_nodes.h
INTERPOLATIONS = {"Linear": 0, "Closest": 1, "Cubic": 2, "Smart": 2}
EXTENSIONS = {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}
PROJECTIONS = {"FLAT": 0, "SPHERE": 1, "TUBE": 2}
UNASSOCIATE, TILED = 1, 2


def brick_params(offset: float, offset_frequency: int, squash: float, squash_frequency: int) -> tuple[int, ...]:
    """Words of BRICK."""
    return float_word(offset), offset_frequency, float_word(squash), squash_frequency


def tiled_image_params(
    tiles: list[tuple[int, int]], interpolation: str, extension: str, projection: str, flags: int
) -> tuple[int, ...]:
    """Words of IMAGE for a UDIM: tiles are pairs (tile number, image slot)."""
    words = [len(tiles), INTERPOLATIONS[interpolation], EXTENSIONS[extension], PROJECTIONS[projection], flags | TILED]
    for number, slot in tiles:
        words += [number, slot]
    return tuple(words)
