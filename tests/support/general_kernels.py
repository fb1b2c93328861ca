"""Renders on CUDA by the kernels that `build.py build --cuda` has compiled for all scenes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

from luch.cuda import compiler
from luch.cuda.scene_kernels import SceneKernels


@contextmanager
def general_kernels_alone() -> Iterator[None]:
    """No scene gets kernels of its own meanwhile; one that general kernels do not serve has none at all."""
    with mock.patch.object(compiler, "kept", return_value=None), mock.patch.object(SceneKernels, "_compile"):
        yield
