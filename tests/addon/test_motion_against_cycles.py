"""Motion blur against Cycles: everything shines by itself, so that a pixel is the time that each thing spends in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.export import motion
from addon.export.hair_motion import tell_hair

SIZE = {"width": 48, "height": 32}
SAMPLES = 256
BLOCK = 4  # pixels that are compared together
FRAME = 4


def glowing(name: str, color: tuple[float, float, float], pattern: bool = False) -> Any:
    """An emission of that colour; pattern: one that follows the object's own coordinates."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    emission.inputs["Color"].default_value = (*color, 1.0)
    links.new(emission.outputs[0], output.inputs["Surface"])
    if pattern:
        places, checker = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeTexChecker")
        checker.inputs["Scale"].default_value = 2.0
        checker.inputs["Color1"].default_value = (*color, 1.0)
        checker.inputs["Color2"].default_value = (0.1, 0.1, 0.1, 1.0)
        links.new(places.outputs["Object"], checker.inputs["Vector"])
        links.new(checker.outputs["Color"], emission.inputs["Color"])
    return material


def add(scene: Any, mesh: Any, color: tuple[float, float, float], pattern: bool = False) -> Any:
    subject = bpy.data.objects.new(mesh.name, mesh)
    mesh.materials.append(glowing(mesh.name, color, pattern))
    scene.collection.objects.link(subject)
    return subject


def bar(scene: Any, half: tuple[float, float, float], color: tuple[float, float, float], pattern: bool = False) -> Any:
    mesh = bpy.data.meshes.new("Bar")
    corners = [(x * half[0], y * half[1], z * half[2]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh.from_pydata(corners, [], faces)
    return add(scene, mesh, color, pattern)


def animate(owner: Any, path: str, before: Any, after: Any) -> None:
    """From `before` a frame before FRAME to `after` a frame after it, evenly."""
    for frame, value in ((FRAME - 1, before), (FRAME + 1, after)):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    data = owner.id_data.animation_data
    for curve in data.action.layers[0].strips[0].channelbag(data.action_slot).fcurves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


@pytest.fixture
def stage(scene: Any) -> Any:
    """A camera that looks down on the plane z = 0, six metres wide; the shutter is open for a frame."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location = (0.0, 0.0, 8.0)
    scene.camera = camera
    scene.frame_set(FRAME)
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 1.0
    return scene


def blocks(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    height, width = SIZE["height"] // BLOCK, SIZE["width"] // BLOCK
    whole = picture[..., :3].astype(np.float64).reshape(height, BLOCK, width, BLOCK, 3)
    mean: NDArray[np.float64] = whole.mean(axis=(1, 3))
    return mean


def check(render: Callable[..., Any], tolerance: float = 0.01, samples: int = SAMPLES) -> None:
    """The same in both, block by block; and not what a still picture is."""
    ours, theirs = (render(engine, samples=samples, **SIZE) for engine in ("LUCH", "CYCLES"))
    assert theirs[..., :3].max() > 0.05
    difference = np.abs(blocks(ours) - blocks(theirs))
    assert difference.max() < tolerance, difference.max()
    bpy.context.scene.render.use_motion_blur = False
    still = render("LUCH", samples=32, **SIZE)
    bpy.context.scene.render.use_motion_blur = True
    assert np.abs(blocks(still) - blocks(ours)).max() > 3.0 * tolerance, "nothing was blurred"


def test_an_object_that_moves_is_blurred_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.7, segments=24, ring_count=12)
    sphere = bpy.context.object
    sphere.data.materials.append(glowing("Ball", (0.9, 0.5, 0.2)))
    animate(sphere, "location", (-1.5, -0.5, 0.0), (1.5, 0.5, 0.5))
    bar(stage, (2.0, 0.2, 0.2), (0.1, 0.2, 0.6)).location = (0.0, -1.2, -1.0)
    check(render)


@pytest.mark.parametrize("steps", [1, 3])
def test_a_wheel_turns_as_in_cycles(stage: Any, render: Callable[..., Any], steps: int) -> None:
    wheel = bar(stage, (1.6, 0.25, 0.25), (0.8, 0.8, 0.3), pattern=True)
    wheel.cycles.motion_steps = steps
    animate(wheel, "rotation_euler", (0.3, 0.0, -1.7), (0.3, 0.0, 1.7))
    check(render)


def test_a_mirrored_and_stretched_object_moves_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    subject = bar(stage, (0.8, 0.4, 0.4), (0.3, 0.8, 0.5), pattern=True)
    subject.rotation_euler = (0.2, 0.4, 0.3)
    animate(subject, "scale", (-0.4, 1.0, 1.0), (-2.0, 1.5, 0.5))
    animate(subject, "location", (0.8, -0.6, 0.0), (-0.6, 0.4, 0.0))
    check(render)


def test_the_camera_moves_turns_and_zooms_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    bar(stage, (0.5, 1.0, 0.3), (0.9, 0.4, 0.2)).location = (-1.0, 0.0, 0.0)
    bar(stage, (0.4, 0.4, 0.4), (0.2, 0.4, 0.9)).location = (1.2, 0.5, 0.5)
    camera = stage.camera
    animate(camera, "location", (-0.5, 0.0, 7.5), (0.5, 0.3, 8.5))
    animate(camera, "rotation_euler", (0.0, 0.05, -0.2), (0.0, -0.05, 0.3))
    animate(camera.data, "lens", 40.0, 60.0)
    check(render)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_mesh_that_changes_its_shape_is_blurred_as_in_cycles(
    stage: Any, render: Callable[..., Any], smooth: bool
) -> None:
    subject = bar(stage, (1.0, 0.5, 0.2), (0.7, 0.7, 0.7))
    nodes, links = subject.data.materials[0].node_tree.nodes, subject.data.materials[0].node_tree.links
    geometry = nodes.new("ShaderNodeNewGeometry")
    links.new(geometry.outputs["Normal"], nodes["Emission"].inputs["Color"])  # so normals are seen
    for face in subject.data.polygons:
        face.use_smooth = smooth
    subject.shape_key_add(name="Rest")
    bent = subject.shape_key_add(name="Bent")
    for index, point in enumerate(bent.data):
        point.co.x += 1.0 if index % 2 else -0.4
        point.co.z += 0.8 * point.co.y
    animate(bent, "value", 0.0, 1.0)
    check(render)


@pytest.mark.parametrize("position", ["START", "END"])
def test_the_shutter_opens_when_it_does_in_cycles(stage: Any, render: Callable[..., Any], position: str) -> None:
    subject = bar(stage, (0.4, 0.6, 0.2), (0.9, 0.6, 0.2))
    animate(subject, "location", (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    animate(stage.camera, "location", (0.0, -0.5, 8.0), (0.0, 0.5, 8.0))
    stage.render.motion_blur_position = position
    stage.render.motion_blur_shutter = 0.6
    check(render)


def test_the_shutters_curve_weighs_times_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    subject = bar(stage, (0.3, 0.6, 0.2), (0.9, 0.6, 0.2))
    animate(subject, "location", (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    mapping = stage.render.motion_blur_shutter_curve
    mapping.curves[0].points[0].location = (0.0, 0.0)
    mapping.curves[0].points.new(0.3, 1.0)
    mapping.curves[0].points[-1].location = (1.0, 0.2)
    mapping.update()
    # Cycles inverts the curve in 256 steps, whose last ends at 98.5 % of the time; ours is exact.
    check(render, samples=4 * SAMPLES)


def test_a_rolling_shutter_sees_line_after_line_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    subject = bar(stage, (0.3, 1.6, 0.2), (0.9, 0.6, 0.2))
    animate(subject, "location", (-2.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    stage.cycles.rolling_shutter_type = "TOP"
    stage.cycles.rolling_shutter_duration = 0.3
    check(render)


def test_instances_of_a_collection_move_with_their_instancer(stage: Any, render: Callable[..., Any]) -> None:
    subject = bar(stage, (0.3, 0.3, 0.2), (0.4, 0.9, 0.5), pattern=True)
    collection = bpy.data.collections.new("Parts")
    collection.objects.link(subject)
    stage.collection.objects.unlink(subject)
    for y in (-0.8, 0.8):
        empty = bpy.data.objects.new("Instancer", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        stage.collection.objects.link(empty)
        animate(empty, "location", (-1.0, y, 0.0), (1.0 + y, y, 0.0))
        animate(empty, "rotation_euler", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    check(render)


def test_what_is_told_to_stand_still_does(stage: Any, render: Callable[..., Any]) -> None:
    fast = bar(stage, (0.3, 0.3, 0.2), (0.4, 0.9, 0.5))
    still = bar(stage, (0.3, 0.3, 0.2), (0.9, 0.2, 0.5))
    animate(fast, "location", (-1.0, 0.8, 0.0), (1.0, 0.8, 0.0))
    animate(still, "location", (-1.0, -0.8, 0.0), (1.0, -0.8, 0.0))
    still.cycles.use_motion_blur = False
    check(render)


def test_light_of_a_mesh_that_moves_is_that_of_cycles(stage: Any, render: Callable[..., Any]) -> None:
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata([(-4, -3, -1), (4, -3, -1), (4, 3, -1), (-4, 3, -1)], [], [(0, 1, 2, 3)])
    floor = bpy.data.objects.new("Floor", mesh)
    stage.collection.objects.link(floor)
    lamp = bar(stage, (0.5, 0.5, 0.05), (9.0, 9.0, 9.0))
    animate(lamp, "location", (-5.0, 1.5, 1.5), (1.0, 3.5, 1.5))  # beside what the camera sees
    screen = bar(stage, (0.5, 0.2, 0.1), (0.0, 0.0, 0.0))
    screen.location = (0.0, 0.0, -0.6)
    animate(screen, "rotation_euler", (0.0, 0.0, 0.0), (0.0, 0.0, 1.5))
    check(render, tolerance=0.015, samples=2 * SAMPLES)


def fur(scene: Any) -> Any:
    """Thick bent strands that show across what they lie."""
    data = bpy.data.hair_curves.new("Fur")
    data.add_curves([4, 3])
    rows = np.array([(-1.2, -0.6, 0, 0.2), (-0.5, 0.1, 0.3, 0.2), (0.3, -0.4, 0.4, 0.15), (1.2, 0.2, 0.1, 0.1),
                     (-0.9, 0.9, 0, 0.1), (0.2, 0.5, 0.5, 0.2), (0.9, 1.0, 0.2, 0.2)], np.float32)  # fmt: skip
    data.attributes["position"].data.foreach_set("vector", rows[:, :3].ravel())
    data.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", np.ascontiguousarray(rows[:, 3]))
    subject = add(scene, data, (1.0, 1.0, 1.0))
    across(data.materials[0])
    return subject


def across(material: Any) -> None:
    """It shines in the colours of Curves Info's Tangent Normal."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    links.new(nodes.new("ShaderNodeHairInfo").outputs["Tangent Normal"], nodes["Emission"].inputs["Color"])


def particle_hair() -> Any:
    """A plane that is not seen, and what grows on it."""
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    emitter = bpy.context.object
    emitter.data.materials.append(glowing("Fur", (1.0, 1.0, 1.0)))
    across(emitter.data.materials[0])
    emitter.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.radius_scale = "HAIR", 12, 1.5, 0.2
    emitter.rotation_euler = (1.2, 0.0, 0.0)
    emitter.show_instancer_for_render = False
    return emitter


def test_hair_curves_move_with_their_object_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    subject = fur(stage)
    stage.cycles_curves.subdivisions = 4  # see test_hair_against_cycles.py
    animate(subject, "location", (-0.8, 0.0, 0.0), (0.8, 0.3, 0.2))
    animate(subject, "rotation_euler", (0.2, 0.0, -0.7), (0.0, 0.3, 0.7))
    check(render)


def test_particle_hair_moves_with_its_emitter_as_in_cycles(
    stage: Any, render: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    emitter, told = particle_hair(), []
    monkeypatch.setattr(motion, "tell_hair", lambda *given: (tell_hair(*given), told.append(given[0])))
    animate(emitter, "location", (-0.8, -0.5, 0.0), (0.8, -0.2, 0.2))
    check(render)
    # Blender tells its paths in the world, where they round elsewhere at each time.
    assert told and all(curves.motion_points is None for curves in told), "its shape is said to change"


def test_hair_curves_that_change_their_shape_are_blurred_as_in_cycles(stage: Any, render: Callable[..., Any]) -> None:
    subject = fur(stage)
    stage.cycles_curves.subdivisions = 4
    group = bpy.data.node_groups.new("Sway", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    inside, outside = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    move, times, place = (
        nodes.new(kind) for kind in ("GeometryNodeSetPosition", "ShaderNodeVectorMath", "GeometryNodeInputPosition")
    )
    times.operation = "MULTIPLY"
    links.new(inside.outputs[0], move.inputs["Geometry"])
    links.new(place.outputs[0], times.inputs[0])
    links.new(times.outputs[0], move.inputs["Offset"])
    links.new(move.outputs[0], outside.inputs[0])
    subject.modifiers.new("Sway", "NODES").node_group = group
    animate(times.inputs[1], "default_value", (-0.6, 0.8, 0.0), (0.3, -0.5, 0.0))
    animate(subject, "location", (0.0, -0.3, 0.0), (0.0, 0.3, 0.0))
    check(render)


def test_particle_hair_follows_an_emitter_that_changes_its_shape_as_in_cycles(
    stage: Any, render: Callable[..., Any]
) -> None:
    emitter = particle_hair()
    emitter.shape_key_add(name="Rest")
    tilted = emitter.shape_key_add(name="Tilted")
    for point in tilted.data:
        point.co.z += 0.9 * point.co.x
    animate(tilted, "value", 0.0, 1.0)
    check(render, samples=4 * SAMPLES)
