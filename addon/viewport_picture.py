"""A film's picture as a texture, drawn where the view says it lies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gpu
from gpu_extras.presets import draw_texture_2d

if TYPE_CHECKING:
    from luch.preview import Picture  # loads the core: not while Blender starts


class PictureOnScreen:
    """Keeps the texture of the picture drawn last: a region is drawn far more often than its picture changes."""

    def __init__(self) -> None:
        self._picture: Picture | None = None
        self._texture: Any = None

    def draw(self, picture: Picture, engine: Any, scene: Any) -> None:
        """Scene-linear values with alpha multiplied in; Blender brings them to the display."""
        if picture is not self._picture:
            self._texture = texture_of(picture)
            self._picture = picture
        view: Any = picture.tag
        film = picture.film
        x, y, width, height = view.place(film.width, film.height, film.border)
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture, (x, y), width, height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")


def texture_of(picture: Picture) -> Any:
    """On the GPU of Blender's window; float32 RGBA."""
    height, width = picture.pixels.shape[:2]
    values: Any = picture.pixels.reshape(-1)
    buffer = gpu.types.Buffer("FLOAT", width * height * 4, values)
    return gpu.types.GPUTexture((width, height), format="RGBA32F", data=buffer)
