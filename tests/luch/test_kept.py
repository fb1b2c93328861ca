"""A renderer that is kept: another view over it is the picture of a fresh one, and builds nothing."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from luch import core
from luch.kept import Kept
from luch.preview import Preview
from luch.render import Progress, render
from luch.scene import Camera, CameraMotion, Medium, Scene, Settings, Shutter, World
from luch.shader import ProgramBuilder
from support.effects import closure, program
from support.everything import everything, quad
from support.frames import resident_mib
from support.media import at, box, even, fog, placed

MIB = 1024.0 * 1024.0


def camera(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, camera=replace(scene.camera, **fields))


def film(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, film=replace(scene.film, **fields))


def settings(**fields: Any) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, settings=replace(scene.settings, **fields))


VIEWS = {
    "another place": camera(matrix=at(-0.7, 0.4, 5.0)),
    "another lens": camera(lens_mm=20.0, use_dof=False, shift_x=0.1, clip_start=3.0, clip_end=4.5),
    "orthographic": camera(kind="ORTHO", ortho_scale=5.0),
    "a panorama": camera(kind="EQUIRECTANGULAR", matrix=at(0.0, 0.0, 1.0)),
    "a fisheye": camera(kind="FISHEYE_EQUIDISTANT", fisheye_fov=2.5),
    "more pixels": film(width=33, height=21, pixel_aspect=(1.0, 1.3)),
    "a border": film(border=(3, 2, 11, 9)),
    "more passes": film(passes=["Combined", "Depth", "Position", "Normal", "Mist", "CryptoObject00"], exposure=2.0),
    "another filter": film(filter="BOX", filter_width=1.0, transparent=True),
    "other samples": settings(samples=7, seed=5, first_sample=3, samples_in_all=16),
    "other limits": settings(max_bounces=1, clamp_indirect=0.5, caustics_reflective=False, estimate_error=False),
}


@pytest.mark.parametrize("change", VIEWS.values(), ids=VIEWS.keys())
def test_another_view_is_the_picture_of_a_fresh_renderer(change: Callable[[Scene], Scene]) -> None:
    kept, first = Kept(), everything()
    before = render(first, kept=kept)
    seen, fresh = render(change(first), kept=kept), render(change(first))
    assert seen.stats["reused"] and not before.stats["reused"] and kept.builds == 1
    assert seen.stats["structure_builds"] == 0 < before.stats["structure_builds"]
    assert seen.stats["structure_seconds"] == seen.stats["lights_seconds"] == 0.0
    assert seen.passes.keys() == fresh.passes.keys()
    for name in fresh.passes:
        np.testing.assert_array_equal(seen.passes[name], fresh.passes[name], err_msg=name)
    for name in ("paths", "rays", "shadow_rays", "lens_samples", "samples", "error"):
        assert seen.stats.get(name) == fresh.stats.get(name), name
    again = render(first, kept=kept)
    np.testing.assert_array_equal(again.passes["Combined"], before.passes["Combined"])


def test_a_camera_that_enters_a_medium_is_in_it() -> None:
    dense = Medium(absorption=(1.0, 2.0, 3.0), scattering=[even((0.5, 0.5, 0.5))], emission=(0.2, 0.1, 0.0))
    scene = placed([box("Cloud", (1.0, 1.0, 1.0)), quad("Floor", 5.0, -2.0)], [fog(dense), *everything().materials[:1]])
    scene.settings.volume_bounces = 2
    kept = Kept()
    for height in (4.0, 0.3, 0.9999, 1.0001, -1.5):
        for kind in ("PERSP", "ORTHO"):
            inside = replace(scene, camera=Camera(matrix=at(0.1, 0.0, height), kind=kind, clip_start=0.01))
            seen, fresh = render(inside, kept=kept), render(inside)
            np.testing.assert_array_equal(
                seen.passes["Combined"], fresh.passes["Combined"], err_msg=str((height, kind))
            )
    assert kept.builds == 1


def test_a_camera_that_moves_while_the_shutter_is_open_is_blurred_anew() -> None:
    scene = everything()
    scene.shutter = Shutter(rolling=0.3)
    kept = Kept()
    render(scene, kept=kept)
    for shift in (0.5, -0.25):
        places = np.stack([scene.camera.matrix, at(0.2 + shift, 0.1, 6.0), at(0.2 + 2 * shift, 0.1, 6.0)])
        moving = replace(scene, camera=replace(scene.camera, motion=CameraMotion(places, (36.0, 40.0))))
        seen, fresh = render(moving, kept=kept), render(moving)
        assert seen.stats["time_samples"] == fresh.stats["time_samples"] > 0
        np.testing.assert_array_equal(seen.passes["Combined"], fresh.passes["Combined"])
    still = render(scene, kept=kept)
    assert still.stats["time_samples"] == 0 and kept.builds == 1


def window(builder: ProgramBuilder) -> None:
    """Bright on the right side of the frame."""
    across = builder.op3("POINT_WINDOW", (), (0, 0))[0]
    closure(builder, "CLOSURE_EMISSION", {}, weight=across)


def test_a_world_that_reads_the_camera_is_sampled_as_the_camera_sees_it() -> None:
    scene, kept = everything(), Kept()
    scene.world = World("Backdrop", program(window), map_resolution=32, sampling="MANUAL")
    render(scene, kept=kept)
    turned = replace(scene, camera=replace(scene.camera, lens_mm=12.0, matrix=at(1.0, 1.0, 5.0)))
    seen, fresh = render(turned, kept=kept), render(turned)
    assert seen.stats["lights_seconds"] > 0.0 == seen.stats["structure_seconds"]
    np.testing.assert_array_equal(seen.passes["Combined"], fresh.passes["Combined"])


def test_what_is_built_of_a_scene_is_built_anew_when_it_changes() -> None:
    scene, kept = everything(), Kept()
    render(scene, kept=kept)
    places = replace(scene.instances, matrix=scene.instances.matrix + 0.1) if scene.instances else None
    changes: list[Callable[[Scene], Scene]] = [
        lambda s: replace(s, meshes=[quad("Floor", 3.0, 0.0), *s.meshes[1:]]),
        lambda s: replace(s, instances=places),
        settings(accelerator="BVH2"),
        settings(without_effects=["depth of field"]),
    ]
    for number, change in enumerate(changes):
        seen, fresh = render(change(scene), kept=kept), render(change(scene))
        assert not seen.stats["reused"] and kept.builds == number + 2 and seen.stats["structure_builds"] == 1
        np.testing.assert_array_equal(seen.passes["Combined"], fresh.passes["Combined"])


def test_materials_lights_and_the_world_change_without_new_structures() -> None:
    scene, kept = everything(), Kept()
    render(scene, kept=kept)
    stone, glass, leaf, glow = scene.materials
    changes: dict[str, Callable[[Scene], Scene]] = {
        "a light": lambda s: replace(s, lights=[replace(s.lights[0], power=5.0), *s.lights[1:]]),
        "a material": lambda s: replace(s, materials=[glow, glass, leaf, glow]),
        "the world": lambda s: replace(s, world=None),
        "a light group": lambda s: replace(s, film=replace(s.film, lightgroups=["A"])),
        "uniform lights": settings(light_tree=False),
        "what lets light through": lambda s: replace(s, materials=[leaf, stone, glass, glow]),
    }
    for name, change in changes.items():
        seen, fresh = render(change(scene), kept=kept), render(change(scene))
        assert seen.stats["structure_builds"] == (name == "what lets light through"), name
        np.testing.assert_array_equal(seen.passes["Combined"], fresh.passes["Combined"], err_msg=name)
        assert seen.stats["effects"] == fresh.stats["effects"]
    assert kept.builds == 1


def test_after_a_cancel_or_an_error_the_next_view_is_whole() -> None:
    scene, kept = everything(), Kept()

    class Enough(Exception):
        pass

    def stop(progress: Progress) -> bool:
        if not progress.preparing:
            raise Enough
        return True

    long = replace(scene, settings=replace(scene.settings, samples=1 << 16))
    for _ in range(3):
        with pytest.raises(Enough):
            render(long, progress=stop, kept=kept)
        with pytest.raises(ValueError, match='pass "Nonsense" is not known'):
            render(film(passes=["Nonsense"])(scene), kept=kept)
        seen = render(scene, kept=kept)
        np.testing.assert_array_equal(seen.passes["Combined"], render(scene).passes["Combined"])
    assert kept.builds == 1 and seen.stats["reused"]


# -- The origin -------------------------------------------------------------------------------------------------------

FAR_M = 1e6


def floor_seen_from_above(height: float, far_m: float = 0.0) -> Scene:
    """everything(), so far from Blender's origin along each axis."""
    scene, place = everything(), np.c_[np.zeros((3, 3)), (far_m, -far_m, far_m)]
    assert scene.instances is not None
    scene.instances.matrix += place
    scene.lights = [replace(light, matrix=light.matrix + place) for light in scene.lights]
    scene.camera = replace(scene.camera, use_dof=False)
    return seen_from(scene, at(0.0, 0.0, height) + place)


def seen_from(scene: Scene, matrix: Any) -> Scene:
    """With the origin there."""
    x, y, z = (float(place) for place in matrix[:, 3])
    return replace(scene, camera=replace(scene.camera, matrix=matrix), origin=(x, y, z))


def moved(scene: Scene, x: float, y: float = 0.0, z: float = 0.0) -> Scene:
    return seen_from(scene, scene.camera.matrix + np.c_[np.zeros((3, 3)), (x, y, z)])


def test_the_origin_stays_while_the_camera_is_near_and_follows_it_beyond() -> None:
    scene, kept = floor_seen_from_above(2.5, FAR_M), Kept()
    render(scene, kept=kept)
    renderer = core.render.Renderer(scene)
    assert renderer.prepare()
    pixel_m, nearest_m = 1.0 / scene.film.width, 0.5  # a metre away: sensor over lens; to the leaves at a height of 2
    assert renderer.origin_reach() == pytest.approx(pixel_m * nearest_m / 64.0 / (10.0 * 2.0**-24), rel=0.2)
    narrow = core.render.Renderer(replace(scene, film=replace(scene.film, width=200_000, height=2)))
    assert narrow.prepare()  # pixels of 2 um: what corners round by themselves, 2.5 m from the leaf's place and 2 m on
    assert narrow.origin_reach() == pytest.approx(0.4 * (2.5 + 2.0), rel=0.2)
    assert render(moved(scene, 0.3, 0.2, 0.1), kept=kept).stats["reused"]
    assert kept.origin == scene.origin
    fine = replace(scene, film=replace(scene.film, width=2000, height=2))  # a hundredth of those 650 m
    fine.settings = replace(fine.settings, samples=1)
    for place in (moved(fine, 0.0, 0.0, 500.0), fine):  # from far above the tolerance is a wide one
        rendered = render(place, kept=kept)
        assert rendered.stats["reused"]
    kept = Kept()
    render(moved(fine, 500.0), kept=kept)
    assert not render(fine, kept=kept).stats["reused"]
    assert kept.builds == 2 and kept.origin == fine.origin


def test_with_an_earlier_origin_what_is_seen_stays_where_it_is() -> None:
    """To a 64th of a pixel, as luch/math/bounds.h has it; and the light differs by less than its noise."""
    scene, kept = floor_seen_from_above(6.0), Kept()
    scene.film = replace(scene.film, width=40, height=30, passes=["Combined", "Position"], filter="BOX")
    scene.settings = replace(scene.settings, samples=64)
    pixel_m, away_m = 3.0 / 40.0, 1500.0  # at the panel, 3 m away: there 2,000 m would do
    render(moved(scene, away_m), kept=kept)
    seen, fresh = render(scene, kept=kept), render(scene)
    assert seen.stats["reused"] and kept.origin == (away_m, 0.0, 6.0)
    apart = np.abs(seen.passes["Position"] - fresh.passes["Position"])
    same_surface = apart[..., 2] < 0.1
    assert same_surface.mean() > 0.98 and 0.0 < apart[same_surface].max() < pixel_m / 64.0
    other = render(replace(scene, settings=replace(scene.settings, seed=9)))
    picture, truth, noisy = (result.passes["Combined"][..., :3] for result in (seen, fresh, other))
    difference, noise = (float(np.sqrt(np.mean((a - truth) ** 2))) for a in (picture, noisy))
    assert difference < 0.5 * noise, (difference, noise)
    assert picture.mean() == pytest.approx(truth.mean(), rel=2e-3)


# -- Memory -----------------------------------------------------------------------------------------------------------


@pytest.mark.promise(8)
def test_two_hundred_moves_of_the_camera_take_no_more_memory() -> None:
    scene, kept, marks = replace(everything(), settings=Settings(samples=1, accelerator="BVH")), Kept(), []
    large = replace(scene.film, width=60, height=45)
    for number in range(200):
        place = at(0.2 + 0.003 * number, 0.1, 6.0)
        size = large if number % 2 else scene.film
        render(replace(scene, camera=replace(scene.camera, matrix=place), film=size), kept=kept)
        if number % 50 == 49:
            gc.collect()
            marks.append(resident_mib())
    assert kept.builds == 1
    # A leak takes its share in every fifty; an allocator that has served other tests takes a step once.
    assert np.median(np.diff(marks)) < 1.0 / 3.0, marks


def test_a_view_that_turns_on_is_seen_before_a_renderer_is_built_for_where_it_is() -> None:
    """Pictures of the finished size come at once here; without a first one from afar each move would build anew."""
    scene, preview = floor_seen_from_above(2.5, FAR_M), Preview()
    scene.film = replace(
        scene.film, width=2000, height=2, passes=["Combined"]
    )  # an origin serves for 6 m here, in a hurry for 100
    scene.settings = replace(scene.settings, samples=1 << 16)
    seen, last = set(), scene
    try:
        preview.submit(moved(scene, 60.0))
        while preview.picture is None or preview.picture.film.width != 2000:
            time.sleep(0.001)
        for number in range(1, 31):
            last = moved(scene, 0.01 * number)
            preview.submit(last)
            time.sleep(0.03)
            seen.add(preview.picture.version)
        assert preview.kept.builds == 1 and len(seen) >= 5, (preview.kept.builds, seen)
        until = time.monotonic() + 10.0
        while preview.kept.origin != last.origin and time.monotonic() < until:
            time.sleep(0.01)
        assert preview.kept.builds == 2 and preview.kept.origin == last.origin
    finally:
        preview.stop(wait=True)
