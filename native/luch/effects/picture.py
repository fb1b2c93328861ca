"""Effects of the camera, of geometry, of the lengths of paths, and of the film."""

from __future__ import annotations

from luch import integrators
from luch.effects.lights import LAMPS
from luch.effects.shown import Shown
from luch.effects.surfaces import facts
from luch.effects.table import Effects
from luch.effects.volumes import add_volume_bounces
from luch.scene import PANORAMAS, Film, Mesh, Settings

_SUM_BYTES = 8  # a number of the film is a double
# Pass -> numbers of its own that a pixel keeps.
PASSES = {
    "Combined": 4, "Depth": 1, "Mist": 1, "Position": 3, "Normal": 3, "UV": 3, "Object Index": 1, "Material Index": 1,
    "Diffuse Direct": 3, "Diffuse Indirect": 3, "Diffuse Color": 3,
    "Glossy Direct": 3, "Glossy Indirect": 3, "Glossy Color": 3,
    "Transmission Direct": 3, "Transmission Indirect": 3, "Transmission Color": 3,
    "Volume Direct": 3, "Volume Indirect": 3,
    "Emission": 3, "Environment": 3, "Ambient Occlusion": 3, "Denoising Albedo": 3, "Denoising Normal": 3,
    "Sample Count": 0,
    "Render Time": 1,
    "Error": 0,  # from what the estimate of the error keeps
    "Reliability": 0,
}  # fmt: skip
_COUNTS_BYTES = 4  # samples of a pixel

# What the exporter meets and Luch cannot draw: effect, group, why it is off where nothing was met.
_LATER = (
    ("stereoscopy", "Camera", "no panorama asks for spherical stereo"),
    ("heterogeneous volumes", "Geometry", "no volume changes from place to place"),
    ("displacement", "Geometry", "no material displaces its surface"),
    ("light linking", "Light", "no object uses it"),
)


def add_camera(effects: Effects, shown: Shown) -> None:
    """Lens and projection."""
    camera = shown.scene.camera
    stop = f"the f-stop is set (f/{camera.fstop:g})"
    if camera.use_dof:
        reason = f"f/{camera.fstop:g}, in focus at {camera.focus_distance:.4g} m"
        effects.add("Camera", "depth of field", True, reason, cost="two more random numbers per path")
    else:
        reason = f"{stop} but the camera's Depth of Field is disabled"
        effects.add("Camera", "depth of field", False, reason)
    polygon = camera.blades >= 3
    none = "the aperture is round" if camera.use_dof else "there is no depth of field"
    on = camera.use_dof and polygon
    effects.add("Camera", "aperture blades", on, f"{camera.blades} blades" if on else none)
    panorama = camera.kind in PANORAMAS
    kind = {"PERSP": "perspective", "ORTHO": "orthographic"}.get(camera.kind, camera.kind)
    reason = "the camera sees all around" if panorama else f"the camera is {kind}"
    effects.add("Camera", "panorama", panorama, reason)


def add_geometry(effects: Effects, shown: Shown) -> None:
    """Instances, point clouds, hair."""
    repeated = {mesh: count for mesh, count in shown.uses.items() if count > 1}
    if repeated:
        triangles, spheres = (
            sum(count_of(shown.scene.meshes[mesh]) * (count - 1) for mesh, count in repeated.items())
            for count_of in (_triangle_count, _sphere_count)
        )
        saved = f"{triangles:,} triangles" + (f" and {spheres:,} spheres" if spheres else "")
        meshes = "1 mesh is" if len(repeated) == 1 else f"{len(repeated)} meshes are"
        reason = f"{meshes} drawn {sum(repeated.values()):,} times"
        effects.add("Geometry", "instancing", True, reason, cost=f"saves {saved}")
    else:
        effects.add("Geometry", "instancing", False, "every mesh is drawn once" if shown.uses else "nothing is drawn")
    clouds = {mesh: count for mesh in shown.uses if (count := _sphere_count(shown.scene.meshes[mesh]))}
    if clouds:
        first = shown.scene.meshes[next(iter(clouds))].name
        more = f" and {len(clouds) - 1} more" if len(clouds) > 1 else ""
        reason = f'"{first}"{more}: {sum(clouds.values()):,} spheres'
        effects.add("Geometry", "point clouds", True, reason, cost="a search of their own for every ray")
    elif "point clouds" not in shown.scene.unsupported:  # as in a file of a Luch that could not draw them
        effects.add("Geometry", "point clouds", False, "the scene has none")
    moved = [shown.scene.meshes[mesh].name for mesh in shown.uses if shown.scene.meshes[mesh].displaced]
    if moved:
        more = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
        reason = f'"{moved[0]}"{more}: vertices were moved by their materials at export'
        effects.add("Geometry", "displacement", True, reason, cost="nothing while rendering")
    _add_hair(effects, shown)


_SHAPES = {
    "RIBBON": "ribbons that face each ray, in 2^{n} straight pieces a segment",
    "THICK": "round curves",
    "THICK_LINEAR": "round cones between their points",
}


def _add_hair(effects: Effects, shown: Shown) -> None:
    curves = {mesh: curves for mesh in shown.uses if (curves := shown.scene.meshes[mesh].curves) is not None}
    if curves:
        first = shown.scene.meshes[next(iter(curves))].name
        more = f" and {len(curves) - 1} more" if len(curves) > 1 else ""
        count, points = (
            sum(len(array) for array in arrays)
            for arrays in zip(*((c.first, c.points) for c in curves.values()), strict=True)
        )
        settings = shown.scene.settings
        shape = _SHAPES.get(settings.curve_shape, settings.curve_shape).format(n=min(settings.curve_subdivisions, 4))
        reason = f'"{first}"{more}: {count:,} curves of {points:,} points, drawn as {shape}'
        effects.add("Geometry", "hair", True, reason, cost="a search of their own for every ray")
    elif "hair" not in shown.scene.unsupported:  # as in a file of a Luch that could not draw it
        effects.add("Geometry", "hair", False, "the scene has none")


def _triangle_count(mesh: Mesh) -> int:
    return len(mesh.triangles)


def _sphere_count(mesh: Mesh) -> int:
    return 0 if mesh.spheres is None else len(mesh.spheres)


def add_paths(effects: Effects, shown: Shown) -> None:
    """Which bounces can matter, and what cuts light off."""
    settings = shown.scene.settings
    most = [
        _add_bounces(effects, shown, "diffuse", ("diffuse",)),
        _add_bounces(effects, shown, "glossy", ("glossy",)),
        _add_bounces(
            effects,
            shown,
            "transmission",
            ("transmission", "translucency", "thin subsurface", "hair transmission"),
        ),
    ]
    most.append(add_volume_bounces(effects, shown))
    _add_bounces(effects, shown, "transparent", ("transparency",))
    reach = min(settings.max_bounces, sum(most))
    if reach:
        reason = f"{reach} at most: what the kinds that are on allow, up to {settings.max_bounces}"
    elif settings.max_bounces:
        reason = "no kind of bounce is on: direct light alone"
    else:
        reason = "Max Bounces is 0: direct light alone"
    effects.add("Paths", "indirect light", reach > 0, reason)
    _add_limits(effects, shown, effects["diffuse bounces"].on, effects["glossy bounces"].on)


def _add_bounces(effects: Effects, shown: Shown, kind: str, traits: tuple[str, ...]) -> int:
    """Returns how many bounces of the kind a path can make before it ends."""
    name = f"{kind} bounces"
    settings = shown.scene.settings
    limit = settings.bounces(kind)
    none = integrators.named(settings.integrator).why_none(kind)
    for trait in traits:
        found = [surface for surface in shown.surfaces if trait in surface.traits]
        if found:
            reason = f"up to {limit}: {facts(found, trait)}" if limit else f"{none}, though {facts(found, trait)}"
            effects.add("Paths", name, limit > 0, reason)
            return limit
    verb = {"diffuse": "scatters diffusely", "glossy": "reflects", "transmission": "transmits light"}
    reason = f"no material that is shown {verb.get(kind, 'is transparent')}: the limit of {limit} cannot matter"
    effects.add("Paths", name, False, reason)
    return 0


def _add_limits(effects: Effects, shown: Shown, diffuse: bool, glossy: bool) -> None:
    settings = shown.scene.settings
    through = effects["transmission bounces"].on
    for name, wanted, source, label in (
        ("reflective caustics", settings.caustics_reflective, glossy, "Reflective"),
        ("refractive caustics", settings.caustics_refractive, through, "Refractive"),
    ):
        able = diffuse and source
        on = wanted and able
        off = f"Caustics > {label} is disabled" if able else "they need diffuse bounces and such a surface"
        effects.add("Paths", name, on, "diffuse surfaces may be lit by way of such a surface" if on else off)
    _add_photon_maps(effects, settings)
    clamps = [
        f"{label} light above {limit:g} is cut"
        for label, limit in (("direct", settings.clamp_direct), ("indirect", settings.clamp_indirect))
        if limit > 0.0
    ]
    effects.add(
        "Paths", "clamping", bool(clamps), ", ".join(clamps) or "both limits are 0", cost="loses light" * bool(clamps)
    )
    blur = settings.filter_glossy
    mapped = effects["photon maps"].on
    on = blur > 0.0 and (glossy or through) and not mapped
    wanted_in_vain = "photon maps need none" if mapped else "nothing reflects or transmits"
    off = wanted_in_vain if blur > 0.0 else "Filter Glossy is 0"
    effects.add("Paths", "filter glossy", on, f"Filter Glossy is {blur:g}" if on else off)


_PHOTONS = "caustics of surfaces smoother than a roughness of .32 are brought by photons"


def no_photons(effects: Effects) -> str:
    """Why photon maps would bring nothing to the scene; "": they would."""
    if effects["volumes"].on:
        return "the scene has volumes, through which no photon is followed: paths find all light"
    caustics = any(effects[f"{kind} caustics"].on for kind in ("reflective", "refractive"))
    if not (caustics and effects["indirect light"].on):
        return "there are no caustics"
    lit = any(effects[name].on for name in (*LAMPS.values(), "emissive meshes", "world light sampling"))
    return "" if lit else "no light can be chosen to send photons from"


def _add_photon_maps(effects: Effects, settings: Settings) -> None:
    off = no_photons(effects) if settings.photon_maps else "the integrator is another"
    cost = "" if off else "photons are traced for every few samples, and gathered at every point"
    effects.add("Paths", "photon maps", not off, off or _PHOTONS, cost=cost)


def add_film(effects: Effects, shown: Shown) -> None:
    """What the picture keeps."""
    film = shown.scene.film
    reason = "Film > Transparent is enabled" if film.transparent else "Film > Transparent is disabled"
    effects.add("Film", "transparent film", film.transparent, reason)
    glass = film.transparent and film.transparent_glass
    through = effects["transmission"].on
    off = "nothing transmits light" if glass else "Film > Transparent Glass is disabled"
    on = glass and through
    effects.add("Film", "transparent glass", on, "Film > Transparent Glass is enabled" if on else off)
    told = shown.shadow_catchers
    reason = f'object "{told[0]}" is one: drawn as an ordinary object' if told else "no object is one"
    effects.add("Film", "shadow catcher", False, reason, missing=bool(told))
    _add_passes(effects, film)


def _add_passes(effects: Effects, film: Film) -> None:
    asked = {"Combined", *film.passes}
    for name, numbers in PASSES.items():
        cost = _bytes(numbers)
        if name == "Ambient Occlusion":
            cost += ", one more shadow ray at each point that the camera sees"
        on = name in asked
        effects.add("Film", f"pass {name}", on, "asked for" if on else "not asked for", cost=cost if on else "")
    layers = [name for name in film.passes if name.startswith("Crypto")]
    kinds = sorted({name.rstrip("0123456789")[len("Crypto") :] for name in layers})
    slots = max(film.cryptomatte_depth, 1)
    reason = f"{', '.join(kinds)}: {slots} names a pixel" if layers else "no Cryptomatte pass is asked for"
    effects.add("Film", "cryptomatte", bool(layers), reason, cost=_bytes(2 * slots * len(kinds)) if layers else "")
    aovs = [name for name, _ in film.aovs]
    cost = _bytes(4 * len(aovs)) if aovs else ""
    effects.add("Film", "AOVs", bool(aovs), ", ".join(aovs) or "the view layer has none", cost=cost)
    groups = film.lightgroups
    cost = _bytes(3 * len(groups)) if groups else ""
    effects.add("Film", "light groups", bool(groups), ", ".join(groups) or "the view layer has none", cost=cost)


def _bytes(numbers: int) -> str:
    return f"{numbers * _SUM_BYTES or _COUNTS_BYTES} bytes a pixel"


def add_later(effects: Effects, shown: Shown) -> None:
    """What the exporter met and Luch does not draw yet, in the exporter's own words."""
    told = dict(shown.scene.unsupported)
    told.pop("subsurface", None)  # told with the surfaces
    told.pop("motion blur", None)  # told with what moves
    for name, group, off in _LATER:
        if name in effects:
            continue
        _add_missing(effects, group, name, told.pop(name, []), off)
    for name, sentences in told.items():
        if name not in effects:
            _add_missing(effects, "Geometry", name, sentences, "")


def _add_missing(effects: Effects, group: str, name: str, sentences: list[str], off: str) -> None:
    more = f" And {len(sentences) - 1} more." if len(sentences) > 1 else ""
    effects.add(group, name, False, sentences[0] + more if sentences else off, missing=bool(sentences))
