"""3D views in Rendered mode: Blender's thread exports and draws, another one renders (luch.preview).

A Viewport belongs to one engine object of Blender, and so to one region of one window. Nothing of Blender is kept in it
from one call to the next, and the thread that renders sees arrays only: whatever Blender does with its data meanwhile
(undo, another file, closing the view), that thread goes on until it is told that nobody wants its picture.
"""

from __future__ import annotations

import functools
import sys
import traceback
import weakref
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import bpy
from luch.same import same
from luch.scene import Scene

from . import report
from .viewport_picture import PictureOnScreen

if TYPE_CHECKING:
    from .export.cache import MeshCache  # loads the core: not while Blender starts
    from .export.view import View

POLL_SECONDS = 0.05  # how often a view asks its renderer for news while it renders
# Every one there is, for the add-on's end.
_all: weakref.WeakSet[Viewport] = weakref.WeakSet()


class Viewport:
    """What one 3D view shows."""

    def __init__(self) -> None:
        from luch.preview import Preview

        from .export.cache import MeshCache

        self._notes = Notes()
        self.preview = Preview(report.viewport_line, self._notes.end_line, _explain)
        self._cache: MeshCache = MeshCache()
        self._scene: Scene | None = None  # as it was submitted last
        self._view: View | None = None
        self._error = ""
        self._failed_at: tuple[object, ...] = ()  # the view
        self._pixel_size = 1
        self._on_screen = PictureOnScreen()
        self.news_seen = -1
        self.watched = False
        weakref.finalize(self, self.preview.stop)
        _all.add(self)

    def update(self, context: Any, depsgraph: Any, pixel_size: int = 1) -> None:
        """Something may have changed: render it, if the picture changes with it. pixel_size: of Blender's pixels."""
        self._pixel_size = pixel_size
        from .export import export_view_scene

        try:
            scene, view = export_view_scene(depsgraph, context.region, context.space_data, self._cache)
            self._submit(scene, view)
        except BaseException as error:  # of drivers and node scripts too: none may end Blender
            self._fail(error, context)

    def follow(self, context: Any, depsgraph: Any) -> None:
        """The view may have turned, or the region grown: nothing but the camera is read, unless there is no scene yet."""
        from .export import seen_anew
        from .export.view import view_state

        if self._scene is None:
            if self._error and view_state(context.region) != self._failed_at:
                self.update(context, depsgraph, self._pixel_size)
            return
        try:
            scene, view = seen_anew(self._scene, depsgraph, context.region, context.space_data)
            self._submit(scene, view)
        except BaseException as error:
            self._fail(error, context)

    def draw(self, context: Any, depsgraph: Any, engine: Any) -> None:
        """The latest picture, into the region that Blender draws."""
        self.follow(context, depsgraph)
        self.news_seen = self.preview.news
        picture = self.preview.picture
        try:
            if picture is not None:
                self._on_screen.draw(picture, engine, depsgraph.scene)
        except Exception as error:  # no picture, no second try with it
            self._fail(error, context)
        engine.update_stats("", self.text)

    @property
    def text(self) -> str:
        """The view's status."""
        return self._error or self.preview.text

    def _submit(self, scene: Scene, view: View) -> None:
        from luch.preview import coarser

        scene.film = coarser(scene.film, self._pixel_size)
        if self._error == "" and same(scene, self._scene) and same(view, self._view):
            return
        self._error = ""
        self._scene, self._view = scene, view
        self._notes.tell(scene.warnings)
        self.preview.submit(scene, view)

    def _fail(self, error: BaseException, context: Any) -> None:
        """Say it once; the next change is another try."""
        from .export.view import view_state

        self._failed_at = view_state(context.region)
        text = report.describe_error(error)
        if text != self._error:
            traceback.print_exception(error)
        self._error = text
        self._scene = self._view = None
        self.preview.clear()

    def stop(self, wait: bool = False) -> None:
        self.preview.stop(wait)


class Notes:
    """What a view's pictures lack or do otherwise, each told once in the console. For any thread."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def tell(self, notes: Sequence[str]) -> None:
        for note in notes:
            if note not in self._told:
                self._told.add(note)
                print(f"Luch: {note}", file=sys.stderr)

    def end_line(self, stats: Mapping[str, Any]) -> str:
        """The status of a finished picture."""
        self.tell(stats["warnings"])
        return report.viewport_end_line(stats)


def of_engine(engine: Any) -> Viewport | None:
    """The engine's own, made at its first call; None: the core cannot be loaded, and the view's status says so."""
    if not hasattr(engine, "view"):
        try:
            engine.view = Viewport()
        except ImportError as error:
            engine.update_stats("", report.describe_error(error))
            return None
    found: Viewport = engine.view
    return found


def _explain(error: BaseException) -> str:
    """For the view's status; the rest goes to the console. On the renderer's thread."""
    traceback.print_exception(error)
    return report.describe_error(error)


def watch(engine: Any) -> None:
    """Let Blender draw the engine's view anew whenever there is something new, until its picture is finished."""
    view: Viewport = engine.view
    if not view.watched and not bpy.app.background:
        view.watched = True
        bpy.app.timers.register(functools.partial(_look, weakref.ref(engine)), first_interval=POLL_SECONDS)


def _look(reference: weakref.ref[Any]) -> float | None:
    """Called by Blender's timers: seconds until the next look, None for none."""
    engine = reference()
    if engine is None:
        return None
    try:
        return _look_at(engine)
    except ReferenceError:  # Blender has closed the view
        return None


def _look_at(engine: Any) -> float | None:
    view: Viewport = engine.view
    busy = view.preview.busy  # asked first: what comes after a no is seen below
    if view.preview.news != view.news_seen:
        engine.tag_redraw()
    view.watched = busy
    return POLL_SECONDS if busy else None


def stop_all() -> None:
    """For the add-on's end: no thread outlives this."""
    for view in list(_all):
        view.stop(wait=True)
