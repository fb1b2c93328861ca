"""Scenes without an effect: what it costs, and what it brings, is found by comparing.

>>> without(scene, ["depth of field"]).camera.use_dof                      # doctest: +SKIP
False
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from luch.effects.editing import Change, Editor, rewrite
from luch.scene import Mesh, Scene
from luch.shader_code import PRINCIPLED, Node


@dataclass(frozen=True)
class Removal:
    """How an effect is left out, and what is drawn instead."""

    instead: str
    apply: Callable[[Scene], Scene]


def without(scene: Scene, names: Sequence[str]) -> Scene:
    """The scene with the effects left out; `scene` itself stays as it is.

    Raises ValueError for a name that is no effect, or one that cannot be left out.
    """
    for name in names:
        if name not in REMOVALS:
            raise ValueError(f'The effect "{name}" cannot be left out. These can: {", ".join(sorted(REMOVALS))}.')
        scene = REMOVALS[name].apply(scene)
    return scene


# -- programs ---------------------------------------------------------------------------------


def _surfaces(change: Change) -> Callable[[Scene], Scene]:
    """Changes the programs of all materials."""

    def apply(scene: Scene) -> Scene:
        return replace(scene, materials=[replace(m, surface=rewrite(m.surface, change)) for m in scene.materials])

    return apply


def _dropped(*names: str) -> Change:
    return lambda _, node: None if node.op.name in names else node


def _zeroed(inputs: Mapping[str, tuple[str, ...]], dropped: tuple[str, ...] = ()) -> Change:
    """inputs: closure -> inputs of it that become 0. dropped: closures that vanish."""

    def change(editor: Editor, node: Node) -> Node | None:
        if node.op.name in dropped:
            return None
        kind = "CLOSURE_PRINCIPLED" if node.op.name in PRINCIPLED else node.op.name
        for name in inputs.get(kind, ()):
            node = editor.with_input(node, name, 0.0)
        return node

    return change


def _flattened(editor: Editor, node: Node) -> Node:
    """Nothing goes under the surface: the radius is 0."""
    names = {"CLOSURE_SUBSURFACE": "radius", "CLOSURE_PRINCIPLED_SUBSURFACE": "subsurface_radius"}
    return editor.with_input(node, names[node.op.name], 0.0) if node.op.name in names else node


def _straight(operation: str) -> Change:
    """An operation that bends the normal by a strength, its first input."""

    def change(editor: Editor, node: Node) -> Node:
        return editor.with_place(node, 0, 1, 0.0) if node.op.name == operation else node

    return change


def _dark(scene: Scene) -> Scene:
    scene = _surfaces(_zeroed({"CLOSURE_PRINCIPLED": ("emission_strength",)}, ("CLOSURE_EMISSION",)))(scene)
    return replace(scene, materials=[replace(m, emission_estimate=(0.0, 0.0, 0.0)) for m in scene.materials])


def _no_holdout(scene: Scene) -> Scene:
    scene = _surfaces(_dropped("CLOSURE_HOLDOUT"))(scene)
    return replace(scene, objects=[replace(subject, holdout=False) for subject in scene.objects])


# -- the rest of the scene --------------------------------------------------------------------


def _settings(**values: Any) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, settings=replace(scene.settings, **values))


def _camera(**values: Any) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, camera=replace(scene.camera, **values))


def _film(**values: Any) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, film=replace(scene.film, **values))


def _no_lamps(kind: str) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, lights=[light for light in scene.lights if light.kind != kind])


def _no_world(scene: Scene) -> Scene:
    return replace(scene, world=None)


def _no_volumes(scene: Scene) -> Scene:
    materials = [replace(material, volume=None) for material in scene.materials]
    return replace(scene, materials=materials, world=scene.world and replace(scene.world, volume=None))


def _unsampled_world(scene: Scene) -> Scene:
    return replace(scene, world=scene.world and replace(scene.world, sampling="NONE"))


def _still_objects(scene: Scene) -> Scene:
    return replace(scene, instances=scene.instances and replace(scene.instances, motion=None))


def _still_shapes(scene: Scene) -> Scene:
    return replace(scene, meshes=[_still_shape(mesh) for mesh in scene.meshes])


def _still_shape(mesh: Mesh) -> Mesh:
    curves = mesh.curves and replace(mesh.curves, motion_points=None)
    return replace(mesh, motion_positions=None, motion_normals=None, curves=curves)


def _no_primitives(domain: str, **none: Any) -> Callable[[Scene], Scene]:
    """Of that domain, nor what they know of themselves."""

    def bare(mesh: Mesh) -> Mesh:
        kept = {name: of for name, of in mesh.attributes.items() if not of.domain.startswith(domain)}
        return replace(mesh, attributes=kept, **none)

    return lambda scene: replace(scene, meshes=[bare(mesh) for mesh in scene.meshes])


def _no_pass(prefix: str) -> Callable[[Scene], Scene]:
    def apply(scene: Scene) -> Scene:
        left = [name for name in scene.film.passes if not name.startswith(prefix)]
        return replace(scene, film=replace(scene.film, passes=left))

    return apply


_OPAQUE = {"CLOSURE_PRINCIPLED": ("transmission_weight",)}
_FILMS = ("CLOSURE_PRINCIPLED", "CLOSURE_METALLIC", "CLOSURE_GLASS")
_BLACK = "black"
_MIDDLE = "it stands still as it is in the shutter's middle"
_NOT_STORED = "the pass is not there"
_PASSES = (
    "Depth", "Mist", "Position", "Normal", "UV", "Object Index", "Material Index", "Diffuse Direct",
    "Diffuse Indirect", "Diffuse Color", "Glossy Direct", "Glossy Indirect", "Glossy Color", "Transmission Direct",
    "Transmission Indirect", "Transmission Color", "Volume Direct", "Volume Indirect", "Emission", "Environment", "Ambient Occlusion", "Denoising Albedo",
    "Denoising Normal", "Sample Count", "Render Time", "Error", "Reliability",
)  # fmt: skip

# Effect, by its name in luch.effects -> how it is left out.
REMOVALS: dict[str, Removal] = {
    "transparency": Removal(
        "what went straight through is lost",
        _surfaces(_dropped("CLOSURE_TRANSPARENT")),
    ),
    "transparent shadows": Removal(
        "opaque shadows",
        lambda scene: replace(scene, materials=[replace(m, transparent_shadows=False) for m in scene.materials]),
    ),
    "transmission": Removal(
        "glass is black, a Principled surface shows its base",
        _surfaces(_zeroed(_OPAQUE, ("CLOSURE_GLASS", "CLOSURE_REFRACTION"))),
    ),
    "translucency": Removal(_BLACK, _surfaces(_dropped("CLOSURE_TRANSLUCENT"))),
    "coat": Removal("the surface below", _surfaces(_zeroed({"CLOSURE_PRINCIPLED": ("coat_weight",)}))),
    "sheen": Removal(
        "the surface below; a Sheen BSDF is black",
        _surfaces(_zeroed({"CLOSURE_PRINCIPLED": ("sheen_weight",)}, ("CLOSURE_SHEEN",))),
    ),
    "anisotropy": Removal(
        "round highlights",
        _surfaces(
            _zeroed(
                {
                    "CLOSURE_PRINCIPLED": ("anisotropic",),
                    "CLOSURE_GLOSSY": ("anisotropy",),
                    "CLOSURE_METALLIC": ("anisotropy",),
                }
            )
        ),
    ),
    "thin film": Removal("the surface below", _surfaces(_zeroed(dict.fromkeys(_FILMS, ("thin_film_thickness",))))),
    "subsurface": Removal("a diffuse surface of its colour", _surfaces(_flattened)),
    "bump": Removal("the normal below", _surfaces(_straight("BUMP"))),
    "normal maps": Removal("the normal below", _surfaces(_straight("NORMAL_MAP"))),
    "holdout": Removal("the object itself", _no_holdout),
    "point lamps": Removal("darkness", _no_lamps("POINT")),
    "spot lamps": Removal("darkness", _no_lamps("SPOT")),
    "sun lamps": Removal("darkness", _no_lamps("SUN")),
    "area lamps": Removal("darkness", _no_lamps("AREA")),
    "lamp nodes": Removal(
        "the lamp's own colour and power",
        lambda scene: replace(scene, lights=[replace(light, program=None) for light in scene.lights]),
    ),
    "emissive meshes": Removal("darkness", _dark),
    "light tree": Removal("every light is chosen equally often", _settings(light_tree=False)),
    "world colour": Removal("darkness", _no_world),
    "environment image": Removal("darkness", _no_world),
    "sky": Removal("darkness", _no_world),
    "procedural world": Removal("darkness", _no_world),
    "world light sampling": Removal("the world is found by chance alone", _unsampled_world),
    "depth of field": Removal("everything is in focus", _camera(use_dof=False)),
    "camera motion": Removal(_MIDDLE, _camera(motion=None)),
    "object motion": Removal(_MIDDLE, _still_objects),
    "deformation motion": Removal(_MIDDLE, _still_shapes),
    "aperture blades": Removal("a round aperture", _camera(blades=0)),
    "point clouds": Removal("nothing", _no_primitives("SPHERE", spheres=None)),
    "hair": Removal("nothing", _no_primitives("CURVE", curves=None)),
    "volumes": Removal("empty space", _no_volumes),
    "volume bounces": Removal("light scatters once", _settings(volume_bounces=0)),
    "indirect light": Removal("direct light alone", _settings(max_bounces=0)),
    "diffuse bounces": Removal("paths end there", _settings(diffuse_bounces=0)),
    "glossy bounces": Removal("paths end there", _settings(glossy_bounces=0)),
    "transmission bounces": Removal("paths end there", _settings(transmission_bounces=0)),
    "transparent bounces": Removal("paths end there", _settings(transparent_bounces=0)),
    "reflective caustics": Removal("their light is lost", _settings(caustics_reflective=False)),
    "refractive caustics": Removal("their light is lost", _settings(caustics_refractive=False)),
    "clamping": Removal("no light is cut", _settings(clamp_direct=0.0, clamp_indirect=0.0)),
    "filter glossy": Removal("no reflection is blurred", _settings(filter_glossy=0.0)),
    "transparent film": Removal("the world behind", _film(transparent=False)),
    "transparent glass": Removal("glass hides what is behind", _film(transparent_glass=False)),
    "cryptomatte": Removal(_NOT_STORED, _no_pass("Crypto")),
    "AOVs": Removal(_NOT_STORED, _film(aovs=[])),
    "light groups": Removal(_NOT_STORED, _film(lightgroups=[])),
    **{f"pass {name}": Removal(_NOT_STORED, _no_pass(name)) for name in _PASSES},
}
