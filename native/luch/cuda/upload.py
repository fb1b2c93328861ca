"""Views that were made on the CPU, with everything that their pointers lead to, copied to the current device.

Images that do not fit stay in the host's memory, where a GPU reads them over the bus: slower, bit for bit the same.
"""

from __future__ import annotations

import struct
from collections.abc import Collection
from types import SimpleNamespace
from typing import Any

import numpy as np

from luch._native import core
from luch.cuda.device import DeviceError, cupy

Blocks = list[tuple[str, Any]]  # name, (bytes,) uint8
Links = list[tuple[int, int, int, int]]  # block that holds a pointer, its offset, block it leads to, offset there
PIXELS = "pixels"  # name of an image's block
VIEW_BLOCKS = ("camera", "filter", "shutter", "shutter times", "camera keys")  # those that a moved camera changes


class HostBlock:
    """A block that stays on the host, locked in memory so that the device can read it where it lies."""

    nbytes = 0  # on the device

    def __init__(self, count: int) -> None:
        self.size = count
        self._memory = cupy().cuda.alloc_pinned_memory(count)
        self.data = SimpleNamespace(ptr=self._memory.ptr)  # the same address there, as CUDA unifies them

    def set(self, data: Any) -> None:
        """Fills it."""
        np.frombuffer(self._memory, np.uint8, self.size)[...] = data


class DeviceCopy:
    """Blocks on the device. ``root``: the bytes of the outermost view, its pointers set, to be passed to a kernel."""

    def __init__(self, blocks: Blocks, links: Links, left: Collection[int] = ()) -> None:
        """blocks[0] is the outermost view; it stays on the host. left: numbers of blocks that do, too.

        Raises DeviceError where the device's memory does not suffice.
        """
        self.arrays: list[Any] = [None, *_allocated(blocks, left)]
        patched: dict[int, bytearray] = {0: bytearray(blocks[0][1])}
        for block, offset, target, target_offset in links:
            host = patched.setdefault(block, bytearray(blocks[block][1]))
            array = self.arrays[target]
            struct.pack_into("<Q", host, offset, array.data.ptr + target_offset if array.size else 0)
        for number, (_, data) in enumerate(blocks):
            if number and data.size:
                self.arrays[number].set(np.frombuffer(patched[number], np.uint8) if number in patched else data)
        self.root = bytes(patched[0])
        self._sizes = _sizes(blocks)

    def refresh(self, blocks: Blocks, links: Links) -> bool:
        """Takes the outermost view and VIEW_BLOCKS of the same scene anew; the others stay. False: sizes differ."""
        if _sizes(blocks) != self._sizes:
            return False
        fresh = {
            number: bytearray(data)
            for number, (name, data) in enumerate(blocks)
            if number == 0 or (name in VIEW_BLOCKS and data.size)
        }
        for block, offset, target, target_offset in links:
            array = self.arrays[target]
            if block in fresh:
                struct.pack_into("<Q", fresh[block], offset, array.data.ptr + target_offset if array.size else 0)
        for number, data in fresh.items():
            if number:
                self.arrays[number].set(np.frombuffer(data, np.uint8))
        self.root = bytes(fresh[0])
        return True

    @property
    def bytes(self) -> int:
        """On the device."""
        return sum(int(array.nbytes) for array in self.arrays[1:])


def _sizes(blocks: Blocks) -> list[tuple[str, int]]:
    """But for images, which tiled() fills up."""
    return [(name, 0 if name == PIXELS else len(data)) for name, data in blocks]


def _allocated(blocks: Blocks, left: Collection[int]) -> list[Any]:
    cp = cupy()
    try:
        return [
            HostBlock(len(data)) if number in left else cp.empty(len(data), np.uint8)
            for number, (_, data) in enumerate(blocks)
            if number
        ]
    except cp.cuda.memory.OutOfMemoryError as error:
        raise too_large(sum(len(data) for _, data in blocks)) from error


def too_large(needed: int) -> DeviceError:
    """What is told of a scene that does not fit."""
    free, _ = cupy().cuda.runtime.memGetInfo()
    return DeviceError(
        f"The scene takes {needed / 2**30:.1f} GiB of the GPU's memory, of which {free / 2**30:.1f} are free. Close "
        "what else uses the GPU, simplify meshes, or use the CPU."
    )


def tiled(blocks: Blocks, links: Links) -> Blocks:
    """The blocks with every image's texels put together by tiles, so that neighbours in both directions lie near each
    other: wherever they are read from, a GPU reads 32 bytes or more at a time. Images smaller than a tile stay.
    """
    layout, result = core.render.image_layout(), list(blocks)
    size, tile = layout["size"], layout["tile"]
    views: dict[int, bytearray] = {}
    for block, offset, target, _ in links:
        if result[target][0] != PIXELS or offset % size != layout["pixels"]:
            continue
        view = views.setdefault(block, bytearray(blocks[block][1]))
        at = offset - layout["pixels"]
        width, height = (struct.unpack_from("<I", view, at + layout[name])[0] for name in ("width", "height"))
        if min(width, height) >= tile:
            result[target] = (PIXELS, in_tiles(blocks[target][1], width, height, tile))
            struct.pack_into("<I", view, at + layout["tiles_across"], -(-width // tile))
    for number, view in views.items():
        result[number] = (blocks[number][0], np.frombuffer(view, np.uint8))
    return result


def in_tiles(texels: Any, width: int, height: int, tile: int) -> Any:
    """texels: (bytes,) row by row. Returns (bytes,) tile by tile; tiles beyond the edge are filled up with zeros."""
    rows = np.asarray(texels).reshape(height, width, -1)
    across, down = -(-width // tile), -(-height // tile)
    whole = np.zeros((down * tile, across * tile, rows.shape[2]), np.uint8)
    whole[:height, :width] = rows
    return whole.reshape(down, tile, across, tile, -1).swapaxes(1, 2).reshape(-1)


def images_to_leave(blocks: Blocks, room: int) -> set[int]:
    """Numbers of the images that stay on the host so that the others fit in `room` bytes: the largest ones."""
    images = sorted((len(data), number) for number, (name, data) in enumerate(blocks) if name == PIXELS)
    left: set[int] = set()
    for size, number in images:
        room -= size
        if room < 0:
            left.add(number)
    return left
