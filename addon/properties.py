"""Luch's settings in a .blend file: `scene.luch` and `view_layer.luch`. Names shared with Cycles mean the same."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty
from luch.integrators import DEFAULT as DEFAULT_INTEGRATOR
from luch.integrators import INTEGRATORS


def _bounces(name: str, default: int, what: str) -> bpy.props._PropertyDeferred:
    return IntProperty(name=name, default=default, min=0, max=1024, description=what)


class LuchSceneSettings(bpy.types.PropertyGroup):
    """Render settings of a scene."""

    follow_cycles: BoolProperty(
        name="Follow Cycles",
        default=True,
        description="A setting that was changed for Cycles and never here keeps Cycles' value",
    )
    device: EnumProperty(
        name="Device",
        items=[
            ("CPU", "CPU", "Render on the processor"),
            (
                "CUDA",
                "CUDA",
                "Render on an NVIDIA GPU (Turing or newer); without one the processor goes on and says so",
            ),
        ],
        default="CPU",
        description="What computes",
    )
    texture_memory: FloatProperty(
        name="Texture Memory",
        default=0.0,
        min=0.0,
        description="Megabytes of images on each GPU, 0 for what fits; the rest is read from the host's memory, slower",
    )
    gpus: IntProperty(
        name="GPUs", default=0, min=0, max=64, description="How many GPUs share the samples; 0 for all that there are"
    )
    own_kernels: BoolProperty(
        name="Kernels for the Scene",
        default=True,
        description="Compile kernels that hold only what the scene calls for, while general ones begin it; off: the general "
        "ones alone, which draw the same picture more slowly",
    )
    accelerator: EnumProperty(
        name="Structure",
        items=[
            (
                "AUTO",
                "Automatic",
                "The fastest in trials on this scene; what would take long to build beside the render is not tried",
            ),
            ("BVH", "BVH", "Bounding volume hierarchy, eight boxes a node: the fastest on nearly every scene"),
            ("BVH2", "Binary BVH", "Bounding volume hierarchy, two boxes a node"),
            ("BVH2_STACKLESS", "Stackless BVH", "Binary tree walked by skip pointers, always left to right"),
            ("KD_TREE", "kd-Tree", "Space cut by planes: good where long thin triangles overlap"),
            ("HIERARCHICAL_GRID", "Hierarchical Grid", "Cells, where dense divided again"),
            ("GRID", "Uniform Grid", "Equal cells: good for evenly spread small triangles"),
            ("BRUTE_FORCE", "Brute Force", "Every ray tests every triangle: the oracle, for tiny scenes"),
        ],
        default="AUTO",
        description="Acceleration structure that rays travel through",
    )
    precision: EnumProperty(
        name="Precision",
        items=[
            ("FAST", "Fast", "Single precision: a ray along an edge may slip between two triangles"),
            ("WATERTIGHT", "Watertight", "No ray slips between two triangles that share an edge"),
            ("DOUBLE", "Double", "Intersections in double precision"),
        ],
        default="WATERTIGHT",
        description="How exactly rays and triangles are compared",
    )
    estimate_error: BoolProperty(
        name="Estimate Error",
        default=True,
        description="The render knows its error with an interval: 64 bytes a pixel, and no other picture",
    )
    without_effects: StringProperty(
        name="Effects Left Out", default="", description="Names from the list of effects, with semicolons between them"
    )
    force_effects: BoolProperty(
        name="Simulate Absent Effects",
        default=False,
        description="Do the work of effects that the scene lacks: the picture stays the same, the time shows their cost",
    )
    threads: IntProperty(name="Threads", default=0, min=0, max=1024, description="Threads to use; 0 for all")
    samples: IntProperty(name="Max Samples", default=128, min=1, max=1 << 24, description="Paths through every pixel")
    time_limit: FloatProperty(
        name="Time Limit",
        default=0.0,
        min=0.0,
        unit="TIME_ABSOLUTE",
        description="Stop after this many seconds; 0 for no limit",
    )
    error_limit_percent: FloatProperty(
        name="Error Limit",
        default=0.0,
        min=0.0,
        soft_max=20.0,
        max=100.0,
        precision=2,
        subtype="PERCENTAGE",
        description="Stop when the picture's error is that small (relative, root mean square over all pixels); 0 for no limit. "
        "Max Samples still holds",
    )
    preview_samples: IntProperty(
        name="Viewport Samples", default=1024, min=0, max=1 << 24,
        description="Paths through every pixel of a viewport; 0 for no limit",
    )  # fmt: skip
    preview_time_limit: FloatProperty(
        name="Viewport Time Limit", default=0.0, min=0.0, unit="TIME_ABSOLUTE",
        description="A viewport's picture stops after this many seconds; 0 for no limit",
    )  # fmt: skip
    preview_error_limit_percent: FloatProperty(
        name="Viewport Error Limit", default=0.0, min=0.0, soft_max=20.0, max=100.0, precision=2, subtype="PERCENTAGE",
        description="A viewport's picture stops when its error is that small; 0 for no limit. Viewport Samples still holds",
    )  # fmt: skip
    quality: EnumProperty(
        name="Quality",
        items=[
            ("CUSTOM", "Custom", "The settings below hold"),
            ("DRAFT", "Draft", "An error of 20 %, as soon as this scene gets there"),
            ("PREVIEW", "Preview", "An error of 10 %, as soon as this scene gets there"),
            ("GOOD", "Good", "An error of 5 %, as soon as this scene gets there"),
            ("HIGH", "High", "An error of 2 %, as soon as this scene gets there"),
            ("REFERENCE", "Reference", "An error of 0.5 %, with nothing taken from the light"),
        ],
        default="CUSTOM",
        description="How much error the picture may have. Where this scene takes long, a tenth of the time goes to "
        "finding the settings that reach it soonest; Time Limit still holds",
    )
    quality_by_report: BoolProperty(
        name="By the Last Report",
        default=False,
        description="Choose by this scene's last report instead of a pilot",
    )
    use_denoising: BoolProperty(
        name="Denoise",
        default=False,
        description="Combined goes through Open Image Denoise, guided by albedo and normal: less noise, biased; the "
        "error that is told is that of the picture before",
    )
    use_adaptive_sampling: BoolProperty(
        name="Adaptive Sampling",
        default=False,
        description="On the way to the Error Limit, more samples where the error is. What a pixel found never decides about "
        "its own samples, so no light is lost",
    )
    verify: BoolProperty(
        name="Verify the Error",
        default=False,
        description="Render in two halves with other noise, and hold the claimed error against their difference",
    )
    report_seconds: FloatProperty(
        name="Report Time", default=60.0, min=1.0, soft_max=3600.0, unit="TIME_ABSOLUTE",
        description="How long a report on what accuracy costs may take",
    )  # fmt: skip
    report_folder: StringProperty(
        name="Report Folder", default="//luch_report", subtype="DIR_PATH",
        description="Where reports go, each into a folder of its own; without a saved file, Blender's temporary folder",
    )  # fmt: skip
    seed: IntProperty(name="Seed", default=0, min=0, description="Chooses the noise; the picture stays the same")
    use_animated_seed: BoolProperty(
        name="Use Animated Seed", default=False, description="Another noise in every frame of an animation"
    )
    sampling_pattern: EnumProperty(
        name="Sampling Pattern",
        items=[
            ("SOBOL", "Sobol-Burley", "Owen-scrambled Sobol points: evenly spread in every two dimensions"),
            ("INDEPENDENT", "Independent", "Numbers that know nothing of each other: more noise, the plain yardstick"),
            ("LATTICE", "Lattice", "Points of regular lattices, shifted at random in every dimension"),
        ],
        default="SOBOL",
        description="How random numbers are spread: more or less noise, the same picture in the end",
    )
    integrator: EnumProperty(
        name="Integrator",
        items=[(name, kind.title, f"{kind.reason[0].upper()}{kind.reason[1:]}") for name, kind in INTEGRATORS.items()],
        default=DEFAULT_INTEGRATOR,
        description="How light is followed",
    )
    max_bounces: _bounces("Max Bounces", 12, "Bounces of any kind on a path")
    diffuse_bounces: _bounces("Diffuse Bounces", 4, "Bounces off diffuse surfaces on a path")
    glossy_bounces: _bounces("Glossy Bounces", 4, "Bounces off glossy surfaces on a path")
    transmission_bounces: _bounces("Transmission Bounces", 12, "Passages through glass on a path")
    volume_bounces: _bounces("Volume Bounces", 0, "Scatterings inside volumes on a path, after the first")
    transparent_max_bounces: _bounces("Transparent Max Bounces", 8, "Transparent surfaces a ray passes straight")
    min_light_bounces: _bounces("Min Light Bounces", 0, "Bounces before a path may be ended by chance")
    min_transparent_bounces: _bounces(
        "Min Transparent Bounces", 0, "Transparent surfaces before a ray may be ended by chance"
    )
    sample_clamp_direct: FloatProperty(
        name="Clamp Direct", default=0.0, min=0.0, description="Cut brighter direct samples: biased; 0 for never"
    )
    sample_clamp_indirect: FloatProperty(
        name="Clamp Indirect", default=0.0, min=0.0, description="Cut brighter indirect samples: biased; 0 for never"
    )
    blur_glossy: FloatProperty(
        name="Filter Glossy",
        default=0.0,
        min=0.0,
        max=10.0,
        description="Roughen glossy surfaces after blurry bounces: less noise, biased; 0 for never",
    )
    caustics_reflective: BoolProperty(
        name="Reflective Caustics", default=True, description="Light reflected by glossy onto diffuse surfaces"
    )
    caustics_refractive: BoolProperty(
        name="Refractive Caustics", default=True, description="Light refracted by glass onto diffuse surfaces"
    )
    use_light_tree: BoolProperty(
        name="Light Tree", default=True, description="Choose lights by what they contribute at a point"
    )
    light_sampling_threshold: FloatProperty(
        name="Light Threshold",
        default=0.0,
        min=0.0,
        max=1.0,
        description="End light samples weaker than this by chance, when the light tree is off; 0 for never",
    )
    pixel_filter_type: EnumProperty(
        name="Pixel Filter",
        items=[
            ("BOX", "Box", "Box"),
            ("GAUSSIAN", "Gaussian", "Gaussian"),
            ("BLACKMAN_HARRIS", "Blackman-Harris", "Blackman-Harris"),
        ],
        default="BLACKMAN_HARRIS",
        description="How the light around a pixel's centre is averaged",
    )
    filter_width: FloatProperty(
        name="Filter Width", default=1.5, min=0.01, max=10.0, subtype="PIXEL", description="Width of the pixel filter"
    )
    film_exposure: FloatProperty(
        name="Exposure", default=1.0, min=0.0, max=10.0, description="Multiplies the picture's brightness"
    )
    film_transparent_glass: BoolProperty(
        name="Transparent Glass", default=False, description="Glass seen by a transparent film is transparent"
    )
    film_transparent_roughness: FloatProperty(
        name="Roughness Threshold",
        default=0.1,
        min=0.0,
        max=1.0,
        description="Glass rougher than this stays opaque on a transparent film",
    )


class LuchViewLayerSettings(bpy.types.PropertyGroup):
    """Passes that Blender has no switch for."""

    use_pass_denoising: BoolProperty(
        name="Denoising Data",
        default=False,
        description="Denoising Albedo and Denoising Normal, for the compositor's Denoise node",
    )
    use_pass_error: BoolProperty(
        name="Error", default=False, description="Standard error of Combined, pixel by pixel, in the same unit"
    )
    use_pass_reliability: BoolProperty(
        name="Reliability",
        default=False,
        description="How far the Error pass may be believed: below one half, light was found so near by that the pixel may "
        "have missed it",
    )
    use_pass_sample_count: BoolProperty(
        name="Sample Count", default=False, description="How many paths went through each pixel"
    )
    use_pass_render_time: BoolProperty(
        name="Render Time", default=False, description="Milliseconds that a processor or the GPU spent on each pixel"
    )


CLASSES = (LuchSceneSettings, LuchViewLayerSettings)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    types: Any = bpy.types
    types.Scene.luch = PointerProperty(type=LuchSceneSettings)
    types.ViewLayer.luch = PointerProperty(type=LuchViewLayerSettings)


def unregister() -> None:
    types: Any = bpy.types
    del types.ViewLayer.luch
    del types.Scene.luch
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
