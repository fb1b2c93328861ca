"""Images as a GPU has them: texels by tiles."""

from __future__ import annotations

import numpy as np
import pytest
from luch._native import core
from luch.cuda.upload import PIXELS, in_tiles, tiled

LAYOUT = core.render.image_layout()
TILE = LAYOUT["tile"]


@pytest.mark.parametrize(("width", "height", "size"), [(8, 8, 4), (19, 9, 1), (64, 16, 16), (100, 33, 6)])
def test_every_texel_lies_in_its_tile(width: int, height: int, size: int) -> None:
    texels = np.random.default_rng(width).integers(0, 256, (height, width, size), np.uint8)
    lying = in_tiles(texels.reshape(-1), width, height, TILE).reshape(-1, size)
    across = -(-width // TILE)
    y, x = np.mgrid[:height, :width]
    index = ((y // TILE * across + x // TILE) * TILE + y % TILE) * TILE + x % TILE
    assert np.array_equal(lying[index], texels)
    assert len(lying) == across * -(-height // TILE) * TILE * TILE


def test_images_smaller_than_a_tile_stay_as_they_are() -> None:
    views = np.zeros(2 * LAYOUT["size"], np.uint8)
    for k, (width, height) in enumerate([(16, 8), (16, TILE - 1)]):
        for name, value in (("width", width), ("height", height)):
            views[k * LAYOUT["size"] + LAYOUT[name] :][:4] = np.frombuffer(np.uint32(value).tobytes(), np.uint8)
    pixels = [np.arange(16 * 8, dtype=np.uint8), np.arange(16 * (TILE - 1), dtype=np.uint8)]
    blocks = [("view", np.zeros(8, np.uint8)), ("images", views), *((PIXELS, data) for data in pixels)]
    links = [(0, 0, 1, 0), *((1, k * LAYOUT["size"] + LAYOUT["pixels"], 2 + k, 0) for k in range(2))]
    result = tiled(blocks, links)
    assert not np.array_equal(result[2][1], pixels[0]) and sorted(result[2][1]) == sorted(pixels[0])
    assert np.array_equal(result[3][1], pixels[1])
    across = [int(np.asarray(result[1][1])[k * LAYOUT["size"] + LAYOUT["tiles_across"]]) for k in range(2)]
    assert across == [2, 0]
