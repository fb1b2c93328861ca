"""Camera, film, lamps and world arrive in Blender's units."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from luch import integrators, samplers
from luch.scene import Light, Scene

from addon.export import export_scene


def add_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def add_lamp(scene: bpy.types.Scene, kind: str) -> bpy.types.Object:
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", kind))
    scene.collection.objects.link(lamp)
    return lamp


def export() -> Scene:
    return export_scene(bpy.context.evaluated_depsgraph_get())


def export_lamp(scene: bpy.types.Scene) -> Light:
    add_camera(scene)
    (light,) = export().lights
    return light


def test_a_scene_without_camera_says_so(scene: bpy.types.Scene) -> None:
    with pytest.raises(ValueError, match=r'Scene "Scene" has no camera: add one with Add > Camera'):
        export()


def test_an_empty_scene_has_no_rows(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    result = export()
    assert result.instances is not None
    assert result.instances.matrix.shape == (0, 3, 4)
    assert (result.meshes, result.lights, result.world, result.warnings) == ([], [], None, [])


def test_the_camera_keeps_its_place_and_loses_its_scale(scene: bpy.types.Scene) -> None:
    camera = add_camera(scene)
    camera.location = (1e6, 2.0, 3.0)
    camera.scale = (2.0, 3.0, 4.0)
    camera.data.shift_x = 0.25
    result = export()
    np.testing.assert_allclose(result.camera.matrix, np.hstack([np.eye(3), [[1e6], [2.0], [3.0]]]))
    assert result.origin == (1e6, 2.0, 3.0)
    assert result.camera.shift_x == 0.25


def test_focus_on_an_object_is_its_depth_along_the_view(scene: bpy.types.Scene) -> None:
    camera = add_camera(scene)
    target = bpy.data.objects.new("Target", None)
    target.location = (3.0, 0.0, -7.0)
    scene.collection.objects.link(target)
    camera.data.dof.use_dof = True
    camera.data.dof.focus_object = target
    assert export().camera.focus_distance == pytest.approx(7.0)


def test_an_unsupported_camera_is_named(scene: bpy.types.Scene) -> None:
    camera = add_camera(scene)
    camera.data.type = "CUSTOM"
    result = export()
    assert result.camera.kind == "PERSP"
    assert "CUSTOM" in result.warnings[0]
    camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    assert export().camera.kind == "EQUIRECTANGULAR"


def test_the_border_is_whole_pixels_from_the_bottom_left(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 200, 100, 50
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.5, 0.1, 0.5
    film = export().film
    assert (film.width, film.height, film.border) == (100, 50, (25, 5, 50, 25))


def test_lamps_have_their_watts_exposure_and_temperature(scene: bpy.types.Scene) -> None:
    lamp = add_lamp(scene, "POINT").data
    lamp.energy = 50.0
    lamp.exposure = 2.0
    lamp.color = (1.0, 0.5, 0.25)
    lamp.shadow_soft_size = 0.3
    lamp.use_shadow = False
    lamp.cycles.max_bounces = 3
    light = export_lamp(scene)
    assert light.power == 50.0
    assert light.color == pytest.approx((4.0, 2.0, 1.0))
    assert (light.kind, light.cast_shadow, light.max_bounces) == ("POINT", False, 3)
    assert light.radius == pytest.approx(0.3)
    assert light.visibility == 62, "lamps are hidden from the camera unless the user shows them"
    lamp.use_temperature = True
    lamp.temperature = 3000.0
    warm = export().lights[0].color
    assert warm[0] / 4.0 > 1.5 * warm[2] / 1.0


def test_a_spot_has_its_cone_and_a_sun_its_angle(scene: bpy.types.Scene) -> None:
    spot = add_lamp(scene, "SPOT").data
    spot.spot_size, spot.spot_blend = 1.0, 0.5
    sun = add_lamp(scene, "SUN").data
    sun.angle = 0.1
    add_camera(scene)
    lights = {light.kind: light for light in export().lights}
    assert (lights["SPOT"].spot_size, lights["SPOT"].spot_blend) == (1.0, 0.5)
    assert lights["SUN"].angle == pytest.approx(0.1)


@pytest.mark.parametrize(("shape", "height"), [("SQUARE", 2.0), ("DISK", 2.0), ("RECTANGLE", 3.0), ("ELLIPSE", 3.0)])
def test_area_lamps_have_two_sizes_where_their_shape_does(scene: bpy.types.Scene, shape: str, height: float) -> None:
    lamp = add_lamp(scene, "AREA").data
    lamp.shape, lamp.size, lamp.size_y, lamp.spread = shape, 2.0, 3.0, math.pi / 2.0
    light = export_lamp(scene)
    assert (light.shape, light.size, light.size_y) == (shape, 2.0, height)
    assert light.spread == pytest.approx(math.pi / 2.0)


def test_the_shader_that_every_lamp_is_given_is_no_shader(scene: bpy.types.Scene) -> None:
    lamp = add_lamp(scene, "POINT").data
    lamp.use_nodes = True
    assert export_lamp(scene).program is None
    lamp.node_tree.nodes["Emission"].inputs["Strength"].default_value = 2.0
    assert export().lights[0].program is not None


def test_instanced_lamps_shine_from_each_place(scene: bpy.types.Scene) -> None:
    collection = bpy.data.collections.new("Lamps")
    lamp = add_lamp(scene, "POINT")
    scene.collection.objects.unlink(lamp)
    collection.objects.link(lamp)
    for x in (1.0, 2.0):
        empty = bpy.data.objects.new("Instancer", None)
        empty.instance_type = "COLLECTION"
        empty.instance_collection = collection
        empty.location.x = x
        scene.collection.objects.link(empty)
    add_camera(scene)
    lights = export().lights
    assert sorted(light.matrix[0, 3] for light in lights) == [1.0, 2.0]


def test_a_lamp_of_infinite_power_is_left_out_and_named(scene: bpy.types.Scene) -> None:
    add_lamp(scene, "POINT").data.energy = math.inf
    add_camera(scene)
    result = export()
    assert not result.lights
    assert 'Light "Lamp": its power is not finite' in result.warnings[0]


def test_the_world_has_its_visibility_and_sampling(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    world = scene.world = bpy.data.worlds.new("Sky")
    world.cycles_visibility.diffuse = False
    world.cycles.sampling_method = "NONE"
    result = export().world
    assert result is not None
    assert (result.name, result.visibility, result.sampling) == ("Sky", 61, "NONE")
    scene.view_layers[0].use_sky = False
    assert export().world is None


def test_an_animated_seed_differs_between_frames_and_repeats(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    scene.luch.use_animated_seed = True
    seeds = []
    for frame in (1, 2, 1):
        scene.frame_set(frame)
        seeds.append(export().settings.seed)
    assert seeds[0] == seeds[2] != seeds[1]
    scene.luch.use_animated_seed = False
    assert export().settings.seed == 0


def test_the_sampling_pattern_reaches_the_renderer(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    assert export().settings.sampler == "SOBOL"
    for name in samplers.NAMES:
        scene.luch.sampling_pattern = name
        assert export().settings.sampler == name


def test_the_integrator_reaches_the_renderer(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    assert export().settings.integrator == integrators.DEFAULT == "PATH"
    for name in integrators.NAMES:
        scene.luch.integrator = name
        assert export().settings.integrator == name


def test_samples_of_the_view_layer_win(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    scene.luch.samples = 10
    scene.view_layers[0].samples = 4
    assert export().settings.samples == 4


def test_the_dial_and_denoising_reach_the_renderer(scene: bpy.types.Scene) -> None:
    add_camera(scene)
    scene.cycles.use_denoising = True  # as a file that was set up for Cycles
    assert (export().settings.denoise, export().settings.quality) == (True, "CUSTOM")
    assert "Noisy Image" in export().film.passes
    scene.luch.use_denoising, scene.luch.quality, scene.luch.quality_by_report = False, "GOOD", True
    settings = export().settings
    assert (settings.denoise, settings.quality) == (False, "GOOD")
    assert "Noisy Image" not in export().film.passes
    assert settings.quality_report.endswith("report.json")
