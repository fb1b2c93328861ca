"""What a scene's own kernels are compiled without: LUCH_PLAN_... of native/include/luch/plan.h, from luch.effects.

The rule is one-sided: code is left out only where no effect that needs it is on. The picture is the same, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from luch.effects import effects_of
from luch.effects.forcing import ALL
from luch.effects.lobes import possible_in
from luch.samplers import NAMES
from luch.scene import Scene

# Define -> effects that need it, by their names in luch.effects; a name that ends in * stands for all that begin so.
NEEDED_BY: dict[str, tuple[str, ...]] = {
    "THIN_FILM": ("thin film",),
    "SHEEN": ("sheen",),
    "CURVES": ("hair",),
    "SPHERES": ("point clouds",),
    "HAIR": ("hair shading",),
    "ROUND_LAMPS": ("point lamps", "spot lamps"),
    "AREA_LAMPS": ("area lamps",),
    "SUNS": ("sun lamps",),
    "EMISSIVE_MESHES": ("emissive meshes",),
    "WORLD_SAMPLING": ("world light sampling",),
    "LIGHT_PASSES": ("pass Diffuse Direct", "pass Diffuse Indirect", "pass Glossy Direct", "pass Glossy Indirect",
                     "pass Transmission Direct", "pass Transmission Indirect", "pass Emission", "pass Environment",
                     "pass Volume Direct", "pass Volume Indirect", "pass Ambient Occlusion", "light groups"),
    "DATA_PASSES": ("pass Depth", "pass Mist", "pass Position", "pass Normal", "pass UV", "pass Object Index",
                    "pass Material Index", "pass Diffuse Color", "pass Glossy Color", "pass Transmission Color",
                    "pass Diffuse Direct", "pass Diffuse Indirect", "pass Glossy Direct", "pass Glossy Indirect",
                    "pass Transmission Direct", "pass Transmission Indirect", "pass Denoising Albedo",
                    "pass Denoising Normal", "cryptomatte", "AOVs"),
    "DENOISING_PASSES": ("pass Denoising Albedo", "pass Denoising Normal"),
    "AMBIENT_OCCLUSION": ("pass Ambient Occlusion",),
    "FILTER_GLOSSY": ("filter glossy",),
    "HOLDOUT": ("holdout",),
    "CLAMPING": ("clamping",),
    "VOLUMES": ("volumes",),
    "MOTION": ("camera motion", "object motion", "deformation motion"),
    "TIME": ("pass Render Time",),
    "PHOTONS": ("photon maps",),
}  # fmt: skip
# Define -> what the core says of the scene as it will be rendered (core.render.Renderer.device_facts).
TOLD = {
    "VISIBLE_LAMPS": "visible_lamps",
    "LAMP_PROGRAMS": "lamp_programs",
    "EMISSION_PROGRAMS": "emission_programs",
    "WORLD_PROGRAM": "world_program",
}
# Define -> operations of shader programs that make such lobes.
MADE_BY: dict[str, tuple[str, ...]] = {
    "FIBRES": ("CLOSURE_PRINCIPLED_HAIR",),
    "HAIR_CONES": ("CLOSURE_HAIR",),
    "TOON": ("CLOSURE_TOON",),
    "SUBSURFACE": ("CLOSURE_SUBSURFACE", "CLOSURE_PRINCIPLED_SUBSURFACE"),
    "MICROFACETS": (
        "CLOSURE_GLOSSY",
        "CLOSURE_METALLIC",
        "CLOSURE_GLASS",
        "CLOSURE_REFRACTION",
        "CLOSURE_PRINCIPLED",
        "CLOSURE_PRINCIPLED_SUBSURFACE",
        "CLOSURE_SUBSURFACE",
    ),
}
# Define -> what luch.effects.lobes says that some lobe or lookup may have.
POSSIBLE = {
    "COAT": "coat",
    "METALS": "metals",
    "CONDUCTORS": "conductors",
    "TRANSMISSION": "transmission",
    "THIN_WALLS": "thin walls",
    "ANISOTROPY": "anisotropy",
    "BECKMANN": "beckmann",
    "ASHIKHMIN_SHIRLEY": "ashikhmin shirley",
    "ROUGH_DIFFUSE": "rough diffuse",
    "CUBIC_IMAGES": "cubic images",
    "HALF_IMAGES": "half images",
    "FLOAT_IMAGES": "float images",
    "BENT_EXITS": "bent exits",
}
MOST_LOBES = 12  # of plan.h, where general code keeps the likeliest
SAMPLER = "SAMPLER"  # define -> SamplerFamily
CURVE_SHAPE = "CURVE_SHAPE"  # define -> CurveShape of geometry/curve.h
CURVE_SHAPES = ("RIBBON", "THICK", "THICK_LINEAR")
ANY_CURVE_SHAPE = len(CURVE_SHAPES)


def plan_of(scene: Scene, operations: set[str], facts: Mapping[str, Any]) -> dict[str, bool | int]:
    """Which code a scene needs, and the number of lobes at a point at most. operations: names of those that its
    programs hold; facts: core.render.Renderer.device_facts.
    """
    sampler = {SAMPLER: NAMES.index(scene.settings.sampler)}
    if ALL in scene.settings.force_effects:
        every = dict.fromkeys([*NEEDED_BY, *MADE_BY, *TOLD, *POSSIBLE], True)
        every["PHOTONS"] = scene.settings.photon_maps  # another way to find light, no work done in vain
        return every | {"MOST_LOBES": MOST_LOBES, CURVE_SHAPE: ANY_CURVE_SHAPE} | sampler
    effects, possible = effects_of(scene), possible_in(scene)
    plan: dict[str, bool | int] = {
        define: any(effects[name].on for name in names) for define, names in NEEDED_BY.items()
    }
    plan |= {define: name in possible.needs for define, name in POSSIBLE.items()}
    plan["MOST_LOBES"] = min(possible.most_lobes, MOST_LOBES)
    plan[CURVE_SHAPE] = CURVE_SHAPES.index(scene.settings.curve_shape) if plan["CURVES"] else ANY_CURVE_SHAPE
    plan |= sampler
    plan |= {define: bool(facts[name]) for define, name in TOLD.items()}
    plan |= {define: any(name in operations for name in names) for define, names in MADE_BY.items()}
    return plan


def sampler_flags(scene: Scene) -> tuple[str, ...]:
    """For kernels that serve all scenes, where theirs is not the one that those are compiled with."""
    family = NAMES.index(scene.settings.sampler)
    return tuple(flags({SAMPLER: family})) if family else ()


def curve_flags(shape: str) -> tuple[str, ...]:
    """For kernels that trace hair of that Settings.curve_shape; "": there is none, and those for all scenes serve."""
    return tuple(flags({"CURVES": True, CURVE_SHAPE: CURVE_SHAPES.index(shape)})) if shape else ()


def flags(plan: Mapping[str, bool | int]) -> list[str]:
    """For the compiler."""
    return [f"-DLUCH_PLAN_{define}={int(needed)}" for define, needed in sorted(plan.items())]
