"""What one export shares between its parts: the scene being filled, warnings, images, materials."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from luch.scene import F64, Scene

if TYPE_CHECKING:
    from .kept_images import KeptImages  # which reads images for this context


class ExportContext:
    """Carried through one export. Node compilers use `image_index`, `warn` and `object_matrix`."""

    def __init__(
        self, depsgraph: Any, result: Scene, kept_images: KeptImages | None = None, for_view: bool = False
    ) -> None:
        self.depsgraph = depsgraph
        self.scene: Any = depsgraph.scene
        self.view_layer: Any = depsgraph.view_layer
        self.result = result
        self.frame: int = depsgraph.scene.frame_current
        self.displaced: set[int] = set()  # indices into Scene.meshes
        self._images: dict[tuple[Any, ...], int] = {}
        self.for_view = for_view  # a 3D viewport, else a render
        self._kept_images = kept_images
        self._warned: set[str] = set()

    def warn(self, text: str, effect: str = "") -> None:
        """Say one sentence to the user, once: object, fact, remedy. effect: of luch.effects, that is missing here."""
        if text not in self._warned:
            self._warned.add(text)
            self.result.warnings.append(text)
            if effect:
                self.result.unsupported.setdefault(effect, []).append(text)

    def image_index(self, image: Any, user: Any = None, *, tile: int = 0) -> int:
        """Index into `Scene.images` of an image's pixels at this frame; a magenta marker if there are none.

        user: the node's ImageUser (frame of a sequence or movie); tile: a UDIM number, 0 for the first.
        """
        from .images import export_image, image_key

        key = image_key(image, user, tile, self.frame)
        index = self._images.get(key)
        if index is None:
            index = self._images[key] = len(self.result.images)
            kept = self._kept_images
            self.result.images.append(
                kept.image(key, image, user, tile, self) if kept else export_image(image, user, tile, self)
            )
        return index

    def object_matrix(self, subject: Any) -> F64:
        """Object to world, (4, 4) float64, of any object of this file (Texture Coordinate > Object)."""
        evaluated = subject if subject.is_evaluated else subject.evaluated_get(self.depsgraph)
        return np.array(evaluated.matrix_world, dtype=np.float64)
