"""Blender's callbacks. Each tells its story in a few lines; the work is done elsewhere."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
from luch import record
from luch.scene import Scene

from . import mergeable, passes, viewport
from .report import Reporter, describe_error
from .result import ResultWriter

if TYPE_CHECKING:
    from .export.cache import MeshCache  # loads the core: not while Blender starts

# Statistics of the last render of each scene, by its name: what panels, scripts and tests read.
last_stats: dict[str, dict[str, Any]] = {}

# The same of renders under way, as far as the panel Accuracy shows them.
live_stats: dict[str, dict[str, Any]] = {}

PREVIEW_SAMPLES = 32  # of material and light icons

# Takes the exported scene instead of the renderer, while capture_scene waits for it.
_receiver: Callable[[Scene], None] | None = None


class LuchRenderEngine(bpy.types.RenderEngine):
    """Luch as Blender sees it. Blender makes many of these per render, so nothing is built in `__init__`."""

    bl_idname = "LUCH"
    bl_label = "Luch"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True

    def update_render_passes(self, scene: Any, renderlayer: Any) -> None:
        """Blender asks which passes there will be."""
        passes.register_passes(self, scene, renderlayer)

    def render(self, depsgraph: Any) -> None:
        """One view layer of one frame. Whatever goes wrong ends as a sentence for the user: an exception that got
        through here would count as a finished render, or crash Blender when it saves the file."""
        try:
            for view in self._views(depsgraph):
                self.active_view_set(view)
                self._render(depsgraph)
        except BaseException as error:  # of scripts in drivers and handlers too: SystemExit would end Blender
            traceback.print_exc()
            self.report({"ERROR"}, describe_error(error))

    def _views(self, depsgraph: Any) -> list[str]:
        """Names of the eyes to render; one without a name where the scene is not stereoscopic."""
        if not depsgraph.scene.render.use_multiview or self.is_preview or _receiver is not None:
            return [self.active_view_get()]
        asked = self.begin_result(0, 0, 1, 1, layer=depsgraph.view_layer.name)
        names = [view.name for view in asked.views]
        self.end_result(asked, cancel=True)
        return names

    def _render(self, depsgraph: Any) -> None:
        from luch import render

        from . import export

        reporter = Reporter(self, depsgraph.scene)
        reporter.say("Exporting scene")
        scene = export.export_scene(depsgraph, self, cache=self._mesh_cache(depsgraph))
        if self.is_preview:
            scene.settings.samples = min(scene.settings.samples, PREVIEW_SAMPLES)
        reporter.warn(scene.warnings)
        if _receiver is not None:
            _receiver(scene)
            return
        with ResultWriter(self, depsgraph.view_layer.name, scene.film) as writer:
            result = render.render(scene, progress=lambda progress: _goes_on(progress, reporter, writer))
            writer.write(result.passes)
        reporter.show(result.stats["warnings"][len(scene.warnings) :])
        stats = reporter.statistics(scene, result.stats)
        last_stats[depsgraph.scene.name] = stats
        live_stats.pop(depsgraph.scene.name, None)
        mergeable.keep(depsgraph.scene, depsgraph.view_layer.name, scene, result)
        reporter.say_how_it_went(stats)
        writer.stamp(stats, scene)

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """Something of the file changed, or a 3D view shows Luch for the first time. Tells errors in the view."""
        if view := viewport.of_engine(self):
            view.update(context, depsgraph, self.get_preview_pixel_size(depsgraph.scene))
            viewport.watch(self)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """Draw what there is by now."""
        if view := viewport.of_engine(self):
            view.draw(context, depsgraph, self)
            viewport.watch(self)

    def _mesh_cache(self, depsgraph: Any) -> MeshCache:
        """The view layer's meshes of the frame before, if the user wants them kept; Blender then keeps this engine."""
        from .export.cache import MeshCache

        if not depsgraph.scene.render.use_persistent_data:
            return MeshCache()
        if not hasattr(self, "_caches"):
            self._caches: dict[str, MeshCache] = {}
        return self._caches.setdefault(depsgraph.view_layer.name, MeshCache())


def _goes_on(progress: Any, reporter: Reporter, writer: ResultWriter) -> bool:
    """Tells the user; False: the render is to end."""
    if progress.curve is not None and progress.curve.points and progress.new_picture:
        live_stats[reporter.scene_name] = {
            **progress.curve.statistics(),
            "samples": progress.samples,
            "render_seconds": progress.seconds,
            "error_asked": progress.asked_error,
        }
    return reporter.progress(progress, writer)


def capture_scene(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> Scene:
    """A view layer as a render of the current frame would see it: with what is shown in renders, at render quality.

    Only a render evaluates a file so; it is started, and ends after the export. Raises RuntimeError, with the reason,
    if the export fails.
    """
    global _receiver
    captured: list[Scene] = []
    render = scene.render
    before = render.engine, render.use_compositing, render.use_sequencer
    _receiver = captured.append
    try:
        setattr(render, "engine", LuchRenderEngine.bl_idname)
        render.use_compositing = render.use_sequencer = False
        bpy.ops.render.render(scene=scene.name, layer=view_layer.name)
    finally:
        _receiver = None
        setattr(render, "engine", before[0])
        render.use_compositing, render.use_sequencer = before[1:]
    if not captured:
        raise RuntimeError(f'View layer "{view_layer.name}" was not rendered: enable it for rendering.')
    return captured[0]


def write_record(scene: bpy.types.Scene, *_: Any) -> None:
    """Beside every frame that a headless render has written: NAME.json, with all that is known; and what merges, where
    that is asked for. For farms."""
    stats = last_stats.get(scene.name)
    if not bpy.app.background or stats is None or scene.render.engine != LuchRenderEngine.bl_idname:
        return
    frame = Path(bpy.path.abspath(scene.render.frame_path(frame=scene.frame_current)))
    try:
        record.write_json(frame.with_suffix(".json"), stats)
        mergeable.write(scene, frame)
    except (OSError, ValueError, ImportError, RuntimeError) as error:
        print(f"Luch: a file beside {frame} cannot be written ({error}). The frame is there.", file=sys.stderr)


def register() -> None:
    bpy.utils.register_class(LuchRenderEngine)
    bpy.app.handlers.render_write.append(bpy.app.handlers.persistent(write_record))  # other files' renders, too


def unregister() -> None:
    viewport.stop_all()
    bpy.app.handlers.render_write.remove(write_record)
    bpy.utils.unregister_class(LuchRenderEngine)
