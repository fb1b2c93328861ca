"""Which value a setting has: Luch's own where the user touched it, else what the file was set up with for Cycles."""

from __future__ import annotations

from typing import Any

# Settings that both engines have, under the name they share in `scene.luch` and `scene.cycles`.
SHARED_WITH_CYCLES = frozenset(
    {
        "samples",
        "preview_samples",
        "time_limit",
        "use_denoising",
        "seed",
        "use_animated_seed",
        "max_bounces",
        "diffuse_bounces",
        "glossy_bounces",
        "transmission_bounces",
        "volume_bounces",
        "transparent_max_bounces",
        "min_light_bounces",
        "min_transparent_bounces",
        "sample_clamp_direct",
        "sample_clamp_indirect",
        "blur_glossy",
        "caustics_reflective",
        "caustics_refractive",
        "use_light_tree",
        "light_sampling_threshold",
        "film_exposure",
        "film_transparent_glass",
        "film_transparent_roughness",
        "pixel_filter_type",
        "filter_width",
    }
)


def follows_cycles(scene: Any, name: str) -> bool:
    """True if a setting's value comes from Cycles: set there by the user, never set here."""
    own: Any = scene.luch
    cycles: Any = getattr(scene, "cycles", None)
    return (
        name in SHARED_WITH_CYCLES
        and cycles is not None
        and own.follow_cycles
        and not own.is_property_set(name)
        and cycles.is_property_set(name)
    )


def effective(scene: Any, name: str) -> Any:
    """The value a render uses. Unset in both engines, Luch's default holds: it never darkens the light (no clamping)."""
    owner: Any = scene.cycles if follows_cycles(scene, name) else scene.luch
    return getattr(owner, name)


def names_of(text: str) -> list[str]:
    """Names with semicolons between them, as a property keeps a list."""
    return [name.strip() for name in text.split(";") if name.strip()]
