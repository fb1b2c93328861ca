"""What the shader programs of a scene can come to: for code that is compiled for this scene alone.

One-sided, as everything that leaves code out: what is not named here cannot happen in any program, whatever it lies
on; what is named may never happen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from luch.bounds import FILM_MIN_THICKNESS_NM
from luch.effects.closures import Closure
from luch.effects.programs import decode
from luch.scene import Program, Scene
from luch.shader_code import PRINCIPLED, SUBSURFACE_BUMP

# Microfacets and Interpolation: the menus of bsdf/params.h and shade/textures/image.h.
_BECKMANN, _ASHIKHMIN_SHIRLEY, _CUBIC = 1, 3, 2
_FACETS = ("CLOSURE_GLOSSY", "CLOSURE_METALLIC", "CLOSURE_GLASS", "CLOSURE_REFRACTION")
# Operation that looks up images -> which of its parameters is the interpolation.
_INTERPOLATION = {"IMAGE": 1, "IMAGE_BOX": 1, "ENVIRONMENT": 1}
_PIXELS = {np.dtype(np.float16): "half images", np.dtype(np.float32): "float images"}


def programs_of(scene: Scene) -> list[Program]:
    """Of materials, the world and lamps: all that may be run."""
    world = [] if scene.world is None else [scene.world.program]
    return [*(material.surface for material in scene.materials), *world,
            *(lamp.program for lamp in scene.lights if lamp.program is not None)]  # fmt: skip


@dataclass(frozen=True)
class Possible:
    """What may be met at some point of a scene."""

    needs: frozenset[str]  # names of what lobes and lookups may have
    most_lobes: int  # at one point, 1 or more


def possible_in(scene: Scene) -> Possible:
    """Raises ValueError if a program is damaged."""
    needs = {_PIXELS[image.pixels.dtype] for image in scene.images if image.pixels.dtype in _PIXELS}
    most = 1
    for program in programs_of(scene):
        if program.flags & SUBSURFACE_BUMP:
            needs.add("bent exits")
        nodes, constants = decode(program)
        closures = [Closure(node, constants) for node in nodes if node.op.closure]
        needs.update(name for closure in closures for name in _of_closure(closure))
        most = max(most, sum(map(_lobes, closures)))
        if any(node.params[_INTERPOLATION[node.op.name]] == _CUBIC for node in nodes if node.op.name in _INTERPOLATION):
            needs.add("cubic images")
    return Possible(frozenset(needs), most)


def _of_closure(c: Closure) -> Iterator[str]:
    if c.is_nothing():
        return
    params = c.node.params
    if c.name in _FACETS and params[1] == _BECKMANN:
        yield "beckmann"
    if c.name == "CLOSURE_GLOSSY" and params[1] == _ASHIKHMIN_SHIRLEY:
        yield "ashikhmin shirley"
    if c.name in ("CLOSURE_GLOSSY", "CLOSURE_METALLIC") and c.number("anisotropy") != 0.0:
        yield "anisotropy"
    if c.name in ("CLOSURE_GLASS", "CLOSURE_REFRACTION", "CLOSURE_SUBSURFACE", "CLOSURE_PRINCIPLED_SUBSURFACE"):
        yield "transmission"
    if c.name == "CLOSURE_METALLIC":
        yield "conductors" if params[2] else "metals"
    if c.name == "CLOSURE_DIFFUSE" and c.number("roughness") != 0.0:
        yield "rough diffuse"
    if c.name in PRINCIPLED:
        yield from _of_principled(c)


def _of_principled(c: Closure) -> Iterator[str]:
    if c.may_pass("coat_weight"):
        yield "coat"
    if c.may_pass("metallic"):
        yield "metals"
    if c.has_glass():
        yield "transmission"
    if c.number("thin_wall") != 0.0:
        yield "thin walls"
    if c.number("anisotropic") != 0.0:
        yield "anisotropy"
    if c.number("diffuse_roughness") != 0.0:
        yield "rough diffuse"


def _lobes(c: Closure) -> int:
    """At most, of one closure: the setup functions of bsdf/setup.h."""
    if c.is_nothing() or c.name in ("CLOSURE_EMISSION", "CLOSURE_TRANSPARENT", "CLOSURE_HOLDOUT"):
        return 0
    if c.name == "CLOSURE_SUBSURFACE":
        return 2  # a radius of 0 in one channel leaves that channel diffuse; so does half of skin's entries
    if c.name not in PRINCIPLED:
        return 1
    thin = c.number("thin_wall") != 0.0
    count = c.may_pass("sheen_weight") + c.may_pass("coat_weight") + c.may_pass("metallic")
    count += (2 if thin else 1) * c.has_glass()
    if not c.has_dielectric():
        return count
    film = c.may_pass("thin_film_thickness", FILM_MIN_THICKNESS_NM)
    count += 1 if film or c.has_specular() else 0
    inside = c.may_pass("subsurface_weight") and (thin or c.scatters_inside())
    return count + 1 + 2 * inside
