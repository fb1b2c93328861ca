"""Effects of surfaces and textures: what materials have, as their programs say."""

from __future__ import annotations

from luch.effects.shown import Shown, Surface
from luch.effects.table import Effects

# Trait of a closure -> why it is off where no surface has it.
_TRAITS = {
    "transmission": "no material transmits light: every transmission weight is 0",
    "translucency": "no material has a Translucent BSDF",
    "coat": "every coat weight is 0",
    "sheen": "every sheen weight is 0",
    "hair shading": "no material is hair",
    "anisotropy": "every anisotropy is 0",
    "thin film": "every thin film has thickness 0",
}
# Name of an effect -> what the operations are called.
TEXTURES = {
    "image textures": ("IMAGE",),
    "noise": ("NOISE_",),
    "voronoi": ("VORONOI_",),
    "white noise": ("WHITE_NOISE_",),
    "gabor": ("GABOR_",),
    "gradient": ("GRADIENT",),
    "checker": ("CHECKER",),
    "brick": ("BRICK",),
    "magic": ("MAGIC",),
    "wave": ("WAVE",),
}


def add_surfaces(effects: Effects, shown: Shown) -> None:
    """Transparency, what closures have, bent normals."""
    _add_transparency(effects, shown)
    for trait, off in _TRAITS.items():
        add_trait(effects, "Surfaces", trait, trait, shown, off)
    _add_subsurface(effects, shown)
    _add_holdout(effects, shown)
    for name, operation in (("bump", "BUMP"), ("normal maps", "NORMAL_MAP")):
        found = [surface for surface in shown.surfaces if surface.reading.has(operation)]
        reason = f"{titles(found)} {'bends' if len(found) == 1 else 'bend'} the normal" if found else ""
        effects.add("Surfaces", name, bool(found), reason or f"no material that is shown uses {name}")


def add_textures(effects: Effects, shown: Shown) -> None:
    """Textures by kind, of materials; those of the world and of lamps are told with them."""
    for name, operations in TEXTURES.items():
        found = [surface for surface in shown.surfaces if surface.reading.has(*operations)]
        cost = ""
        if name == "image textures":
            images = {index for surface in found for index in surface.reading.images}
            pixels = sum(shown.scene.images[index].pixels.nbytes for index in images if index < len(shown.scene.images))
            cost = f"{len(images)} {'image' if len(images) == 1 else 'images'}, {pixels / 1e6:.1f} MB" if found else ""
        reason = f"{titles(found)} {'reads' if len(found) == 1 else 'read'} it" if found else "no material reads it"
        effects.add("Textures", name, bool(found), reason, cost=cost)


def add_trait(effects: Effects, group: str, name: str, trait: str, shown: Shown, off: str, *, cost: str = "") -> None:
    """An effect that is on if some surface that is shown has the trait."""
    found = [surface for surface in shown.surfaces if trait in surface.traits]
    reason = facts(found, trait) if found else off + _only_idle(shown, trait)
    effects.add(group, name, bool(found), reason, cost=cost if found else "")


def facts(found: list[Surface], trait: str) -> str:
    """ "material "Leaves" has alpha, and 2 more"."""
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    return f"{found[0].title} {found[0].traits[trait]}{more}"


def titles(found: list[Surface]) -> str:
    """ "material "Leaves" and 2 more"."""
    return found[0].title + (f" and {len(found) - 1} more" if len(found) > 1 else "")


def _only_idle(shown: Shown, trait: str) -> str:
    """Says that a material has it and lies on nothing: a user who looks for it finds out why."""
    idle = [surface for surface in shown.idle if trait in surface.traits]
    return f" ({facts(idle, trait)}, but is on no face that is drawn)" if idle else ""


def _add_transparency(effects: Effects, shown: Shown) -> None:
    off = "every alpha is 1 and no material has a Transparent BSDF"
    add_trait(effects, "Surfaces", "transparency", "transparency", shown, off)
    name = "transparent shadows"
    if not effects["transparency"].on:
        effects.add("Surfaces", name, False, "nothing is transparent: a shadow ray ends at the first surface")
        return
    clear = [surface for surface in shown.surfaces if "transparency" in surface.traits]
    casting = [surface for surface in clear if surface.transparent_shadows and surface.blocks_light]
    if casting:
        cost = "a shadow ray walks from one such surface to the next"
        effects.add("Surfaces", name, True, facts(casting, "transparency"), cost=cost)
    elif any(surface.blocks_light for surface in clear):
        effects.add("Surfaces", name, False, f"Transparent Shadows is disabled in {titles(clear)}")
    else:
        effects.add("Surfaces", name, False, f"no object with {titles(clear)} casts a shadow")


def _add_subsurface(effects: Effects, shown: Shown) -> None:
    add_trait(
        effects,
        "Surfaces",
        "thin subsurface",
        "thin subsurface",
        shown,
        "no thin wall scatters light under its surface",
    )
    off = "no material scatters light under its surface: every subsurface weight, scale or radius is 0"
    told = shown.scene.unsupported.get("subsurface", [])  # of a Luch that could not draw it
    if told and not any("subsurface" in surface.traits for surface in shown.surfaces):
        effects.add("Surfaces", "subsurface", False, told[0], missing=True)
        return
    cost = "such a path goes on inside, by some tens of rays, and the objects have one tree more"
    add_trait(effects, "Surfaces", "subsurface", "subsurface", shown, off, cost=cost)
    found = [surface for surface in shown.surfaces if "subsurface" in surface.traits]
    points = [surface for surface in found if surface.spheres or surface.curves]
    if points:
        of = " and ".join(
            ["the spheres of point clouds"] * any(surface.spheres for surface in points)
            + ["hair"] * any(surface.curves for surface in points)
        )
        reason = f"{facts(points, 'subsurface')}: diffuse on {of}"
        effects.add("Surfaces", "subsurface of points", False, reason, missing=True)
    if found and len(points) == len(found) and not any(surface.triangles for surface in found):
        effects.add("Surfaces", "subsurface", False, "it is on point clouds or hair alone, which show it as diffuse")


def _add_holdout(effects: Effects, shown: Shown) -> None:
    if shown.holdouts:
        more = f", and {len(shown.holdouts) - 1} more" if len(shown.holdouts) > 1 else ""
        effects.add("Surfaces", "holdout", True, f'object "{shown.holdouts[0]}" is a holdout{more}')
    else:
        add_trait(effects, "Surfaces", "holdout", "holdout", shown, "no object and no material is a holdout")
