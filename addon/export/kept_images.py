"""Images of a viewport's last export: reading them again at every edit would take longer than the edit."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from luch.scene import Image

from .images import export_image, read_path

if TYPE_CHECKING:
    from .context import ExportContext


@dataclass
class _Kept:
    state: tuple[Any, ...]
    image: Image
    generation: int


class KeptImages:
    """By what makes two uses show the same pixels, as long as every export uses them and their image stays as it is."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], _Kept] = {}
        self._generation = 0

    def begin(self, changed: set[int]) -> None:
        """A new export starts. changed: session_uid of images that Blender says were changed."""
        self._kept = {
            key: kept
            for key, kept in self._kept.items()
            if kept.generation == self._generation and key[0] not in changed
        }
        self._generation += 1

    def image(self, key: tuple[Any, ...], image: Any, user: Any, tile: int, context: ExportContext) -> Image:
        """As export_image gives it."""
        if image is None or image.original.is_dirty or image.source == "MOVIE":  # painted: nothing tells each stroke
            return export_image(image, user, tile, context)
        state = _state(image.original, user, tile, context.frame)
        kept = self._kept.get(key)
        if kept is None or kept.state != state:
            told = len(context.result.warnings)
            kept = _Kept(state, export_image(image, user, tile, context), self._generation)
            if len(context.result.warnings) > told:  # said again as long as it holds
                return kept.image
            self._kept[key] = kept
        kept.generation = self._generation
        return kept.image


def _state(image: Any, user: Any, tile: int, frame: int) -> tuple[Any, ...]:
    """What changes when its pixels do."""
    path = read_path(image, user, tile, frame)
    try:
        found = os.stat(path)
        file = (found.st_mtime_ns, found.st_size)
    except OSError:
        file = (0, 0)
    settings = image.colorspace_settings
    generated = (tuple(image.generated_color), image.generated_type, image.use_generated_float)
    packed = image.packed_file.size if image.packed_file else 0
    return (path, file, packed, tuple(image.size), image.source, image.alpha_mode, settings.name, settings.is_data,
            generated)  # fmt: skip
