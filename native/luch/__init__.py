"""Luch: a ray tracer that shows what accuracy costs. Importable anywhere; knows no Blender."""

from luch._native import core
from luch.accel import Accel

__version__ = "0.1.0"
__all__ = ["Accel", "__version__", "core"]
