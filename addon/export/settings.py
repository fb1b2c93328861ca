"""Settings: `scene.luch`, with Cycles' values where only those were set."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from luch.scene import Settings
from luch.stopping import CUSTOM, UNLIMITED_SAMPLES

from .. import command_line
from ..report_job import folder_of
from ..settings import effective, names_of
from .context import ExportContext

SAME_NAME = (
    "samples",
    "time_limit",
    "max_bounces",
    "diffuse_bounces",
    "glossy_bounces",
    "transmission_bounces",
    "volume_bounces",
    "min_light_bounces",
    "min_transparent_bounces",
    "caustics_reflective",
    "caustics_refractive",
    "light_sampling_threshold",
)

# Cycles' names of what curves look like -> Settings.curve_shape.
SHAPES = {"RIBBONS": "RIBBON", "THICK": "THICK", "THICK_LINEAR": "THICK_LINEAR"}


def export_settings(context: ExportContext) -> Settings:
    """What trades accuracy for time."""
    scene = context.scene
    settings = Settings(
        seed=_seed(scene),
        sampler=scene.luch.sampling_pattern,
        integrator=scene.luch.integrator,
        threads=_threads(scene),
        transparent_bounces=effective(scene, "transparent_max_bounces"),
        clamp_direct=effective(scene, "sample_clamp_direct"),
        clamp_indirect=effective(scene, "sample_clamp_indirect"),
        filter_glossy=effective(scene, "blur_glossy"),
        light_tree=effective(scene, "use_light_tree"),
        accelerator=scene.luch.accelerator,
        precision=scene.luch.precision,
        device=scene.luch.device,
        gpus=scene.luch.gpus,
        own_kernels=scene.luch.own_kernels,
        texture_memory=scene.luch.texture_memory,
        estimate_error=scene.luch.estimate_error,
        verify=scene.luch.verify,
        denoise=effective(scene, "use_denoising"),
        quality=scene.luch.quality,
        quality_report=report_of(scene) if scene.luch.quality_by_report else "",
        adaptive=scene.luch.use_adaptive_sampling,
        error_limit=scene.luch.error_limit_percent / 100.0,
        without_effects=names_of(scene.luch.without_effects),
        force_effects=["ALL"] if scene.luch.force_effects else [],
        **{name: effective(scene, name) for name in SAME_NAME},
    )
    curves = getattr(scene, "cycles_curves", None)
    if curves is not None:
        settings.curve_shape = SHAPES.get(curves.shape, "RIBBON")
        settings.curve_subdivisions = curves.subdivisions
    if context.view_layer.samples > 0:
        settings.samples = context.view_layer.samples
    if scene.world is not None:
        settings.ao_distance = scene.world.light_settings.distance
    return replace(settings, **command_line.current())


def export_view_settings(context: ExportContext) -> Settings:
    """Of a 3D viewport: with limits of its own, and nothing that takes a pilot, a second render or another filter."""
    scene = context.scene
    settings = export_settings(context)
    return replace(
        settings,
        samples=effective(scene, "preview_samples") or UNLIMITED_SAMPLES,
        time_limit=scene.luch.preview_time_limit,
        error_limit=scene.luch.preview_error_limit_percent / 100.0,
        # Trials of several structures take longer than a view stays as it is.
        accelerator="BVH" if settings.accelerator == "AUTO" else settings.accelerator,
        quality=CUSTOM,
        denoise=False,
        verify=False,
        mergeable=False,
        first_sample=0,
        samples_in_all=0,
    )


def report_of(scene: Any) -> str:
    """The file of the scene's last report."""
    return str(folder_of(scene) / "report.json")


def _seed(scene: Any) -> int:
    """The seed of this frame: another one in every frame if the user asks so."""
    seed = int(effective(scene, "seed"))
    if not effective(scene, "use_animated_seed"):
        return seed
    # Any mixing of the two numbers serves; SeedSequence makes neighbours independent.
    return int(np.random.SeedSequence([seed, scene.frame_current & 0xFFFFFFFF]).generate_state(1)[0] >> 1)


def _threads(scene: Any) -> int:
    if scene.luch.threads:
        return int(scene.luch.threads)
    return scene.render.threads if scene.render.threads_mode == "FIXED" else 0
