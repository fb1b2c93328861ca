"""Whose value a setting has: Luch's, Cycles', or the default."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from luch.accel import KINDS, PRECISIONS

from addon import engine, passes
from addon.settings import SHARED_WITH_CYCLES, effective, follows_cycles


def test_luch_is_offered_as_an_engine(scene: bpy.types.Scene) -> None:
    scene.render.engine = "LUCH"
    assert scene.render.engine == "LUCH"


@pytest.mark.parametrize("name", sorted(SHARED_WITH_CYCLES))
def test_a_shared_setting_exists_under_the_same_name_in_both_engines(scene: bpy.types.Scene, name: str) -> None:
    assert type(getattr(scene.luch, name)) is type(getattr(scene.cycles, name))


def test_what_was_set_for_cycles_holds_until_it_is_set_for_luch(scene: bpy.types.Scene) -> None:
    scene.cycles.max_bounces = 3
    assert (effective(scene, "max_bounces"), follows_cycles(scene, "max_bounces")) == (3, True)
    scene.luch.max_bounces = 12
    assert (effective(scene, "max_bounces"), follows_cycles(scene, "max_bounces")) == (12, False)
    scene.luch.property_unset("max_bounces")
    assert effective(scene, "max_bounces") == 3


def test_cycles_defaults_that_take_light_away_are_not_followed(scene: bpy.types.Scene) -> None:
    assert scene.cycles.sample_clamp_indirect == 10.0
    assert effective(scene, "sample_clamp_indirect") == 0.0
    assert scene.cycles.blur_glossy == 1.0
    assert effective(scene, "blur_glossy") == 0.0


def test_following_cycles_can_be_switched_off(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 7
    scene.luch.follow_cycles = False
    assert effective(scene, "samples") == 128


def test_passes_follow_the_view_layer(scene: bpy.types.Scene) -> None:
    layer = scene.view_layers[0]
    layer.use_pass_z = True
    layer.use_pass_cryptomatte_object = True
    layer.pass_cryptomatte_depth = 4
    aov = layer.aovs.add()
    aov.name = "Mask"
    aov.type = "VALUE"
    layer.lightgroups.add().name = "Key"
    names = [entry.name for entry in passes.enabled_passes(layer, scene)]
    assert names == ["Combined", "Depth", "CryptoObject00", "CryptoObject01", "Mask", "Combined_Key"]


def test_a_pass_asked_of_cycles_is_delivered_by_luch(scene: bpy.types.Scene) -> None:
    layer = scene.view_layers[0]
    layer.cycles.denoising_store_passes = True
    names = {entry.name for entry in passes.enabled_passes(layer, scene)}
    assert {"Denoising Albedo", "Denoising Normal"} <= names


def test_every_structure_and_precision_that_blender_offers_renders(scene: bpy.types.Scene) -> None:
    items: Any = scene.luch.bl_rna.properties
    offered = {item.identifier for item in items["accelerator"].enum_items}
    assert offered == {"AUTO", *KINDS} - {"CWBVH"}, "the compressed tree is for CUDA"
    assert {item.identifier for item in items["precision"].enum_items} == set(PRECISIONS)
    scene.render.resolution_x = scene.render.resolution_y = 8
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "LUCH"
    settings: Any = scene.luch
    settings.samples = 1
    for name in sorted(offered):
        settings.accelerator = name
        bpy.ops.render.render(scene=scene.name)
        assert engine.last_stats[scene.name]["accelerator"] == ("BVH" if name == "AUTO" else name)
