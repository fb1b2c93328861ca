"""What is worth trying in a scene: each choice that could matter there, with its reason, the most telling first.

A choice is a change of the settings, or an effect left out. What cannot change anything in this scene is not tried, and
`Plan.absent` says so: of one kind there is one alone, or the scene has no use for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from luch import denoise, samplers
from luch.effects import Effects, effects_of
from luch.effects.picture import no_photons
from luch.effects.removal import REMOVALS
from luch.integrators import DEFAULT, INTEGRATORS, Integrator, named
from luch.scene import Scene, Settings

EXACT, AS_SET = "exact", "as set"
# Longer paths than this carry next to nothing: a white room that returns .8 at every bounce keeps .8^64 = 6e-7.
EXACT_BOUNCES = 64
BOUNCE_LIMITS = (1, 2, 4, 8)
CLAMPS = (10.0, 1.0)
# Every ray tests every triangle.
BRUTE_FORCE_TRIANGLES = 500
STRUCTURES = ("BVH", "BVH2", "BVH2_STACKLESS", "KD_TREE", "HIERARCHICAL_GRID", "GRID")
DENOISING_PASSES = ("Denoising Albedo", "Denoising Normal")


@dataclass(frozen=True)
class Variant:
    """One way to render the scene."""

    name: str
    group: str
    reason: str  # why it is worth trying here
    settings: Mapping[str, Any] = field(default_factory=dict)  # what differs from the scene's own
    biased: bool = False  # it may change what endless samples would give
    effect: str = ""  # left out
    denoised: bool = False
    rank: int = 5  # 0 is tried first

    @property
    def against(self) -> str:
        """Which variant its bias is measured from: the scene as it is where an effect is left out, else nothing biased."""
        return AS_SET if self.effect else EXACT

    def of(self, scene: Scene) -> Scene:
        """The scene rendered that way."""
        changed = replace(scene.settings, **self.settings)
        if self.effect:
            changed.without_effects = [*scene.settings.without_effects, self.effect]
        film = scene.film
        if self.denoised:
            film = replace(film, passes=list(dict.fromkeys([*film.passes, *DENOISING_PASSES])))
        return replace(scene, settings=changed, film=film)


@dataclass
class Plan:
    variants: list[Variant]  # the most telling first; the first is EXACT, the second AS_SET unless that takes nothing
    absent: list[str]  # what is not tried, and why

    @property
    def base(self) -> Variant:
        """The scene as it is set."""
        return self.variants[1] if len(self.variants) > 1 and self.variants[1].name == AS_SET else self.variants[0]


def exact_settings(settings: Settings) -> dict[str, Any]:
    """What takes nothing from the light: changes of the settings."""
    bounces = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "volume_bounces",
               "transparent_bounces")  # fmt: skip
    wanted: dict[str, Any] = {name: max(EXACT_BOUNCES, getattr(settings, name)) for name in bounces}
    wanted |= {"clamp_direct": 0.0, "clamp_indirect": 0.0, "filter_glossy": 0.0, "caustics_reflective": True,
               "caustics_refractive": True}  # fmt: skip
    if settings.precision == "FAST":
        wanted["precision"] = "WATERTIGHT"
    if named(settings.integrator).ends_at:
        wanted["integrator"] = DEFAULT
    return {name: value for name, value in wanted.items() if getattr(settings, name) != value}


def plan(
    scene: Scene, effects: Effects, accelerator: str = "", triangles: int = 0, general_kernels: bool = False
) -> Plan:
    """accelerator: what renders of this scene chose, as their statistics name it; triangles: that they found;
    general_kernels: whether a GPU's kernels for all scenes serve it."""
    settings = scene.settings
    on = {name for name in effects if effects[name].on}
    variants: list[Variant] = []
    absent = ["Adaptive sampling: it acts only on renders that end by an error."]
    variants.append(Variant(EXACT, "Settings", "takes nothing from the light: what the others are held against",
                            exact_settings(settings), rank=0))  # fmt: skip
    variants.append(Variant(AS_SET, "Settings", "the scene's own settings", biased=True, rank=0))
    if settings.without_effects:
        absent.append(f"Left out of all: {', '.join(settings.without_effects)}, as the scene's settings say.")
    if general_kernels and settings.own_kernels:
        variants.append(Variant("general kernels", "Kernels", "those for all scenes, none compiled for this one",
                                {"own_kernels": False}, rank=3))  # fmt: skip
    _add_structures(variants, absent, settings, accelerator, triangles)
    _add_precisions(variants, settings)
    _add_samplers(variants, settings)
    _add_integrators(variants, absent, scene, effects)
    _add_bounces(variants, absent, settings, on)
    _add_shortcuts(variants, settings, on)
    _add_light_sampling(variants, absent, settings, on)
    _add_denoising(variants, absent)
    _add_effects(variants, effects)
    return Plan(sorted(variants, key=lambda variant: variant.rank), absent)


def _add_structures(
    variants: list[Variant], absent: list[str], settings: Settings, accelerator: str, triangles: int
) -> None:
    kinds = [*STRUCTURES, *(("BRUTE_FORCE",) if 0 < triangles <= BRUTE_FORCE_TRIANGLES else ())]
    if "BRUTE_FORCE" not in kinds:
        absent.append(f"Brute force: every ray would test {triangles:,} triangles." if triangles else "Brute force.")
    for kind in kinds:
        if kind not in (settings.accelerator, accelerator):
            chosen = f"instead of {accelerator or settings.accelerator}"
            variants.append(Variant(_title(kind), "Structure", f"{chosen}; the same picture", {"accelerator": kind},
                                    rank=6))  # fmt: skip


def _add_precisions(variants: list[Variant], settings: Settings) -> None:
    for kind, reason in (
        ("FAST", "rays along edges may slip between two triangles"),
        ("WATERTIGHT", "no ray slips between two triangles"),
        ("DOUBLE", "intersections in double precision"),
    ):
        if kind != settings.precision:
            variants.append(Variant(f"{kind.lower()} precision", "Precision", reason, {"precision": kind},
                                    biased=kind == "FAST" or settings.precision == "FAST", rank=4))  # fmt: skip


def _add_samplers(variants: list[Variant], settings: Settings) -> None:
    for name, family in samplers.FAMILIES.items():
        if name != settings.sampler:
            variants.append(Variant(f"{family.title} sampler", "Samplers", family.reason, {"sampler": name}, rank=4))


def _add_integrators(variants: list[Variant], absent: list[str], scene: Scene, effects: Effects) -> None:
    settings = scene.settings
    if named(settings.integrator).ends_at:  # whose effects lack what the others follow
        effects = effects_of(replace(scene, settings=replace(settings, integrator=DEFAULT)))
    here = _why_the_same(effects, named(settings.integrator))
    for name, kind in INTEGRATORS.items():
        if name == settings.integrator:
            continue
        same = _why_the_same(effects, kind)
        if same:
            absent.append(f"{kind.title}: {same}.")
        elif not (here and name == DEFAULT):
            variants.append(Variant(kind.title.lower(), "Integrators", kind.reason, {"integrator": name}, biased=True,
                                    rank=5))  # fmt: skip


def _why_the_same(effects: Effects, kind: Integrator) -> str:
    """Why an integrator would draw the scene as paths do; "": it would not."""
    if kind.photons:
        return no_photons(effects)
    if kind.ends_at and not (
        effects["indirect light"].on and any(effects[f"{bounce} bounces"].on for bounce in kind.ends_at)
    ):
        return "no light goes from one matt surface to another"
    return ""


def _add_bounces(variants: list[Variant], absent: list[str], settings: Settings, on: set[str]) -> None:
    if "indirect light" not in on:
        absent.append("Bounces and Russian roulette: no path of this scene bounces.")
        return
    for limit in BOUNCE_LIMITS:
        if limit < settings.max_bounces:
            name = f"{limit} bounce{'s' * (limit != 1)}"
            variants.append(Variant(name, "Bounces", f"the scene allows {settings.max_bounces}",
                                    {"max_bounces": limit}, biased=True, rank=2 if limit == 4 else 5))  # fmt: skip
    if settings.min_light_bounces < settings.max_bounces:
        reason = "paths go on until a limit ends them: dearer, less noise"
        variants.append(Variant("no Russian roulette", "Russian roulette", reason,
                                {"min_light_bounces": settings.max_bounces}, rank=5))  # fmt: skip
    if settings.min_light_bounces > 0:
        reason = f"the scene spares {settings.min_light_bounces} bounces"
        variants.append(Variant("Russian roulette from the first bounce", "Russian roulette", reason,
                                {"min_light_bounces": 0}, rank=5))  # fmt: skip


def _add_shortcuts(variants: list[Variant], settings: Settings, on: set[str]) -> None:
    blurs = bool(on & {"glossy bounces", "transmission bounces"})
    if "indirect light" in on:
        for limit in CLAMPS:
            if limit != settings.clamp_indirect:
                reason = "samples of indirect light above it are cut"
                variants.append(Variant(f"clamp indirect {limit:g}", "Clamping", reason, {"clamp_indirect": limit},
                                        biased=True, rank=2 if limit == CLAMPS[0] else 4))  # fmt: skip
    if settings.clamp_indirect > 0.0 or settings.clamp_direct > 0.0:
        variants.append(Variant("no clamping", "Clamping", "the scene clamps",
                                {"clamp_indirect": 0.0, "clamp_direct": 0.0}, biased=True, rank=2))  # fmt: skip
    if blurs:
        blur = 0.0 if settings.filter_glossy > 0.0 else 1.0
        reason = "glossy surfaces are rougher after blurry bounces" if blur else "the scene blurs them"
        variants.append(Variant(f"filter glossy {blur:g}", "Clamping", reason, {"filter_glossy": blur}, biased=True,
                                rank=3))  # fmt: skip
    if blurs and "indirect light" in on:
        cut = {"clamp_indirect": 10.0, "filter_glossy": 1.0, "max_bounces": min(4, settings.max_bounces)}
        variants.append(Variant("clamp 10, filter 1, 4 bounces", "Clamping", "the usual shortcuts together", cut,
                                biased=True, rank=2))  # fmt: skip


def _add_light_sampling(variants: list[Variant], absent: list[str], settings: Settings, on: set[str]) -> None:
    if "light tree" in on:
        variants.append(Variant("no light tree", "Light sampling", "every light is chosen equally often",
                                {"light_tree": False}, rank=3))  # fmt: skip
    elif not settings.light_tree:
        variants.append(Variant("light tree", "Light sampling", "lights are chosen by what they contribute",
                                {"light_tree": True}, rank=3))  # fmt: skip
    else:
        absent.append("Light tree: there are not two lights to choose from.")
    # That the world is found by chance alone is measured as the effect "world light sampling" left out.


def _add_denoising(variants: list[Variant], absent: list[str]) -> None:
    try:
        denoise.library()
    except ImportError as error:
        absent.append(f"Denoising: {error}")
        return
    reason = "Open Image Denoise with albedo and normal, after the last sample"
    variants.append(Variant("denoised", "Denoising", reason, denoised=True, biased=True, rank=1))


# Effects that choose how light is found, not what the picture shows: leaving them out changes noise alone.
SAMPLING_EFFECTS = frozenset({"world light sampling", "light tree"})
TRIED_ELSEWHERE = frozenset({"light tree", "clamping", "filter glossy", "aperture blades"})
# What makes up a picture before its details do.
LARGE_EFFECTS = frozenset({"indirect light", "reflective caustics", "refractive caustics", "depth of field", "volumes",
                           "subsurface", "camera motion", "object motion", "deformation motion", "transparency",
                           "transmission"})  # fmt: skip


def _add_effects(variants: list[Variant], effects: Effects) -> None:
    for name, removal in REMOVALS.items():
        if name not in effects or not effects[name].on or name in TRIED_ELSEWHERE or name.startswith("pass "):
            continue
        group = "Light sampling" if name in SAMPLING_EFFECTS else "Effects"
        rank = 1 if name in LARGE_EFFECTS else 3
        variants.append(Variant(f"without {name}", group, f"{effects[name].reason}; instead: {removal.instead}",
                                biased=name not in SAMPLING_EFFECTS, effect=name, rank=rank))  # fmt: skip


def _title(kind: str) -> str:
    return {"BVH": "BVH", "BVH2": "binary BVH", "BVH2_STACKLESS": "stackless BVH", "KD_TREE": "kd-tree",
            "HIERARCHICAL_GRID": "hierarchical grid", "GRID": "uniform grid", "BRUTE_FORCE": "brute force"}[kind]  # fmt: skip
