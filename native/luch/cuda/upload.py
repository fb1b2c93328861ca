"""Views that were made on the CPU, with everything that their pointers lead to, copied to the current device."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from luch.cuda.device import cupy

Blocks = list[tuple[str, Any]]  # name, (bytes,) uint8
Links = list[tuple[int, int, int, int]]  # block that holds a pointer, its offset, block it leads to, offset there


class DeviceCopy:
    """Blocks on the device. ``root``: the bytes of the outermost view, its pointers set, to be passed to a kernel."""

    def __init__(self, blocks: Blocks, links: Links) -> None:
        """blocks[0] is the outermost view; it stays on the host."""
        cp = cupy()
        self.arrays: list[Any] = [None, *(cp.empty(len(data), np.uint8) for _, data in blocks[1:])]
        patched: dict[int, bytearray] = {0: bytearray(blocks[0][1])}
        for block, offset, target, target_offset in links:
            host = patched.setdefault(block, bytearray(blocks[block][1]))
            array = self.arrays[target]
            struct.pack_into("<Q", host, offset, array.data.ptr + target_offset if array.size else 0)
        for number, (_, data) in enumerate(blocks):
            if number and data.size:
                self.arrays[number].set(np.frombuffer(patched[number], np.uint8) if number in patched else data)
        self.root = bytes(patched[0])

    @property
    def bytes(self) -> int:
        """On the device."""
        return sum(int(array.nbytes) for array in self.arrays[1:])
