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

from luch.kept import Kept
from luch.render import Pace, Progress, Result, preparing, render
from luch.scene import F32, Film, Scene

# How often a render is asked whether its scene is still wanted: with a batch of paths beside, an edit waits so long.
# Whoever waits at a window would rather know the error soon than have the last tenth of the speed.
PACE = Pace(watch_seconds=0.02, look_share=0.05)
COARSEST = 4  # pixels of the finished picture along a side of one of the first, while their speed is not known
MOST_COARSE = 32  # where pictures are given up before their first sample is there
# The first picture is as fine as one of so many seconds: whoever turns a view wants to see it turn.
FIRST_SECONDS = 0.05
# A first picture under way is not given up for so long: where every move ended it, a view that turns would show nothing.
PATIENCE_SECONDS = 0.08
STILL_SECONDS = 0.25  # that a view must stand before a renderer is built for where it is
# A step that shows the finished picture's size within this time needs no coarser one before it.
AT_ONCE_SECONDS = 0.15
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
        self._void = 0  # of this version and before it nothing is to be seen
        self._coarsest = COARSEST
        self._pixel_seconds = 0.0  # of one sample, as seen last; 0: not yet
        self.kept = Kept()  # the thread's, while there is one
        self._forget = False  # what is kept
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
            self._void = self._version
            self._wanted = None
            self.picture = None
            self.text, self.failed = "", False
            self.news += 1
            self._forget = self._thread is not None
            if not self._forget:
                self.kept.drop()

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
            wanted = self._next()
            if wanted is None:
                return
            try:
                self._draw(*wanted)
            except _Superseded:
                pass
            except BaseException as error:  # told in words; the next scene may be better
                self.kept.drop()
                self._fail(wanted[2], error)

    def _next(self) -> tuple[Scene, object, int] | None:
        """What is to be drawn; None: nothing, and the thread is to end."""
        rested = False
        while True:
            with self._lock:
                if self._forget or self._ended:
                    self.kept.drop()
                    self._forget = False
                wanted, self._wanted = self._wanted, None
                if wanted is not None and not self._ended:
                    return wanted
                if rested:
                    self._thread = None
                    self.news += 1
                    return None
            self.kept.rest()  # without the lock: it may take its time, and another scene may come meanwhile
            rested = True

    def _draw(self, scene: Scene, tag: object, version: int) -> None:
        """Each of the first pictures is half as coarse as the one before, until the finished size comes at once. Where
        that is the first one, it is drawn all the same.
        """
        factor = first = self._first_factor(scene.film)
        seen = False
        try:
            while True:
                self._draw_coarse(scene, factor, tag, version, factor == first)
                self._coarsest, seen = COARSEST, True
                if version != self._version:
                    raise _Superseded
                if factor <= 2 or self._pixel_seconds * scene.film.pixels <= AT_ONCE_SECONDS:
                    break
                factor //= 2
        except _Superseded:
            if not seen:  # views turn faster than pictures come
                self._coarsest = max(2 * COARSEST, min(2 * first, MOST_COARSE))
            raise
        self._refine(scene, tag, version)

    def _first_factor(self, film: Film) -> int:
        """How coarse the first picture is to be: 1 is the finished size."""
        if self._pixel_seconds == 0.0 or self._coarsest > COARSEST:
            return self._coarsest
        factor = 1
        while factor < MOST_COARSE and self._pixel_seconds * film.pixels > FIRST_SECONDS * factor * factor:
            factor *= 2
        return factor

    def _draw_coarse(self, scene: Scene, factor: int, tag: object, version: int, first: bool) -> None:
        """One sample of every large pixel. The first picture is soon there, and drawn though the view turns on: where
        its pixels are those of the finished one, too, or a view that turns would show nothing on a fast device.
        """
        film = coarser(scene.film, factor)
        settings = replace(
            scene.settings, samples=1, time_limit=0.0, error_limit=0.0, adaptive=False, estimate_error=False
        )
        result = self._render(replace(scene, film=film, settings=settings), version, None, first)
        stats = result.stats  # whoever waits for a picture waits for its film and its reading, too
        took = stats["total_seconds"] - (0.0 if stats["reused"] else stats["prepare_seconds"])
        self._pixel_seconds = took / film.pixels
        nothing_yet = replace(preparing(scene.settings.samples, time.perf_counter()), preparing=False)
        self._say(version, self._describe(nothing_yet))  # instead of what was said of the view before
        self._show(Picture(result.passes["Combined"], film, version, tag))

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

    def _render(
        self, scene: Scene, version: int, look: Callable[[Progress], None] | None, patient: bool = False
    ) -> Result:
        """Raises _Superseded as soon as another scene is wanted; patient: some moments later."""
        self.kept.hurried = patient
        if not patient and self.kept.is_far(scene):
            self._stand(version)
        ends = time.perf_counter() + (PATIENCE_SECONDS if patient else 0.0)

        def goes_on(progress: Progress) -> bool:
            if version <= self._void or (version != self._version and time.perf_counter() >= ends):
                raise _Superseded
            if look is not None:
                look(progress)
            return True

        result = render(scene, progress=goes_on, pace=PACE, kept=self.kept)
        if version <= self._void or (version != self._version and not patient):
            raise _Superseded
        return result

    def _stand(self, version: int) -> None:
        """Building takes longer than a view takes to turn on: it would be thrown away again and again."""
        until = time.perf_counter() + STILL_SECONDS
        while time.perf_counter() < until:
            if version != self._version:
                raise _Superseded
            time.sleep(0.005)

    def _show(self, picture: Picture) -> None:
        with self._lock:
            if picture.version > self._void:
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
