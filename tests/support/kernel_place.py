"""The fixture of tests that run kernels; conftest.py of their folder names it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support import cuda_on_cpu


@pytest.fixture(scope="module", params=[cuda_on_cpu.FIBERS, pytest.param(cuda_on_cpu.GPU, marks=pytest.mark.cuda)])
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where the kernels run: fibers on the CPU always, a GPU with `-m cuda`."""
    if request.param == cuda_on_cpu.GPU:
        yield cuda_on_cpu.GPU
        return
    with cuda_on_cpu.standing_in(tmp_path_factory.mktemp("kernels")):
        yield cuda_on_cpu.FIBERS
