"""A short run of the fuzzer: its own seeds, so that a failure can be repeated. `build.py fuzz` runs it longer."""

from __future__ import annotations

import pytest
from fuzz.runner import KINDS, fuzz

SEEDS = 600
FIRST_SEED = 20_000
LONGEST_S = 30.0  # of each core that CI tests: with a sanitizer, plain, and the fastest; then fewer seeds must do
FEWEST_CASES = 24


@pytest.mark.promise(24)
def test_random_scenes_and_damaged_files_render_finite_or_are_refused_by_name() -> None:
    summary = fuzz(LONGEST_S, FIRST_SEED, SEEDS)
    assert summary.findings == []
    assert summary.cases >= FEWEST_CASES
    assert set(summary.outcomes) >= {"rendered", "refused"}, "both must be met, else nothing was tried"
    if summary.next_seed == FIRST_SEED + SEEDS:
        assert summary.cases == SEEDS * len(KINDS)
