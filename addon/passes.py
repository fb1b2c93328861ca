"""The table of render passes: Blender's names, channels, and what enables each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .settings import effective


@dataclass(frozen=True)
class RenderPass:
    """One pass as Blender knows it. channels: one letter each, the names in an EXR."""

    name: str
    channels: str
    kind: str  # "COLOR", "VECTOR", "VALUE"
    enabled_by: str = ""  # property of the view layer; "luch." and "cycles." reach into add-on settings


TABLE = (
    RenderPass("Depth", "Z", "VALUE", "use_pass_z"),
    RenderPass("Mist", "Z", "VALUE", "use_pass_mist"),
    RenderPass("Position", "XYZ", "VECTOR", "use_pass_position"),
    RenderPass("Normal", "XYZ", "VECTOR", "use_pass_normal"),
    RenderPass("UV", "UVA", "VECTOR", "use_pass_uv"),
    RenderPass("Object Index", "X", "VALUE", "use_pass_object_index"),
    RenderPass("Material Index", "X", "VALUE", "use_pass_material_index"),
    RenderPass("Diffuse Direct", "RGB", "COLOR", "use_pass_diffuse_direct"),
    RenderPass("Diffuse Indirect", "RGB", "COLOR", "use_pass_diffuse_indirect"),
    RenderPass("Diffuse Color", "RGB", "COLOR", "use_pass_diffuse_color"),
    RenderPass("Glossy Direct", "RGB", "COLOR", "use_pass_glossy_direct"),
    RenderPass("Glossy Indirect", "RGB", "COLOR", "use_pass_glossy_indirect"),
    RenderPass("Glossy Color", "RGB", "COLOR", "use_pass_glossy_color"),
    RenderPass("Transmission Direct", "RGB", "COLOR", "use_pass_transmission_direct"),
    RenderPass("Transmission Indirect", "RGB", "COLOR", "use_pass_transmission_indirect"),
    RenderPass("Transmission Color", "RGB", "COLOR", "use_pass_transmission_color"),
    RenderPass("Volume Direct", "RGB", "COLOR", "cycles.use_pass_volume_direct"),
    RenderPass("Volume Indirect", "RGB", "COLOR", "cycles.use_pass_volume_indirect"),
    RenderPass("Emission", "RGB", "COLOR", "use_pass_emit"),
    RenderPass("Environment", "RGB", "COLOR", "use_pass_environment"),
    RenderPass("Ambient Occlusion", "RGB", "COLOR", "use_pass_ambient_occlusion"),
    RenderPass("Denoising Albedo", "RGB", "COLOR", "luch.use_pass_denoising"),
    RenderPass("Denoising Normal", "XYZ", "VECTOR", "luch.use_pass_denoising"),
    RenderPass("Sample Count", "X", "VALUE", "luch.use_pass_sample_count"),
    RenderPass("Render Time", "X", "VALUE", "luch.use_pass_render_time"),
    RenderPass("Error", "RGB", "COLOR", "luch.use_pass_error"),
    RenderPass("Reliability", "X", "VALUE", "luch.use_pass_reliability"),
)

NOISY = RenderPass("Noisy Image", "RGBA", "COLOR")  # Combined before denoising, where that is on, as Cycles has it

# Passes of Cycles that guide its own sampling of volumes or its denoising, and what a shadow catcher catches.
NOT_RENDERED = {
    "Shadow Catcher": "cycles.use_pass_shadow_catcher",
    "Denoising Specular Albedo": "cycles.denoising_store_passes",
    "Denoising Roughness": "cycles.denoising_store_passes",
    "Denoising Depth": "cycles.denoising_store_passes",
    "Volume Scatter": "cycles.use_pass_volume_scatter",
    "Volume Transmit": "cycles.use_pass_volume_transmit",
    "Volume Majorant": "cycles.use_pass_volume_majorant",
}

# What Luch's own switches mean in files that were set up for Cycles.
CYCLES_SWITCHES = {
    "luch.use_pass_denoising": "cycles.denoising_store_passes",
    "luch.use_pass_sample_count": "cycles.pass_debug_sample_count",
    "luch.use_pass_render_time": "cycles.pass_render_time",
}

CRYPTOMATTE_KINDS = ("Object", "Material", "Asset")


def _switched_on(view_layer: Any, path: str) -> bool:
    owner: Any = view_layer
    for name in path.split("."):
        owner = getattr(owner, name, False)
    return bool(owner)


def cryptomatte_kinds(view_layer: Any) -> list[str]:
    """Kinds of cryptomatte that the view layer asks for: of "Object", "Material", "Asset"."""
    return [kind for kind in CRYPTOMATTE_KINDS if _switched_on(view_layer, f"use_pass_cryptomatte_{kind.lower()}")]


def cryptomatte_depth(view_layer: Any) -> int:
    """How many objects a pixel can name; each pass holds two."""
    return int((min(16, view_layer.pass_cryptomatte_depth) + 1) // 2 * 2)


def _own_passes(view_layer: Any) -> Iterator[RenderPass]:
    """Passes that Luch gives their names, Combined first."""
    yield RenderPass("Combined", "RGBA", "COLOR")
    for entry in TABLE:
        switches = [entry.enabled_by, CYCLES_SWITCHES.get(entry.enabled_by, entry.enabled_by)]
        if any(_switched_on(view_layer, switch) for switch in switches):
            yield entry
    for kind in cryptomatte_kinds(view_layer):
        for index in range(cryptomatte_depth(view_layer) // 2):
            # Lower-case channels: OpenEXR's lossy DWA leaves those exact, and the values are bit patterns.
            yield RenderPass(f"Crypto{kind}{index:02d}", "rgba", "COLOR")


def enabled_aovs(view_layer: Any) -> tuple[list[Any], list[str]]:
    """The AOVs that are rendered, and the names of those that cannot be: another pass has that name."""
    taken = {NOISY.name, *(entry.name for entry in _own_passes(view_layer))}
    taken |= {f"Combined_{group.name}" for group in view_layer.lightgroups}
    valid = [aov for aov in view_layer.aovs if aov.is_valid]
    return [aov for aov in valid if aov.name not in taken], [aov.name for aov in valid if aov.name in taken]


def enabled_passes(view_layer: Any, scene: Any) -> Iterator[RenderPass]:
    """The passes of a view layer, Combined first, in the order Blender's compositor shows them; no name twice.

    scene: that of the layer, which does not know it while Blender renders.
    """
    yield from _own_passes(view_layer)
    if effective(scene, "use_denoising") and _switched_on(view_layer, "cycles.use_denoising"):
        yield NOISY
    for aov in enabled_aovs(view_layer)[0]:
        yield RenderPass(aov.name, "X", "VALUE") if aov.type == "VALUE" else RenderPass(aov.name, "RGBA", "COLOR")
    for group in view_layer.lightgroups:
        yield RenderPass(f"Combined_{group.name}", "RGB", "COLOR")


def missing_passes(view_layer: Any) -> list[str]:
    """Names of passes that the view layer asks for and Luch does not render."""
    return [name for name, switch in NOT_RENDERED.items() if _switched_on(view_layer, switch)]


def register_passes(engine: Any, scene: Any, view_layer: Any) -> None:
    """Tell Blender which passes the engine will deliver for a view layer."""
    for entry in enabled_passes(view_layer, scene):
        engine.register_pass(scene, view_layer, entry.name, len(entry.channels), entry.channels, entry.kind)
