"""What a Volume socket holds: an even medium, read off the tree as numbers.

Each emitter adds its node's part to a medium, times the weight that Mix Shader gave it. An input that is no number,
but changes from place to place, cannot be drawn yet: its node is named and left out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from luch import mie, spectrum
from luch.bounds import SHARPEST_PHASE
from luch.scene import Medium, Phase

from .tree import Compiler

Triple = tuple[float, float, float]
VolumeEmitter = Callable[[Compiler, Any, float, Medium], None]

EMITTERS: dict[str, VolumeEmitter] = {}
# The missing effect that an uneven medium is told under.
UNEVEN = "heterogeneous volumes"
# W/(m2 K4), in the unit of Principled Volume's blackbody: a millionth of radiance.
STEFAN_BOLTZMANN = 5.670373e-8 * 1e-6 / 3.141592653589793


class Uneven(Exception):
    """An input is not known before the volume is met."""


def emitter(*kinds: str) -> Callable[[VolumeEmitter], VolumeEmitter]:
    """Registers a function for nodes of these bl_idnames."""

    def register(function: VolumeEmitter) -> VolumeEmitter:
        EMITTERS.update(dict.fromkeys(kinds, function))
        return function

    return register


def compile_medium(c: Compiler, node: Any, identifier: str) -> Medium | None:
    """The medium that feeds a node's input; None if nothing comes of it."""
    medium = Medium()
    _follow(c, node, identifier, 1.0, medium)
    empty = not any((*medium.absorption, *medium.emission, *(part for p in medium.scattering for part in p.scattering)))
    return None if empty else medium


def _follow(c: Compiler, node: Any, identifier: str, weight: float, medium: Medium) -> None:
    source = c.source(node, identifier)
    if source is None or weight == 0.0:
        return
    emit = EMITTERS.get(source.bl_idname)
    if emit is None:
        c.warn(source, "is no volume; nothing of it is drawn in one")
        return
    try:
        emit(c, source, weight, medium)
    except Uneven:
        c.warn(source, "changes from place to place, which volumes cannot yet; this part of it is left out", UNEVEN)


def _known(c: Compiler, values: tuple[Any, ...]) -> tuple[float, ...]:
    numbers = c.builder.known_vector(values)
    if numbers is None:
        raise Uneven
    return numbers


def _number(c: Compiler, node: Any, identifier: str) -> float:
    return _known(c, (c.float(node, identifier),))[0]


def _color(c: Compiler, node: Any, identifier: str) -> Triple:
    """Negative parts mean nothing: 0."""
    r, g, b = (max(part, 0.0) for part in _known(c, c.vector(node, identifier)))
    return r, g, b


def _scaled(color: Triple, scale: float) -> Triple:
    return color[0] * scale, color[1] * scale, color[2] * scale


def _sum(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _absorb(c: Compiler, node: Any, medium: Medium, coefficient: Triple) -> None:
    if min(coefficient) < 0.0:
        c.warn(node, "would make light brighter where its colour is above 1; that part is taken as clear")
    r, g, b = (max(part, 0.0) for part in coefficient)
    medium.absorption = _sum(medium.absorption, (r, g, b))


def _glow(medium: Medium, radiance: Triple) -> None:
    medium.emission = _sum(medium.emission, radiance)


def _scatter(c: Compiler, node: Any, medium: Medium, coefficient: Triple) -> None:
    """By the phase function that the node has chosen."""
    if not any(coefficient):
        return
    add, kind = medium.scattering.append, node.phase
    if kind == "HENYEY_GREENSTEIN":
        add(Phase(kind, coefficient, _sharpness(_number(c, node, "Anisotropy"))))
    elif kind == "DRAINE":
        add(Phase(kind, coefficient, _sharpness(_number(c, node, "Anisotropy")), max(_number(c, node, "Alpha"), 0.0)))
    elif kind == "RAYLEIGH":
        add(Phase("DRAINE", coefficient, 0.0, 1.0))
    elif kind == "FOURNIER_FORAND":
        add(Phase(kind, coefficient, _number(c, node, "IOR"), _number(c, node, "Backscatter")))
    elif kind == "MIE":
        fog = mie.fit(_number(c, node, "Diameter"))
        share = fog.draine_share
        add(Phase("HENYEY_GREENSTEIN", _scaled(coefficient, 1.0 - share), _sharpness(fog.g_henyey_greenstein)))
        add(Phase("DRAINE", _scaled(coefficient, share), _sharpness(fog.g_draine), fog.alpha))
    else:
        c.warn(node, f"has a phase function {kind} that Luch does not know; it scatters evenly")
        add(Phase("HENYEY_GREENSTEIN", coefficient))


def _sharpness(anisotropy: float) -> float:
    return min(max(anisotropy, -SHARPEST_PHASE), SHARPEST_PHASE)


@emitter("ShaderNodeVolumeAbsorption")
def absorption(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Volume Absorption: what its colour lacks."""
    density = weight * max(_number(c, node, "Density"), 0.0)
    r, g, b = _color(c, node, "Color")
    _absorb(c, node, medium, _scaled((1.0 - r, 1.0 - g, 1.0 - b), density))


@emitter("ShaderNodeVolumeScatter")
def scatter(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Volume Scatter."""
    density = weight * max(_number(c, node, "Density"), 0.0)
    _scatter(c, node, medium, _scaled(_color(c, node, "Color"), density))


@emitter("ShaderNodeVolumeCoefficients")
def coefficients(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Volume Coefficients: physical quantities."""
    _absorb(c, node, medium, _scaled(_color(c, node, "Absorption Coefficients"), weight))
    _glow(medium, _scaled(_color(c, node, "Emission Coefficients"), weight))
    _scatter(c, node, medium, _scaled(_color(c, node, "Scatter Coefficients"), weight))


@emitter("ShaderNodeVolumePrincipled")
def principled(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Principled Volume. Its attributes are those of grids; a mesh has none, and counts as 1 everywhere."""
    density = weight * max(_number(c, node, "Density"), 0.0)
    color = _color(c, node, "Color")
    if density > 0.0:
        tint = _color(c, node, "Absorption Color")
        rest = [max(1.0 - part, 0.0) * max(1.0 - dark**0.5, 0.0) for part, dark in zip(color, tint, strict=True)]
        _absorb(c, node, medium, _scaled((rest[0], rest[1], rest[2]), density))
        g = _sharpness(_number(c, node, "Anisotropy"))
        if any(color):
            medium.scattering.append(Phase("HENYEY_GREENSTEIN", _scaled(color, density), g))
    strength = max(_number(c, node, "Emission Strength"), 0.0)
    if strength > 0.0:
        _glow(medium, _scaled(_color(c, node, "Emission Color"), strength * weight))
    blackbody = _number(c, node, "Blackbody Intensity")
    if blackbody > 0.0:
        _glow(medium, _scaled(_heat(c, node, blackbody), weight))


def _heat(c: Compiler, node: Any, intensity: float) -> Triple:
    """Radiance per metre of Principled Volume's blackbody: by Stefan and Boltzmann, blended in by the intensity."""
    temperature = max(_number(c, node, "Temperature"), 0.0)
    power = STEFAN_BOLTZMANN * (1.0 + intensity * (temperature**4 - 1.0))
    r, g, b = (float(part) * power for part in spectrum.blackbody(min(max(temperature, 800.0), 12000.0)))
    tint = _color(c, node, "Blackbody Tint")
    return r * tint[0], g * tint[1], b * tint[2]


@emitter("ShaderNodeEmission")
def emission(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Emission: what a metre adds."""
    _glow(medium, _scaled(_color(c, node, "Color"), _number(c, node, "Strength") * weight))


@emitter("ShaderNodeMixShader")
def mix(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Mix Shader."""
    factor = min(max(_number(c, node, "Fac"), 0.0), 1.0)
    _follow(c, node, "Shader", weight * (1.0 - factor), medium)
    _follow(c, node, "Shader_001", weight * factor, medium)


@emitter("ShaderNodeAddShader")
def add(c: Compiler, node: Any, weight: float, medium: Medium) -> None:
    """Add Shader."""
    _follow(c, node, "Shader", weight, medium)
    _follow(c, node, "Shader_001", weight, medium)


def medium_of(owner: bpy.types.Material | bpy.types.World, title: str, context: Any) -> Medium | None:
    """The medium of a material or a world; None if it has none. title: 'Material "Fog"', for warnings."""
    tree = owner.node_tree
    output = tree.get_output_node("CYCLES") if tree is not None else None
    # A tree may hold outputs of other kinds of tree: a light's has no volume.
    socket: Any = output.inputs.get("Volume") if output is not None else None
    if socket is None or not socket.is_linked:
        return None
    inline: Any = bpy.types.InlineShaderNodes
    flat = inline.from_material(owner) if isinstance(owner, bpy.types.Material) else inline.from_world(owner)
    compiler = Compiler(flat.node_tree, title, context)
    output = flat.node_tree.get_output_node("CYCLES")
    return compile_medium(compiler, output, "Volume") if output is not None else None
