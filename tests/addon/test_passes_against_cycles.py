"""Every render pass against Cycles' of the same name, in one scene that has something for each of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

F32 = NDArray[np.float32]
SIZE = 24
VEIL = 5  # pass index of the half-transparent plane
SAMPLES = 256

# Passes that are the same in every sample, or of one sample at the pixel's centre: largest difference.
EXACT = {
    "Depth": 2e-3,
    "Position": 6e-3,
    "UV": 1e-3,
    "Object Index": 0.0,
    "Material Index": 0.0,
    "Mist": 1e-3,
    "glow": 5e-4,
    "wear": 1e-3,
    "Normal": 1e-3,  # Cycles keeps normals in 16 bits a coordinate
    "Denoising Normal": 1e-3,
    "Diffuse Color": 2e-3,
    "Transmission Color": 2e-3,
    "Emission": 2e-5,
    "Environment": 2e-5,
}
# Behind the half-transparent veil even these depend on which samples went through it.
THROUGH_VEIL = {"Mist", "Diffuse Color", "Transmission Color", "Denoising Normal"}
# Noisy passes: the bias (relMSE) left when the noise of independent pictures is taken out, and the energy's
# error. Bounds are what the noise of these pictures leaves, doubled.
NOISY = {
    "Combined": (1e-3, 0.01),
    "Diffuse Direct": (1e-3, 0.01),
    "Diffuse Indirect": (5e-3, 0.04),
    "Glossy Direct": (8e-3, 0.01),
    "Glossy Indirect": (2e-2, 0.04),
    "Glossy Color": (1e-3, 0.01),
    "Transmission Indirect": (1.5e-2, 0.03),
    "Ambient Occlusion": (1e-3, 0.01),
    "Denoising Albedo": (1e-3, 0.01),
    "Combined_key": (5e-3, 0.02),
    "Combined_sky": (1e-3, 0.01),
}
LEAST_COLOR = 0.02  # a light pass means nothing where its colour is next to nothing


def material(name: str, index: int, **inputs: Any) -> bpy.types.Material:
    """A Principled material with both AOVs written."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.pass_index = index
    tree = made.node_tree
    for key, value in inputs.items():
        tree.nodes["Principled BSDF"].inputs[key.replace("_", " ")].default_value = value
    glow = tree.nodes.new("ShaderNodeOutputAOV")
    glow.aov_name, glow.inputs["Color"].default_value = "glow", (0.1 * index, 0.5, 2.0, 1.0)
    wear = tree.nodes.new("ShaderNodeOutputAOV")
    wear.aov_name, wear.inputs["Value"].default_value = "wear", 0.25 * index
    return made


def add(shape: str, index: int, made: bpy.types.Material, **placing: Any) -> None:
    getattr(bpy.ops.mesh, f"primitive_{shape}_add")(**placing)
    thing = bpy.context.object
    thing.name, thing.pass_index = made.name, index
    thing.data.materials.append(made)


def build(scene: bpy.types.Scene) -> None:
    """Five materials under an area lamp (group key) and a sky (group sky)."""
    add("plane", 1, material("Floor", 1, Base_Color=(0.8, 0.4, 0.2, 1), Roughness=1.0), size=12)
    add("cube", 2, material("Metal", 2, Metallic=1.0, Roughness=0.4), size=1.2, location=(-1.5, 0.3, 0.6))
    glass = material("Glass", 3, Transmission_Weight=1.0, Roughness=0.3, Base_Color=(0.9, 1, 0.8, 1))
    add("cube", 3, glass, size=1.2, location=(0, 0.3, 0.8), rotation=(0.3, 0, 0.4))
    lit = material("Lit", 4, Emission_Color=(1, 0.5, 0.2, 1), Emission_Strength=0.5, Specular_IOR_Level=0.0)
    add("cube", 4, lit, size=1.0, location=(1.6, 0.5, 0.5), rotation=(0, 0, 0.5))
    veil = material("Veil", 5, Alpha=0.6, Base_Color=(0.2, 0.3, 0.9, 1))
    add("plane", VEIL, veil, size=1.0, location=(0.2, -1.6, 0.5), rotation=(1.3, 0.1, 0.2))
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.data.energy, lamp.data.size = 300.0, 5.0  # large: small lamps make noisy caustics
    lamp.location = (2.0, -2.0, 4.0)
    lamp.rotation_euler = (0.6, 0.4, 0.0)
    lamp.lightgroup = "key"
    scene.collection.objects.link(lamp)
    world = bpy.data.worlds.new("World")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.4, 0.6, 1.0, 1.0)
    world.lightgroup = "sky"
    world.mist_settings.start, world.mist_settings.depth, world.mist_settings.falloff = 3.0, 9.0, "QUADRATIC"
    world.light_settings.distance = 1.0
    scene.world = world
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.data.lens = (0.3, -6.0, 2.2), (1.3, 0, 0), 35.0
    scene.collection.objects.link(camera)
    scene.camera = camera


def ask_for_passes(scene: bpy.types.Scene) -> None:
    layer = scene.view_layers[0]
    for name in ("z", "mist", "position", "normal", "uv", "object_index", "material_index", "emit", "environment"):
        setattr(layer, f"use_pass_{name}", True)
    for kind in ("diffuse", "glossy", "transmission"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{kind}_{part}", True)
    layer.use_pass_ambient_occlusion = True
    layer.cycles.denoising_store_passes = True
    for kind in ("object", "material", "asset"):
        setattr(layer, f"use_pass_cryptomatte_{kind}", True)
    for name, kind in (("glow", "COLOR"), ("wear", "VALUE")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
    for group in ("key", "sky"):
        layer.lightgroups.add(name=group)


@pytest.fixture
def pictures(
    scene: bpy.types.Scene, render_passes: Callable[..., dict[str, F32]]
) -> Callable[..., dict[str, list[dict[str, F32]]]]:
    """Two renders of each engine with seeds of their own, all passes."""
    build(scene)
    ask_for_passes(scene)
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.filter_width = 0.01  # every sample at the pixel's centre: both engines see the same points
    scene.cycles.film_exposure = 1.5

    def all_passes(*, transparent: bool = False) -> dict[str, list[dict[str, F32]]]:
        scene.render.film_transparent = transparent
        size = {"width": SIZE, "height": SIZE, "samples": SAMPLES}
        return {engine: [render_passes(engine, **size, seed=seed) for seed in (1, 2)] for engine in ("CYCLES", "LUCH")}

    return all_passes


def compare_exact(name: str, theirs: F32, ours: F32, bound: float, chosen: NDArray[np.bool_]) -> str | None:
    """A complaint, or None. A pixel in fifty may lie on an edge where the two see different things."""
    scale = np.maximum(1.0, np.abs(theirs))
    off = (np.abs(ours - theirs) / scale).max(axis=2)[chosen]
    share = float((off > bound).mean())
    print(f"{name:22} exact   98 % of pixels within {np.quantile(off, 0.98):.1e}, beyond {bound:.0e}: {share:.2%}")
    return None if share <= 0.02 else f"{name}: {share:.1%} of the pixels differ by more than {bound:g}"


def compare_noisy(name: str, theirs: list[dict[str, F32]], ours: list[dict[str, F32]]) -> str | None:
    color = name.replace("Direct", "Color").replace("Indirect", "Color")
    colors = [passes[color] for passes in (*theirs, *ours)] if color != name else []
    chosen = np.all([pixels.min(axis=2) > LEAST_COLOR for pixels in colors], axis=0) if colors else slice(None)
    cycles, luch = ([passes[name][..., :3].astype(np.float64)[chosen] for passes in side] for side in (theirs, ours))
    reference = np.mean(cycles, axis=0)
    a, b = (c - o for c, o in zip(cycles, luch, strict=True))
    bias = float(np.mean(a * b / (np.abs(reference) + 0.01) ** 2))
    energy = float(np.mean(luch) / reference.mean())
    most_bias, most_energy = NOISY[name]
    print(f"{name:22} noisy   bias {bias:+.1e} (at most {most_bias:g}), energy {energy:.4f}")
    if abs(bias) <= most_bias and abs(energy - 1) <= most_energy:
        return None
    return f"{name}: bias {bias:.1e} (at most {most_bias:g}), energy {energy:.4f} (within {most_energy:g})"


def compare_cryptomatte(theirs: dict[str, F32], ours: dict[str, F32]) -> list[str]:
    """Ids and weights of each pixel, whatever slot they stand in."""
    complaints = []
    for kind in ("Object", "Material", "Asset"):
        layers = [f"Crypto{kind}0{i}" for i in range(3)]
        a, b = (np.concatenate([passes[name] for name in layers], axis=2) for passes in (theirs, ours))
        differ = 0
        for y, x in np.ndindex(SIZE, SIZE):
            weights = []
            for pixel in (a[y, x], b[y, x]):
                pairs = zip(pixel[0::2].tolist(), pixel[1::2].tolist(), strict=True)
                weights.append({i: w for i, w in pairs if w > 0.05})
            same = weights[0].keys() == weights[1].keys()
            differ += not (same and all(abs(weights[0][i] - weights[1][i]) < 0.2 for i in weights[0]))
        print(f"Crypto{kind:16} ids     {differ} of {SIZE * SIZE} pixels differ")
        if differ > 0.01 * SIZE * SIZE:
            complaints.append(f"Crypto{kind}: {differ} pixels differ")
    return complaints


def test_every_pass_agrees_with_cycles(pictures: Callable[..., dict[str, list[dict[str, F32]]]]) -> None:
    seen = pictures()
    theirs, ours = seen["CYCLES"], seen["LUCH"]
    expected = {*EXACT, *NOISY, *(f"Crypto{kind}0{i}" for kind in ("Object", "Material", "Asset") for i in range(3))}
    assert expected <= set(ours[0]), f"missing: {expected - set(ours[0])}"
    veil = theirs[0]["Object Index"][..., 0] == VEIL
    complaints = []
    for name, bound in EXACT.items():
        chosen = ~veil if name in THROUGH_VEIL else np.ones_like(veil)
        complaints.append(compare_exact(name, theirs[0][name], ours[0][name], bound, chosen))
    complaints += [compare_noisy(name, theirs, ours) for name in NOISY]
    complaints += compare_cryptomatte(theirs[0], ours[0])
    found = [complaint for complaint in complaints if complaint]
    assert not found, "\n".join(found)


def test_a_transparent_film_agrees_with_cycles(pictures: Callable[..., dict[str, list[dict[str, F32]]]]) -> None:
    seen = pictures(transparent=True)
    theirs, ours = seen["CYCLES"], seen["LUCH"]
    complaints = [compare_noisy("Combined", theirs, ours)]
    alphas = [np.mean([passes["Combined"][..., 3] for passes in side], axis=0) for side in (theirs, ours)]
    off = np.abs(alphas[0] - alphas[1])
    print(f"Alpha: largest difference {off.max():.3f}, mean {off.mean():.1e}")
    assert off.mean() < 2e-3 and off.max() < 0.15
    assert not any(complaints), complaints
