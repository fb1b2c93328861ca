"""Row 20 of the list of hard cases on CUDA: on a GPU, and anywhere with the kernels run by fibers on the CPU."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from luch.accel import Accel
from luch.cuda import compiler
from support.accel_meshes import HARD_MESHES
from support.hard_rays import assert_same_bits, device_rays

KINDS = list(compiler.table()["modules"])
FEW = ("soup", "needles", "identical", "duplicates", "one triangle", "points")  # meshes for the fibers, which are slow


@pytest.mark.parametrize("name", [n if n in FEW else pytest.param(n, marks=pytest.mark.cuda) for n in HARD_MESHES])
@pytest.mark.parametrize("kind", KINDS)
def test_20_hits_on_the_device_are_bit_equal_to_brute_force(place: str, kind: Any, name: str) -> None:
    mesh = HARD_MESHES[name]
    rays = device_rays(mesh, place)
    oracle = Accel(*mesh, kind="BRUTE_FORCE")
    ours = Accel(*mesh, kind=kind, device="CUDA")
    assert_same_bits(ours.closest(rays), oracle.closest(rays))
    assert np.array_equal(ours.any(rays), oracle.any(rays))
