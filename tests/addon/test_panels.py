"""Panels draw only properties that exist, and Blender's own panels accept the engine."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from addon.ui import panels


class Layout:
    """Stands in for a UILayout: checks what is drawn, keeps the text."""

    def __init__(self) -> None:
        self.drawn: list[str] = []

    def prop(self, owner: Any, name: str, **options: object) -> None:
        assert name in owner.bl_rna.properties, f"{owner.bl_rna.identifier} has no property {name}"
        self.drawn.append(name)

    def label(self, text: str) -> None:
        self.drawn.append(text)

    def operator(self, identifier: str, **options: object) -> None:
        module, name = identifier.split(".")
        assert getattr(getattr(bpy.ops, module), name).get_rna_type() is not None

    def row(self, **options: object) -> Layout:
        return self

    column = row


def draw(panel: Any, scene: bpy.types.Scene) -> list[str]:
    layout = Layout()
    context = SimpleNamespace(scene=scene, view_layer=scene.view_layers[0], engine="LUCH")
    assert panel.poll(context)
    panel.draw(SimpleNamespace(layout=layout, _draw_cryptomatte=getattr(panel, "_draw_cryptomatte", None)), context)
    return layout.drawn


@pytest.mark.parametrize("panel", panels.CLASSES, ids=lambda panel: panel.__name__)
def test_a_panel_draws_existing_properties(scene: bpy.types.Scene, panel: Any) -> None:
    scene.render.film_transparent = True
    assert draw(panel, scene)


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
