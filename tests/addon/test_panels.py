"""Panels draw only properties that exist, and Blender's own panels accept the engine."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from addon import engine
from addon.ui import accuracy, datablocks, effects, hair, panels, plot, stock


class Layout:
    """Stands in for a UILayout: checks what is drawn, keeps the text."""

    def __init__(self) -> None:
        self.drawn: list[str] = []
        self.dimmed: list[str] = []
        self.active = True

    def prop(self, owner: Any, name: str, **options: object) -> None:
        assert name in owner.bl_rna.properties, f"{owner.bl_rna.identifier} has no property {name}"
        self.drawn.append(name)
        self.dimmed += [] if self.active else [name]

    def label(self, text: str, icon: str = "NONE") -> None:
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        self.drawn.append(text)

    def operator(self, identifier: str, **options: object) -> SimpleNamespace:
        module, name = identifier.split(".")
        assert getattr(getattr(bpy.ops, module), name).get_rna_type() is not None
        return SimpleNamespace()

    def row(self, **options: object) -> Layout:
        return self

    column = row

    def template_icon(self, icon_value: int, scale: float) -> None:
        assert icon_value >= 0 and scale > 1.0  # 0: no window, no icons
        self.drawn.append("icon")

    def template_node_view(self, tree: Any, node: Any, socket: Any) -> None:
        assert socket is not None
        self.drawn.append(node.name)


def draw(panel: Any, scene: bpy.types.Scene, **context: object) -> list[str]:
    layout = Layout()
    space = SimpleNamespace(scene=scene, view_layer=scene.view_layers[0], engine="LUCH", **context)
    assert panel.poll(space)
    panel.draw(SimpleNamespace(layout=layout, draw_shape=getattr(panel, "draw_shape", None)), space)
    return layout.drawn


@pytest.mark.parametrize(
    ("integrator", "dimmed"), [("PATH", []), ("DISTRIBUTION", ["diffuse_bounces", "volume_bounces"])]
)
def test_limits_that_the_integrator_does_not_reach_are_dimmed(
    scene: bpy.types.Scene, integrator: str, dimmed: list[str]
) -> None:
    scene.luch.integrator = integrator
    layout = Layout()
    panels.LUCH_RENDER_PT_light_paths.draw(SimpleNamespace(layout=layout), SimpleNamespace(scene=scene))
    assert layout.dimmed == dimmed and "glossy_bounces" in layout.drawn


@pytest.mark.parametrize("panel", panels.CLASSES, ids=lambda panel: panel.__name__)
def test_a_panel_draws_existing_properties(scene: bpy.types.Scene, panel: Any) -> None:
    scene.render.film_transparent = True
    assert draw(panel, scene)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN", "AREA"])
def test_lamps_show_their_power_and_shape(scene: bpy.types.Scene, kind: str) -> None:
    lamp = bpy.data.lights.new("Lamp", kind)
    drawn = draw(datablocks.LUCH_LIGHT_PT_light, scene, light=lamp)
    shape = {"POINT": "shadow_soft_size", "SPOT": "spot_size", "SUN": "angle", "AREA": "spread"}[kind]
    assert {"energy", "exposure", "use_shadow", shape} <= set(drawn)


def test_nodes_worlds_objects_and_materials_show_what_is_read_of_them(scene: bpy.types.Scene) -> None:
    world, material = bpy.data.worlds.new("Sky"), bpy.data.materials.new("Stone")
    thing = bpy.data.objects.new("Thing", bpy.data.meshes.new("Thing"))
    assert "Light Output" in draw(datablocks.LUCH_LIGHT_PT_nodes, scene, light=bpy.data.lights.new("Lamp", "POINT"))
    assert "sampling_method" in draw(datablocks.LUCH_WORLD_PT_settings, scene, world=world)
    assert "visible_shadow" in draw(datablocks.LUCH_OBJECT_PT_ray_visibility, scene, object=thing)
    assert "pass_index" in draw(datablocks.LUCH_MATERIAL_PT_settings, scene, material=material)


def test_hair_shows_its_shape_and_subdivisions_of_ribbons_alone(scene: bpy.types.Scene) -> None:
    assert draw(hair.LUCH_RENDER_PT_hair, scene) == ["shape", "subdivisions"]
    scene.cycles_curves.shape = "THICK"
    assert draw(hair.LUCH_RENDER_PT_hair, scene) == ["shape"]
    without = SimpleNamespace(scene=SimpleNamespace(), engine="LUCH")
    assert not hair.LUCH_RENDER_PT_hair.poll(without)


@pytest.mark.parametrize("name", sorted(stock.INCLUDED))
def test_a_panel_that_is_asked_for_by_name_exists(name: str) -> None:
    assert "LUCH" in getattr(bpy.types, name).COMPAT_ENGINES


def test_every_shared_setting_has_its_place_in_a_panel(scene: bpy.types.Scene) -> None:
    from addon.settings import SHARED_WITH_CYCLES

    scene.render.film_transparent = True
    drawn = {name for panel in panels.CLASSES for name in draw(panel, scene)}
    assert drawn >= SHARED_WITH_CYCLES


def test_a_value_that_comes_from_cycles_stands_beside_the_setting(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 77
    assert "Cycles: 77" in draw(panels.LUCH_RENDER_PT_sampling, scene)
    scene.luch.samples = 5
    assert "Cycles: 77" not in draw(panels.LUCH_RENDER_PT_sampling, scene)


def test_effects_of_the_last_render_are_listed_with_their_reasons(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = {"region": SimpleNamespace(width=400), "preferences": bpy.context.preferences}
    monkeypatch.setattr(engine, "last_stats", {})
    assert draw(effects.LUCH_RENDER_PT_effects, scene, **context) == ["Known after the first render", "force_effects"]
    off = SimpleNamespace(scene=scene, engine="LUCH")
    assert not effects.LUCH_RENDER_PT_effects_off.poll(off)
    rows = {
        "coat": {"on": True, "reason": "a coat " * 20, "group": "Surfaces", "cost": "a lobe"},
        "volumes": {"on": False, "reason": "left out", "group": "Geometry", "missing": True},
        "sheen": {"on": False, "reason": "every sheen weight is 0", "group": "Surfaces"},
        "bump": {"on": False, "left_out": True, "reason": "material", "group": "Surfaces"},
    }
    monkeypatch.setattr(engine, "last_stats", {scene.name: {"effects": rows}})
    shown = draw(effects.LUCH_RENDER_PT_effects, scene, **context)
    assert [text for text in shown if not text.startswith(" ")] == [
        "Surfaces", "coat", "Geometry", "volumes", "Surfaces", "bump", "force_effects"
    ]  # fmt: skip
    assert "(a lobe)" in "".join(shown) and max(map(len, shown)) <= 400 / 8 + 4
    hidden = draw(effects.LUCH_RENDER_PT_effects_off, scene, **context)
    assert hidden == ["Surfaces", "sheen", "    every sheen weight is 0"]


def test_the_error_is_shown_with_its_curve(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "last_stats", {})
    assert draw(accuracy.LUCH_RENDER_PT_accuracy, scene) == ["Known after a few samples"]
    stats = {
        "error": 0.018, "error_low": 0.017, "error_high": 0.019, "fireflies_share": 0.12, "brightness": 0.5,
        "brightness_low": 0.499, "brightness_high": 0.501, "next_error": 0.01, "seconds_to_next_error": 41.0,
        "seconds_to_next_error_low": 34.0, "seconds_to_next_error_high": 52.0, "samples": 64, "render_seconds": 12.0,
        "stopped_by": "time", "error_curve": [[16, 3.0, 0.036, 0.03, 0.04], [64, 12.0, 0.018, 0.017, 0.019]],
    }  # fmt: skip
    monkeypatch.setattr(engine, "last_stats", {scene.name: stats})
    shown = draw(accuracy.LUCH_RENDER_PT_accuracy, scene)
    assert shown[0] == "Error 1.8 % (95 %: 1.7 to 1.9 %)" and shown[-1] == "icon"
    assert "1 % takes 41 s more (80 %: 34 to 52 s)" in shown and "64 samples, 12.0 s: time limit reached" in shown


def test_a_curve_is_drawn_where_its_points_are() -> None:
    points = [(1.0, 0.08, 0.07, 0.09), (4.0, 0.04, 0.035, 0.045), (16.0, 0.02, 0.019, 0.021)]
    picture = plot.draw_curve(points, 0.01, 64.0)
    x, y = plot.axes(points, 0.01, 64.0)
    assert picture.shape == (plot.HEIGHT, plot.WIDTH, 4)
    for seconds, error, _, _ in points:
        assert picture[round(y.at(error)), round(x.at(seconds)), :3] == pytest.approx(plot.DOT)
    assert picture[round(y.at(0.01)), round(x.at(64.0)), :3] == pytest.approx(plot.AIM)
    assert x.at(1.0) < x.at(4.0) < x.at(64.0) and y.at(0.02) < y.at(0.08), "less error lies lower"
    for odd in ([], [(0.0, 0.0, 0.0, 0.0)], points[:1]):
        assert np.isfinite(plot.draw_curve(odd)).all()


def test_settings_follow_cycles_again_at_a_press(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 77
    scene.luch.samples = 5
    bpy.ops.luch.follow_cycles()
    assert not scene.luch.is_property_set("samples")


def test_blenders_panels_accept_the_engine_while_it_is_registered() -> None:
    import addon

    assert "LUCH" in bpy.types.RENDER_PT_output.COMPAT_ENGINES
    addon.unregister()
    try:
        assert "LUCH" not in bpy.types.RENDER_PT_output.COMPAT_ENGINES
    finally:
        addon.register()
