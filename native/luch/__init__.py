"""Luch: a ray tracer that shows what accuracy costs. Importable anywhere; knows no Blender."""

from luch._native import core

__version__ = "0.1.0"
__all__ = ["__version__", "core"]
