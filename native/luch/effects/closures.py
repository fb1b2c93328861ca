"""What a closure can do, told by those of its inputs that are known.

The order of inputs is that of the structs in ``native/include/luch/shade/nodes/closures.h`` (a test compares the
two); what decides follows ``native/include/luch/bsdf``: a lobe whose weight is known to be 0 does not exist.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from luch.bounds import FILM_MIN_THICKNESS_NM, LOBE_WEIGHT_CUTOFF
from luch.shader_code import PRINCIPLED, Node, Value

_METAL = "roughness anisotropy rotation normal:3 tangent:3"
_FILM = "thin_film_thickness thin_film_ior"
_PRINCIPLED = (
    "base_color:3 metallic roughness ior thin_wall normal:3 diffuse_roughness subsurface_weight "
    "subsurface_anisotropy specular_ior_level specular_tint:3 anisotropic anisotropic_rotation tangent:3 "
    "transmission_weight coat_weight coat_roughness coat_ior coat_tint:3 coat_normal:3 sheen_weight "
    f"sheen_roughness sheen_tint:3 emission_color:3 emission_strength {_FILM}"
)
# Inputs after the weight; NAME:3 is a vector.
LAYOUTS = {
    "CLOSURE_DIFFUSE": "color:3 roughness normal:3",
    "CLOSURE_TRANSLUCENT": "color:3 normal:3",
    "CLOSURE_SHEEN": "color:3 roughness normal:3",
    "CLOSURE_TOON": "color:3 size smooth normal:3",
    "CLOSURE_GLOSSY": f"color:3 {_METAL}",
    "CLOSURE_METALLIC": f"base_color:3 edge_tint:3 ior:3 extinction:3 {_METAL} {_FILM}",
    "CLOSURE_GLASS": f"color:3 roughness ior normal:3 {_FILM}",
    "CLOSURE_REFRACTION": "color:3 roughness ior normal:3",
    "CLOSURE_HAIR": "color:3 offset roughness_along roughness_around tangent:3",
    "CLOSURE_PRINCIPLED_HAIR": (
        "color:3 melanin melanin_redness tint:3 absorption:3 roughness radial_roughness coat ior offset random_color "
        "random_roughness random"
    ),
    "CLOSURE_SUBSURFACE": "color:3 radius:3 ior alpha anisotropy normal:3",
    "CLOSURE_PRINCIPLED": _PRINCIPLED,
    "CLOSURE_PRINCIPLED_SUBSURFACE": f"subsurface_radius:3 subsurface_ior {_PRINCIPLED}",
}


def input_places(name: str) -> dict[str, tuple[int, int]]:
    """Of a closure: input -> first place among its operation's inputs, and how many numbers it has."""
    places, at = {"weight": (0, 3)}, 3
    for entry in LAYOUTS.get(name, "").split():
        label, _, count = entry.partition(":")
        places[label] = (at, int(count or 1))
        at += places[label][1]
    return places


_PLACES = {name: input_places(name) for name in LAYOUTS}
_WEIGHT_ALONE = input_places("")


class Closure:
    """A closure of a program, with what is known of its inputs."""

    def __init__(self, node: Node, constants: Mapping[int, float]) -> None:
        self.node = node
        self.name = node.op.name
        self._constants = constants
        self._places = _PLACES.get(self.name, _WEIGHT_ALONE)

    def vector(self, name: str) -> tuple[float, ...] | None:
        """The numbers of an input; None unless all are known."""
        first, count = self._places[name]
        numbers = [self._constants.get(value) for value in self.node.inputs[first : first + count]]
        known = tuple(number for number in numbers if number is not None)
        return known if len(known) == count else None

    def number(self, name: str) -> float | None:
        """A scalar input; None unless it is known."""
        known = self.vector(name)
        return known[0] if known else None

    def is_nothing(self) -> bool:
        """Whether its weight is known to be 0."""
        return self.vector("weight") == (0.0, 0.0, 0.0)

    def may_pass(self, name: str, limit: float = LOBE_WEIGHT_CUTOFF) -> bool:
        """Whether the input could be above a limit."""
        known = self.number(name)
        return known is None or known > limit

    def may_shine(self, name: str) -> bool:
        """Whether the colour could be other than black."""
        known = self.vector(name)
        return known is None or any(part != 0.0 for part in known)

    def says(self, name: str, label: str) -> str:
        """ "coat weight 0.5", or that it changes over the surface."""
        known = self.number(name)
        return f"{label} {known:.3g}" if known is not None else f"a {label} that varies"

    # -- what it has ------------------------------------------------------------------------------

    def traits(self) -> dict[str, str]:
        """Kind of light transport or shading -> the fact that says so."""
        return dict(_TRAITS[self.name](self)) if self.name in _TRAITS else {}

    def used_inputs(self) -> list[Value]:
        """Inputs that can change the picture."""
        dead = self._dead_inputs()
        return [
            value
            for name, (first, count) in self._places.items()
            if name not in dead
            for value in self.node.inputs[first : first + count]
        ]

    # -- Principled: which of its layers are there ------------------------------------------------

    def has_base(self) -> bool:
        """Whether anything that is no metal can be seen."""
        known = self.number("metallic")
        return known is None or known < 1.0

    def has_glass(self) -> bool:
        """Transmission, not hidden by metal."""
        return self.has_base() and self.may_pass("transmission_weight")

    def has_dielectric(self) -> bool:
        """What lies beside metal and glass: specular over diffuse."""
        known = self.number("transmission_weight")
        return self.has_base() and (known is None or known < 1.0)

    def has_specular(self) -> bool:
        """Reflection of the dielectric: its index differs from that of air, or a film lies on it."""
        straight = self.number("ior") == 1.0 or self.number("specular_ior_level") == 0.0
        return self.has_dielectric() and (not straight or self.may_pass("thin_film_thickness", FILM_MIN_THICKNESS_NM))

    def scatters_inside(self) -> bool:
        """Whether light may go under the surface: there is a weight and a radius, and the wall is not thin."""
        if self.name == "CLOSURE_SUBSURFACE":
            return self.may_shine("radius") and self.may_shine("color")
        walks = self.name == "CLOSURE_PRINCIPLED_SUBSURFACE" and self.may_shine("subsurface_radius")
        return walks and self.may_pass("subsurface_weight") and self.number("thin_wall") in (None, 0.0)

    def _dead_inputs(self) -> set[str]:
        dead: set[str] = set()
        film = "thin_film_thickness" in self._places and self.may_pass("thin_film_thickness", FILM_MIN_THICKNESS_NM)
        if not film:
            dead.add("thin_film_ior")
        if self.name in ("CLOSURE_GLOSSY", "CLOSURE_METALLIC") and self.number("anisotropy") == 0.0:
            dead |= {"rotation", "tangent"}
        if self.name == "CLOSURE_METALLIC":  # params[2]: physical conductor
            dead |= {"base_color", "edge_tint"} if self.node.params[2] else {"ior", "extinction"}
        if self.name == "CLOSURE_PRINCIPLED_HAIR":
            return self._dead_hair_inputs()
        if self.name not in PRINCIPLED:
            return dead
        if not self.may_pass("coat_weight"):
            dead |= {"coat_roughness", "coat_ior", "coat_tint", "coat_normal"}
        if not self.may_pass("sheen_weight"):
            dead |= {"sheen_roughness", "sheen_tint"}
        if self.number("anisotropic") == 0.0:
            dead |= {"anisotropic_rotation", "tangent"}
        if not self.node.params[2]:  # its emission is a closure of its own
            dead |= {"emission_color", "emission_strength"}
        if not self.has_base():
            dead |= {"ior", "thin_wall", "transmission_weight"}
        if not self.has_dielectric():
            dead |= {"diffuse_roughness", "subsurface_weight", "subsurface_anisotropy", "specular_ior_level"}
        if self.name == "CLOSURE_PRINCIPLED_SUBSURFACE" and not self.scatters_inside():
            dead |= {"subsurface_radius", "subsurface_ior"}
        if not self.may_pass("subsurface_weight") or not (self.scatters_inside() or self.number("thin_wall") != 0.0):
            dead.add("subsurface_anisotropy")
        return dead

    def _dead_hair_inputs(self) -> set[str]:
        # params[1]: HairColor of bsdf/setup_hair.h
        colors = ({"absorption"}, {"melanin", "melanin_redness", "tint", "random_color"}, {"color"})
        dead = set().union(*colors) - colors[self.node.params[1]]
        random_color = "random_color" not in dead and self.number("random_color") != 0.0
        if not random_color and self.number("random_roughness") == 0.0:
            dead.add("random")
        return dead


Facts = Iterator[tuple[str, str]]


def _transparent(c: Closure) -> Facts:
    known = c.vector("weight")
    yield (
        "transparency",
        "lets light straight through" if known is None else f"lets {_mean(known):.0%} straight through",
    )


def _holdout(c: Closure) -> Facts:
    yield "holdout", "has a Holdout"


def _emission(c: Closure) -> Facts:
    yield "emission", "emits light"


def _diffuse(c: Closure) -> Facts:
    if c.may_shine("color"):
        yield "diffuse", "scatters diffusely"


def _translucent(c: Closure) -> Facts:
    if c.may_shine("color"):
        yield "translucency", "is translucent"


def _sheen(c: Closure) -> Facts:
    yield "sheen", "is a Sheen BSDF"
    # params[1]: Ashikhmin's velvet, whose bounces count as glossy
    yield ("glossy", "has velvet") if c.node.params[1] else ("diffuse", "has sheen")


def _toon(c: Closure) -> Facts:
    yield ("glossy", "is glossy toon") if c.node.params[1] else ("diffuse", "is diffuse toon")


def _glossy(c: Closure) -> Facts:
    yield "glossy", "reflects"
    known = c.number("anisotropy")
    if known != 0.0 and c.number("roughness") != 0.0:
        yield "anisotropy", f"has {c.says('anisotropy', 'anisotropy')}"


def _film(c: Closure) -> Facts:
    if c.may_pass("thin_film_thickness", FILM_MIN_THICKNESS_NM):
        yield "thin film", f"has {c.says('thin_film_thickness', 'thin film thickness')} nm"


def _metallic(c: Closure) -> Facts:
    yield from _glossy(c)
    yield from _film(c)


def _refraction(c: Closure) -> Facts:
    yield "transmission", "refracts"


def _glass(c: Closure) -> Facts:
    yield "transmission", "is glass"
    yield "glossy", "reflects"
    yield from _film(c)


def _principled(c: Closure) -> Facts:
    metal, specular = c.may_pass("metallic"), c.has_specular()
    coat = c.may_pass("coat_weight")
    if metal or specular or coat or c.has_glass():
        yield "glossy", "reflects"
    if c.has_glass():
        yield "transmission", f"has {c.says('transmission_weight', 'transmission weight')}"
        if c.number("thin_wall") != 0.0 and c.node.params[3]:
            yield "transparency", "is a thin wall of glass"
    if coat:
        yield "coat", f"has {c.says('coat_weight', 'coat weight')}"
    if c.may_pass("sheen_weight"):
        yield "sheen", f"has {c.says('sheen_weight', 'sheen weight')}"
        yield "diffuse", "has sheen"
    if c.may_pass("anisotropic", 0.0) and (metal or specular) and c.number("roughness") != 0.0:
        yield "anisotropy", f"has {c.says('anisotropic', 'anisotropy')}"
    if metal or specular or c.has_glass():
        yield from _film(c)
    if c.has_dielectric():
        yield from _principled_base(c)
    if c.node.params[2] and c.may_shine("emission_color") and c.number("emission_strength") != 0.0:
        yield "emission", "emits light"


def _principled_base(c: Closure) -> Facts:
    if c.may_shine("base_color"):
        yield "diffuse", "scatters diffusely"
    if not c.may_pass("subsurface_weight"):
        return
    fact = f"has {c.says('subsurface_weight', 'subsurface weight')}"
    if c.number("thin_wall") != 0.0:
        yield "thin subsurface", f"{fact} in a thin wall"
    if c.scatters_inside():
        yield "subsurface", f"{fact}{_by_method(c, 4)}"


# SubsurfaceMethod of bsdf/params.h, in Blender's words; the usual one needs none.
_METHODS = ("", "Random Walk (Skin)", "Random Walk (Legacy)", "Christensen-Burley")


def _by_method(c: Closure, place: int) -> str:
    name = _METHODS[c.node.params[place]]
    return f", by {name}" if name else ""


def _subsurface(c: Closure) -> Facts:
    if c.may_shine("color"):
        yield "diffuse", "scatters diffusely"
    if c.scatters_inside():
        yield "subsurface", f"scatters light under its surface{_by_method(c, 1)}"


def _hair(c: Closure) -> Facts:
    # params[1]: transmission
    yield "hair shading", "is a Hair BSDF"
    yield ("hair transmission", "is hair that transmits") if c.node.params[1] else ("glossy", "is hair that reflects")


def _principled_hair(c: Closure) -> Facts:
    yield "hair shading", "is Principled Hair"
    yield "glossy", "is hair"
    yield "hair transmission", "is hair"


def _mean(numbers: tuple[float, ...]) -> float:
    return sum(numbers) / len(numbers)


_TRAITS = {
    "CLOSURE_TRANSPARENT": _transparent,
    "CLOSURE_HOLDOUT": _holdout,
    "CLOSURE_EMISSION": _emission,
    "CLOSURE_DIFFUSE": _diffuse,
    "CLOSURE_TRANSLUCENT": _translucent,
    "CLOSURE_SHEEN": _sheen,
    "CLOSURE_TOON": _toon,
    "CLOSURE_GLOSSY": _glossy,
    "CLOSURE_METALLIC": _metallic,
    "CLOSURE_REFRACTION": _refraction,
    "CLOSURE_GLASS": _glass,
    "CLOSURE_SUBSURFACE": _subsurface,
    "CLOSURE_PRINCIPLED": _principled,
    "CLOSURE_PRINCIPLED_SUBSURFACE": _principled,
    "CLOSURE_HAIR": _hair,
    "CLOSURE_PRINCIPLED_HAIR": _principled_hair,
}
