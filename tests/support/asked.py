"""What a test is asked of: each device, each structure."""

from __future__ import annotations

import pytest
from luch.accel import KINDS

every_device = pytest.mark.parametrize("device", ["CPU", pytest.param("CUDA", marks=pytest.mark.cuda)])
every_kind = pytest.mark.parametrize("kind", KINDS)
