"""Volumes, which Luch does not draw yet: named, and drawn as the nothing that they are in thin air."""

from __future__ import annotations

from typing import Any

from luch.scene import Program
from luch.shader import ProgramBuilder

from .context import ExportContext


def warn_about_volume(kind: str, owner: Any, context: ExportContext) -> None:
    """Say that a material's or world's volume is missing. kind: "Material" or "World"."""
    if _is_linked(owner, "Volume"):
        context.warn(
            f'{kind} "{owner.name}" has a volume, which Luch does not draw yet: light passes it unchanged.', "volumes"
        )


def is_only_volume(material: Any) -> bool:
    """True if nothing is at the surface: light enters as if it were not there."""
    return material is not None and _is_linked(material, "Volume") and not _is_linked(material, "Surface")


def clear_surface() -> Program:
    """A surface that lets all light pass straight on."""
    builder = ProgramBuilder()
    builder.closure("CLOSURE_TRANSPARENT", builder.vector(1.0, 1.0, 1.0))
    return builder.finish()


def _is_linked(owner: Any, socket: str) -> bool:
    tree = owner.node_tree
    output = tree.get_output_node("CYCLES") if tree is not None else None
    return output is not None and output.inputs[socket].is_linked
