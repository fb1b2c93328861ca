"""Effects of light: lamps by type, surfaces that shine, the world, and how one is chosen among them."""

from __future__ import annotations

from luch.bounds import SMALLEST_HALF_SUN, SMALLEST_RADIUS
from luch.effects.programs import Reading, read_program
from luch.effects.shown import Shown
from luch.effects.surfaces import TEXTURES, facts
from luch.effects.table import Effects
from luch.scene import Light

LAMPS = {"POINT": "point lamps", "SPOT": "spot lamps", "SUN": "sun lamps", "AREA": "area lamps"}
_ALL_RAYS, _CAMERA = 63, 1  # RayKind bits
# Effect -> operations that show it, and what the user calls it.
_WORLDS: dict[str, tuple[tuple[str, ...], str]] = {
    "environment image": (("ENVIRONMENT", "IMAGE"), "an image"),
    "sky": (("SKY_",), "a Sky Texture"),
    "procedural world": (
        tuple(prefix for name, prefixes in TEXTURES.items() if name != "image textures" for prefix in prefixes),
        "a procedural texture",
    ),
}


def add_lights(effects: Effects, shown: Shown) -> None:
    """Everything that shines."""
    lamps = [light for light in shown.scene.lights if _shines(light)]
    for kind, name in LAMPS.items():
        _add_lamps(effects, name, [light for light in shown.scene.lights if light.kind == kind])
    _add_lamp_facts(effects, lamps)
    triangles = _add_emissive(effects, shown)
    _add_light_tree(effects, shown, lamps, triangles)
    _add_world(effects, shown)


def _shines(light: Light) -> bool:
    return light.power != 0.0 and any(part != 0.0 for part in light.color)


def _add_lamps(effects: Effects, name: str, lights: list[Light]) -> None:
    on = [light for light in lights if _shines(light)]
    if on:
        more = f" and {len(on) - 1} more" if len(on) > 1 else ""
        effects.add("Light", name, True, f'"{on[0].name}"{more}')
    elif lights:
        effects.add("Light", name, False, f'"{lights[0].name}" has no power')
    else:
        effects.add("Light", name, False, "the scene has none")


def _has_size(light: Light) -> bool:
    """Whether the lamp is more than a point, so that shadows are soft."""
    if light.kind == "SUN":
        return 0.5 * light.angle >= SMALLEST_HALF_SUN
    return light.kind == "AREA" or light.radius >= SMALLEST_RADIUS


def _add_lamp_facts(effects: Effects, lamps: list[Light]) -> None:
    soft = [light for light in lamps if _has_size(light)]
    reason = f'lamp "{soft[0].name}" has a size' if soft else "no lamp has a size" if lamps else "there are no lamps"
    effects.add("Light", "soft shadows of lamps", bool(soft), reason)
    seen = [
        light for light in soft if light.kind != "SUN" and light.visibility & (_ALL_RAYS if light.use_mis else _CAMERA)
    ]
    cost = "every ray looks for lamps on its way" if seen else ""
    none = "no lamp with a size can be met by a ray" if soft else reason
    effects.add("Light", "visible lamps", bool(seen), f'rays may meet "{seen[0].name}"' if seen else none, cost=cost)
    shaded = [light for light in lamps if light.program is not None]
    reason = f'lamp "{shaded[0].name}" has nodes' if shaded else "no lamp has nodes that change it"
    effects.add("Light", "lamp nodes", bool(shaded), reason)
    measured = [light for light in shaded if light.program is not None and read_program(light.program).has("IES")]
    reason = f'lamp "{measured[0].name}" reads one' if measured else "no lamp reads one"
    effects.add("Light", "IES profiles", bool(measured), reason)


def _add_emissive(effects: Effects, shown: Shown) -> int:
    """Returns how many triangles are lights to choose from."""
    shining = [surface for surface in shown.surfaces if "emission" in surface.traits]
    name = "emissive meshes"
    if not shining:
        idle = [surface for surface in shown.idle if "emission" in surface.traits]
        note = f" ({idle[0].title} does, but is on no face that is drawn)" if idle else ""
        effects.add("Light", name, False, f"no material emits light{note}")
        return 0
    sampled = sum(surface.triangles for surface in shining if surface.sampled_as_light)
    cost = f"{sampled:,} triangles are lights to choose from" if sampled else "found by chance alone: not sampled"
    effects.add("Light", name, True, facts(shining, "emission"), cost=cost)
    return sampled


def _add_light_tree(effects: Effects, shown: Shown, lamps: list[Light], triangles: int) -> None:
    emitters = sum(light.kind != "SUN" for light in lamps) + triangles
    wanted = shown.scene.settings.light_tree
    on = wanted and emitters > 1
    if on:
        reason = f"chooses among {emitters:,} lights"
    elif not wanted:
        reason = "Light Tree is disabled: every light is chosen equally often"
    elif emitters:
        reason = "there is one light: nothing to choose"
    else:
        reason = "there are suns alone, which lie beside the tree" if lamps else "there are no lights to choose from"
    effects.add("Light", "light tree", on, reason)


def _add_world(effects: Effects, shown: Shown) -> None:
    world = shown.scene.world
    reading = read_program(world.program) if world else Reading()
    title, color = f'world "{world.name}"' if world else "", reading.emission()
    names = {name: (reading.has(*ops), noun) for name, (ops, noun) in _WORLDS.items()}
    if world is None or color == (0.0, 0.0, 0.0):
        none = f"{title} is black" if world else "the scene has no world"
        for name in ("world colour", *names, "world light sampling"):
            effects.add("Light", name, False, none)
        return
    if color is not None:
        numbers = " ".join(f"{part:.3g}" for part in color)
        effects.add("Light", "world colour", True, f"{title} has one colour, {numbers}")
    else:
        effects.add("Light", "world colour", False, f"{title} is not of one colour")
    for name, (found, noun) in names.items():
        on = found and color is None
        effects.add("Light", name, on, f"{title} shows {noun}" if on else f"{title} shows none")
    sampled = color is None and world.sampling != "NONE"
    if sampled:
        reason = f"{title} is brighter in some directions than in others"
    elif color is None:
        reason = f"Sampling of {title} is None"
    else:
        reason = f"{title} has one colour: no direction is better than another"
    effects.add("Light", "world light sampling", sampled, reason)
