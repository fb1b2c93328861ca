"""What devices need of the host: the scene as the core has read and built it, and its film, where sums of several meet."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from luch._native import core
from luch.cuda.upload import Blocks, Links, tiled

# Groups of so many triangles get their tree from the GPU: a million take 10 ms there and 1.7 s on a processor.
DEVICE_BUILDS_FROM = 20_000


class HostScene:
    """What the core makes of a scene for devices: read and built once, however many devices render it."""

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self.core = core.render.Renderer(scene, True, DEVICE_BUILDS_FROM)
        self.facts: dict[str, Any] = {}
        self.images: Any = None  # core.render.Renderer.device_images

    def prepare(self) -> bool:
        """Builds structures and lights. False when cancelled."""
        if not self.core.prepare():
            return False
        self.facts = self.core.device_facts()
        (blocks, links), trees, left, depth = self.core.device_images()
        self.images = (tiled(blocks, links), links), trees, left, depth
        return True

    def set_view(self, scene: Any) -> tuple[dict[str, Any], Blocks, Links] | None:
        """The same scene looked at anew: its facts, blocks and links. None: devices need more than those of the view."""
        if self.facts["world_reads_camera"]:
            return None
        self.core.set_view(scene)
        before, self.facts = self.facts, self.core.device_facts()
        if {**before, "most_rounds": 0} != {**self.facts, "most_rounds": 0}:
            return None
        blocks, links = self.core.device_view()
        self._scene = scene
        return self.facts, blocks, links

    def build_all(self) -> bool:
        """The same, with nothing left for devices to build. False when cancelled."""
        self.core = core.render.Renderer(self._scene, True)
        return self.prepare()

    def set_film(self, rows: Any, counts: Any) -> None:
        """rows: (pixels, stride) float64; counts: (pixels,) uint32, samples of each."""
        own_rows, own_counts = self.core.film_arrays()
        own_rows[...] = rows
        own_counts[...] = counts


class HostFilm(ABC):
    """What is read from the film on the host: of any renderer whose film lies on devices."""

    def __init__(self, host: HostScene) -> None:
        self._host = host

    @abstractmethod
    def _download(self) -> None:
        """Brings the film's sums to the host, if they are not there."""

    def passes(self) -> dict[str, Any]:
        """Blender's pass name -> float32 (H, W, C), bottom row first."""
        self._download()
        passes: dict[str, Any] = self._host.core.passes()
        return passes

    def film_arrays(self) -> tuple[Any, Any]:
        """As core.render.Renderer's."""
        self._download()
        rows, counts = self._host.core.film_arrays()
        return rows, counts

    def deviations(self) -> tuple[Any, Any, float]:
        """As core.render.Renderer's."""
        self._download()
        mean, deviation, share = self._host.core.deviations()
        return mean, deviation, share
