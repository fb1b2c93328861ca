"""The whole scene, as the story of one export."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from luch.scene import Film, Scene, Shutter

from .cache import MeshCache
from .camera import camera_matrix, export_camera
from .context import ExportContext
from .film import export_film, export_view_film
from .instances import export_instances
from .motion import MotionRecorder, export_shutter
from .settings import export_settings, export_view_settings
from .view import View, read_view
from .world import export_world


def export_scene(
    depsgraph: Any,
    engine: Any = None,
    *,
    cache: MeshCache | None = None,
) -> Scene:
    """What Blender evaluated, as plain arrays that share nothing with Blender.

    engine: the render engine, for its camera and resolution; None: the scene's own. cache: meshes of the frame before.
    Raises ValueError, with a sentence for the user, if there is nothing to see through (no camera).
    """
    result = Scene(name=depsgraph.scene.name, frame=depsgraph.scene.frame_current)
    context = ExportContext(depsgraph, result)
    cache = cache or MeshCache()
    cache.begin(depsgraph)
    _warn_about_what_is_missing(context)
    result.camera = export_camera(_camera(context, engine), context, engine)
    result.film = export_film(context, (engine.resolution_x, engine.resolution_y) if engine else None)
    result.settings = export_settings(context)
    result.world = export_world(context)
    shutter = export_shutter(context, engine)
    if shutter is None:
        export_instances(context, cache)
    else:
        _export_motion(context, cache, engine, shutter)
    result.origin = _origin(result)
    return result


def export_view_scene(depsgraph: Any, region: Any, space: Any, cache: MeshCache) -> tuple[Scene, View]:
    """The same as a region of a 3D viewport shows it, at an instant; and the view. Raises ValueError as export_scene."""
    result = Scene(name=depsgraph.scene.name, frame=depsgraph.scene.frame_current)
    context = ExportContext(depsgraph, result, cache.images, for_view=True)
    cache.begin(depsgraph)
    _warn_about_what_is_missing(context)
    _warn_about_what_views_miss(context, space)
    view = read_view(region, space, context)
    result.settings = export_view_settings(context)
    result.world = export_world(context)
    export_instances(context, cache, shown=lambda item: _is_shown(item, space))
    _look_through(result, view, export_view_film(context, view))
    return result, view


def seen_anew(scene: Scene, depsgraph: Any, region: Any, space: Any) -> tuple[Scene, View]:
    """An exported scene through the view as it is now: nothing else is read. Raises ValueError as export_scene."""
    result = replace(scene)
    context = ExportContext(depsgraph, Scene())
    view = read_view(region, space, context)
    _look_through(result, view, export_view_film(context, view))
    return result, view


def _look_through(result: Scene, view: View, film: Film) -> None:
    result.camera, result.film, result.origin = view.camera, film, view.origin


def _is_shown(item: Any, space: Any) -> bool:
    """Local views and local collections hide what is elsewhere."""
    subject = item.parent if item.is_instance else item.object
    return bool(subject.visible_in_viewport_get(space))


def _warn_about_what_views_miss(context: ExportContext, space: Any) -> None:
    shading = space.shading
    if not (shading.use_scene_lights_render and shading.use_scene_world_render):
        context.warn("Viewport Shading: Luch always shows the scene's own lights and world.")
    if context.scene.render.use_motion_blur and context.view_layer.use_motion_blur:
        context.warn("Motion blur is seen in final renders only: the viewport is sharp.")


def _export_motion(context: ExportContext, cache: MeshCache, engine: Any, shutter: Shutter) -> None:
    """Everything as it is in the shutter's middle, and what moves at other times."""
    recorder = MotionRecorder(context, engine, shutter)
    # Evaluating another time gives meshes new addresses, and old ones to others: nothing may be kept by them.
    cache.clear()
    try:
        with recorder.at_middle():
            collector = export_instances(context, cache, recorder)
            views = engine if context.scene.render.use_multiview else None
            recorder.follow(
                context.result.camera, lambda: _camera(context, engine), lambda camera: camera_matrix(camera, views)
            )
    finally:
        cache.clear()
    recorder.finish(collector.kept)


def _warn_about_what_is_missing(context: ExportContext) -> None:
    """Say which settings of the scene change nothing yet."""
    render = context.scene.render
    if context.view_layer.use_pass_vector:
        context.warn(
            f'View layer "{context.view_layer.name}" asks for the pass Vector, which Luch does not write: motion blur'
            " takes its place."
        )
    camera: Any = context.scene.camera.data if context.scene.camera is not None else None
    if render.use_multiview and camera is not None and camera.type == "PANO" and camera.stereo.use_spherical_stereo:
        context.warn(
            f'Camera "{camera.name}" asks for spherical stereo; Luch draws each eye as one panorama.', "stereoscopy"
        )


def _camera(context: ExportContext, engine: Any) -> Any:
    chosen = (engine.camera_override if engine else None) or context.scene.camera
    return chosen.evaluated_get(context.depsgraph) if chosen is not None and not chosen.is_evaluated else chosen


def _origin(result: Scene) -> tuple[float, float, float]:
    """The camera's place, so that what it sees keeps all digits however far away from Blender's origin it is."""
    place = result.camera.matrix[:, 3]
    if not np.isfinite(place).all():
        raise ValueError("The camera's transform is not finite: clear it with Object > Clear.")
    return (float(place[0]), float(place[1]), float(place[2]))
