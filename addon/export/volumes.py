"""Materials that are volumes alone, and volumes that Luch does not draw yet."""

from __future__ import annotations

from typing import Any

from luch.scene import Program
from luch.shader import ProgramBuilder

from .context import ExportContext
from .nodes.media import UNEVEN


def warn_about_smoke(subject: Any, context: ExportContext) -> None:
    """Say that an object's simulated smoke or fire is drawn as an even medium."""
    for modifier in subject.modifiers:
        domain = getattr(modifier, "domain_settings", None) if modifier.type == "FLUID" else None
        if domain is not None and domain.domain_type == "GAS":
            context.warn(
                f'Object "{subject.name}" holds smoke, whose grid Luch cannot read yet: '
                "its volume fills the whole domain evenly.",
                UNEVEN,
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
    return output is not None and socket in output.inputs and output.inputs[socket].is_linked
