"""Long native calls on a thread of their own, watched by the caller's, which can end them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

# A call is watched this often: what a cancel waits for at most, beside one round of a batch.
WATCH_SECONDS = 0.1
SHORTEST_WATCH_SECONDS = 0.002  # before a deadline


class _Work(threading.Thread):
    """One call of the native renderer, so that the caller's thread can watch and cancel."""

    def __init__(self, work: Callable[[], object]) -> None:
        super().__init__(daemon=True)
        self._work = work
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self._work()
        except BaseException as error:  # handed to the caller's thread, which raises it
            self.error = error


def watched(
    work: Callable[[], object],
    renderer: Any,
    goes_on: Callable[[], bool],
    seconds_left: Callable[[], float] = lambda: float("inf"),
    watch_seconds: float = WATCH_SECONDS,
) -> bool:
    """Does `work` on a thread of its own and asks `goes_on` meanwhile, every `watch_seconds` and again when no
    seconds are left; on the first no, cancels the renderer.

    Returns whether it ran to its end uncancelled. No thread outlives this call.
    """
    thread = _Work(work)
    asked_to_go_on = True
    thread.start()
    try:
        while thread.is_alive():
            thread.join(min(watch_seconds, max(SHORTEST_WATCH_SECONDS, seconds_left())))
            if thread.is_alive() and asked_to_go_on and not goes_on():
                asked_to_go_on = False
                renderer.cancel()
    except BaseException:  # Ctrl-C, or the caller's own: nobody will read the film
        getattr(renderer, "abandon", renderer.cancel)()
        thread.join()
        raise
    if thread.error is not None:
        raise thread.error
    return asked_to_go_on
