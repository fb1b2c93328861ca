"""From film buffers to Blender's render result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np
from luch import cryptomatte
from luch.scene import F32, Film, Scene


class ResultWriter:
    """Owns the render result of one view layer: begun on entry, always ended on exit.

    A result that is begun and never ended crashes Blender when it saves, so nothing may come between the two.
    """

    def __init__(self, engine: Any, layer: str, film: Film) -> None:
        self._engine = engine
        self._layer = layer
        self._size = film.size
        self._result: Any = None

    def __enter__(self) -> ResultWriter:
        view = self._engine.active_view_get()
        self._result = self._engine.begin_result(0, 0, *self._size, layer=self._layer, view=view)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._engine.end_result(self._result)

    def write(self, passes: Mapping[str, F32]) -> None:
        """Put film buffers, float32 (H, W, C) bottom row first, into Blender's passes of the same names."""
        for target in self._result.layers[0].passes:
            source = passes.get(target.name)
            if source is not None:
                target.rect.foreach_set(_fit(source, len(target.rect) * target.channels, target.name))

    def show(self, passes: Mapping[str, F32]) -> None:
        """Write an intermediate picture and let Blender draw it."""
        self.write(passes)
        self._engine.update_result(self._result)

    def stamp(self, stats: Mapping[str, Any], scene: Scene) -> None:
        """Write statistics and cryptomatte manifests into the file's metadata. After the result has ended."""
        from luch import effects  # loads the core: not while Blender starts

        final = self._engine.get_result()
        if final is None:
            return
        for key, value in stats.items():
            if key == "effects":  # their reasons would outweigh all the rest
                value = effects.summary(value)
            text = value if isinstance(value, str) else json.dumps(value)
            final.stamp_data_add_field(f"luch.{self._layer}.{key}", text)
        for key, text in cryptomatte.metadata(scene, self._layer).items():
            final.stamp_data_add_field(key, text)


def _fit(source: F32, length: int, name: str) -> F32:
    """The buffer as flat float32 of exactly the length Blender allocated. Raises ValueError if it cannot be."""
    flat = np.ascontiguousarray(source, dtype=np.float32).reshape(-1)
    if len(flat) != length:
        raise ValueError(
            f'Pass "{name}": Blender wants {length} floats, the film has shape {source.shape}. Please report this.'
        )
    return flat
