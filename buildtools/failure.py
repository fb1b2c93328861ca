"""The one exception that build.py shows as a sentence instead of a traceback."""

from __future__ import annotations


class BuildFailure(Exception):
    """What failed, why, and what to do about it, in one sentence."""
