"""A picture that follows a scene which changes all the time: coarse at once, then finer, then less and less noisy.

>>> preview = Preview()                                     # doctest: +SKIP
>>> preview.submit(scene)                                   # doctest: +SKIP
>>> preview.picture.pixels.shape                            # doctest: +SKIP
(540, 960, 4)

The scene that was submitted last is drawn; whatever is under way for another is thrown away. A thread is there only
while there is something to render, and it touches nothing but arrays: whoever owns the scene's source goes on freely.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from luch.render import Pace, Progress, Result, render
from luch.scene import F32, Film, Scene

# How often a render is asked whether its scene is still wanted: with a batch of paths beside, an edit waits so long.
# Whoever waits at a window would rather know the error soon than have the last tenth of the speed.
PACE = Pace(watch_seconds=0.02, look_share=0.05)
COARSEST = 4  # pixels of the finished picture along a side of one of the first
MOST_COARSE = 32  # where pictures are given up before their first sample is there
# A step that shows the finished picture's size within this time needs no coarser one before it.
AT_ONCE_SECONDS = 0.15
MOST_BUILDING = 0.25  # of that time, for another picture between
# Pictures are read at most so often, and reading takes at most this share of the time.
PICTURE_SECONDS = 0.1
PICTURE_SHARE = 0.1
WORDS_SECONDS = 0.25  # between two texts


@dataclass(frozen=True)
class Picture:
    """What there is to see of a scene. pixels: float32 (H, W, 4), bottom row first, of the film's border."""

    pixels: F32
    film: Film
    version: int  # as submit() returned it
    tag: object  # as it was submitted


class _Superseded(Exception):
    """Another scene is wanted, or none."""


def coarser(film: Film, factor: int) -> Film:
    """The same view with pixels that are so many times longer and wider; at least one."""
    if factor == 1:
        return film
    width, height = max(1, film.width // factor), max(1, film.height // factor)
    x, y = film.width / width, film.height / height
    border = film.border
    if border is not None:
        x0, y0, x1, y1 = border
        border = (int(x0 / x), int(y0 / y), min(width, math.ceil(x1 / x)), min(height, math.ceil(y1 / y)))
    aspect = (film.pixel_aspect[0] * x, film.pixel_aspect[1] * y)
    return replace(film, width=width, height=height, border=border, pixel_aspect=aspect)


def _describe(progress: Progress) -> str:
    return f"{progress.samples} samples"


def _describe_end(stats: Mapping[str, Any]) -> str:
    return f"{stats['samples']} samples"


class Preview:
    """Renders what was submitted last, on a thread of its own. Every method may be called from any thread.

    describe, describe_end, explain: words for a render under way, a finished one, an error.
    """

    def __init__(
        self,
        describe: Callable[[Progress], str] = _describe,
        describe_end: Callable[[Mapping[str, Any]], str] = _describe_end,
        explain: Callable[[BaseException], str] = str,
    ) -> None:
        self._describe, self._describe_end, self._explain = describe, describe_end, explain
        self._lock = threading.Lock()
        self._wanted: tuple[Scene, object, int] | None = None
        self._thread: threading.Thread | None = None
        self._ended = False
        self._version = 0
        self._coarsest = COARSEST
        self.picture: Picture | None = None
        self.text = ""
        self.failed = False
        self.stats: dict[str, Any] = {}  # of the last picture that was finished
        self.news = 0  # grows when there is something else to see or to read

    def submit(self, scene: Scene, tag: object = None) -> int:
        """Render this scene, which nobody may change any more, instead of any before. Returns at once."""
        with self._lock:
            self._version += 1
            if self._ended:
                return self._version
            self._wanted = (scene, tag, self._version)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="luch preview", daemon=True)
                self._thread.start()
            return self._version

    def clear(self) -> None:
        """Nothing is wanted, and nothing is there to see."""
        with self._lock:
            self._version += 1
            self._wanted = None
            self.picture = None
            self.text, self.failed = "", False
            self.news += 1

    def stop(self, wait: bool = False) -> None:
        """For good. wait: return when the thread has ended."""
        with self._lock:
            self._ended = True
            thread = self._thread
        self.clear()
        if wait and thread is not None:
            thread.join()

    @property
    def busy(self) -> bool:
        """Something is being rendered."""
        return self._thread is not None

    def wait(self, seconds: float) -> bool:
        """Until nothing is left to render; False: not within that time."""
        thread = self._thread
        if thread is not None:
            thread.join(seconds)
        return self._thread is None

    def _run(self) -> None:
        while True:
            with self._lock:
                if self._wanted is None or self._ended:
                    self._thread = None
                    self.news += 1
                    return
                scene, tag, version = self._wanted
                self._wanted = None
            try:
                self._draw(scene, tag, version)
            except _Superseded:
                pass
            except BaseException as error:  # told in words; the next scene may be better
                self._fail(version, error)

    def _draw(self, scene: Scene, tag: object, version: int) -> None:
        """Each of the first pictures is half as coarse as the one before, until the finished size comes at once."""
        factor = self._coarsest
        try:
            while factor > 1:
                stats = self._draw_coarse(scene, factor, tag, version)
                self._coarsest = COARSEST
                finished_size = stats["render_seconds"] * factor * factor
                # Every picture builds its structures anew.
                if finished_size <= AT_ONCE_SECONDS or stats["prepare_seconds"] > MOST_BUILDING * finished_size:
                    break
                factor //= 2
        except _Superseded:
            if factor == self._coarsest:  # not one was seen: views turn faster than pictures come
                self._coarsest = min(2 * self._coarsest, MOST_COARSE)
            raise
        self._refine(scene, tag, version)

    def _draw_coarse(self, scene: Scene, factor: int, tag: object, version: int) -> dict[str, Any]:
        """One sample of every large pixel; the render's statistics."""
        film = coarser(scene.film, factor)
        settings = replace(
            scene.settings, samples=1, time_limit=0.0, error_limit=0.0, adaptive=False, estimate_error=False
        )
        result = self._render(replace(scene, film=film, settings=settings), version, None)
        self._show(Picture(result.passes["Combined"], film, version, tag))
        return result.stats

    def _refine(self, scene: Scene, tag: object, version: int) -> None:
        """Samples of the finished size, until a limit is reached."""
        next_read = next_words = 0.0

        def look(progress: Progress) -> None:
            nonlocal next_read, next_words
            now = time.perf_counter()
            if progress.new_picture and now >= next_read:
                self._show(Picture(progress.passes()["Combined"], scene.film, version, tag))
                took = time.perf_counter() - now
                next_read = now + max(PICTURE_SECONDS, took / PICTURE_SHARE)
            if now >= next_words:
                next_words = now + WORDS_SECONDS
                self._say(version, self._describe(progress))

        result = self._render(scene, version, look)
        self._show(Picture(result.passes["Combined"], scene.film, version, tag))
        self.stats = result.stats
        self._say(version, self._describe_end(result.stats))

    def _render(self, scene: Scene, version: int, look: Callable[[Progress], None] | None) -> Result:
        """Raises _Superseded as soon as another scene is wanted."""

        def goes_on(progress: Progress) -> bool:
            if version != self._version:
                raise _Superseded
            if look is not None:
                look(progress)
            return True

        result = render(scene, progress=goes_on, pace=PACE)
        if version != self._version:
            raise _Superseded
        return result

    def _show(self, picture: Picture) -> None:
        with self._lock:
            if picture.version == self._version:
                self.picture = picture
                self.failed = False
                self.news += 1

    def _say(self, version: int, text: str) -> None:
        with self._lock:
            if version == self._version and text != self.text:
                self.text = text
                self.news += 1

    def _fail(self, version: int, error: BaseException) -> None:
        text = self._explain(error)
        with self._lock:
            if version == self._version:
                self.picture = None
                self.text, self.failed = text, True
                self.news += 1
