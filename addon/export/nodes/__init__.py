"""Node trees to shader programs: ``compile_material``, ``compile_world``, ``compile_light``.

Blender's own inliner (InlineShaderNodes) flattens groups, reroutes, mutes and zones; then the tree is
walked from its output (tree.py) and each node is emitted by its family (see FAMILIES). To add a node,
write an emitter in its family's file; to add a family, write a file and add its name to FAMILIES.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
from luch import scene
from luch.shader import ProgramBuilder, Vector

from ..displacement import UNDISPLACED_NORMAL
from .tree import Compiler, Context

FAMILIES = ("converters", "inputs", "vectors", "colors", "textures", "closures")
for _family in FAMILIES:
    importlib.import_module(f".{_family}", __name__)

from .inputs import normal  # noqa: E402
from .vectors import bump_normal  # noqa: E402

MOVES = "DISPLACEMENT"  # Material.displacement_method of what moves vertices and is not shown as bump
DISPLACEMENT_FILTER_WIDTH = 0.1  # of the stencil that turns displacement into bump, as in Cycles

__all__ = ["Context", "compile_displacement", "compile_light", "compile_material", "compile_world", "default_material"]

_SAMPLING = {"NONE": "NONE", "AUTO": "AUTO", "FRONT": "FRONT", "BACK": "BACK", "FRONT_BACK": "FRONT_BACK"}


def compile_material(material: bpy.types.Material | None, context: Context) -> scene.Material:
    """Surface program and settings of a material. Without an output node it is black, as in Cycles."""
    if material is None or material.node_tree is None:
        return default_material(material.name if material else "Default")
    owner = f'Material "{material.name}"'
    inlined = bpy.types.InlineShaderNodes.from_material(material)
    compiler = Compiler(inlined.node_tree, owner, context)
    compiler.pass_index = float(material.pass_index)
    compiler.bump_correction = bool(getattr(material, "use_bump_map_correction", True))
    with _deep_trees():
        _emit_displacement(compiler, material)
    _emit_surface(compiler)
    estimate = compiler.builder.emission() or compiler.builder.emission_bound()
    settings = getattr(material, "cycles", None)
    return scene.Material(
        name=material.name,
        surface=compiler.builder.finish(),
        pass_index=material.pass_index,
        emission_sampling=_SAMPLING.get(getattr(settings, "emission_sampling", "AUTO"), "AUTO"),
        transparent_shadows=bool(getattr(material, "use_transparent_shadow", True)),
        emission_estimate=estimate,
    )


def default_material(name: str = "Default") -> scene.Material:
    """What Blender shows where a slot is empty: Principled as it comes, grey of 0.8."""
    builder = ProgramBuilder()
    zero, one = builder.constant(0.0), builder.constant(1.0)
    black, white = (zero, zero, zero), (one, one, one)
    values = builder.constant
    inputs = [
        *builder.vector(0.8, 0.8, 0.8),
        *(zero, values(0.5), values(1.5), zero, *black),  # metallic, roughness, IOR, thin wall, normal
        *(zero, zero, zero, values(0.5), *white),  # diffuse roughness, subsurface (2), specular level and tint
        *(zero, zero, *black, zero),  # anisotropy and its rotation, tangent, transmission
        *(zero, values(0.03), values(1.5), *white, *black),  # coat
        *(zero, values(0.5), *white),  # sheen
        *(*black, one, zero, values(1.33)),  # emission, thin film
    ]
    builder.closure("CLOSURE_PRINCIPLED", white, inputs, (1, 1, 0, 0))
    return scene.Material(name=name, surface=builder.finish())


def compile_world(world: bpy.types.World, context: Context) -> scene.Program:
    """Emission program of a world. The point is a direction."""
    owner = f'World "{world.name}"'
    if world.node_tree is None:
        builder = ProgramBuilder()
        builder.closure("CLOSURE_EMISSION", builder.vector(*world.color))
        return builder.finish()
    inlined = bpy.types.InlineShaderNodes.from_world(world)
    compiler = Compiler(inlined.node_tree, owner, context)
    _emit_surface(compiler)
    return compiler.builder.finish()


def compile_light(light: bpy.types.Light, context: Context) -> scene.Program | None:
    """Emission program of a lamp, times which its colour and power shine; None: it has no nodes."""
    if light.node_tree is None or not light.use_nodes:
        return None
    inlined = bpy.types.InlineShaderNodes.from_light(light)
    compiler = Compiler(inlined.node_tree, f'Light "{light.name}"', context)
    _emit_surface(compiler)
    return compiler.builder.finish()


def _emit_surface(compiler: Compiler) -> None:
    output = compiler.tree.get_output_node("CYCLES")
    if output is None:
        return
    one = compiler.builder.vector(1.0, 1.0, 1.0)
    with _deep_trees():
        compiler.closure(output, "Surface", one)
        _emit_aovs(compiler)


def _emit_aovs(compiler: Compiler) -> None:
    """AOV Output nodes: what the view layer asks for by that name."""
    kinds = {aov.name: aov.type for aov in compiler.context.view_layer.aovs}
    b = compiler.builder
    for node in compiler.tree.nodes:
        if node.bl_idname != "ShaderNodeOutputAOV" or node.aov_name not in kinds:
            continue
        if kinds[node.aov_name] == "COLOR":
            stored = (*compiler.color(node, "Color"), b.constant(1.0))
        else:
            stored = (compiler.float(node, "Value"),) * 4
        b.closure("STORE_AOV", None, stored, (b.aov(node.aov_name),))


def _emit_displacement(compiler: Compiler, material: bpy.types.Material) -> None:
    """Shows displacement as bump: the height is the displacement's component along the normal."""
    output = compiler.tree.get_output_node("CYCLES")
    if output is None or not compiler.is_linked(output, "Displacement") or material.displacement_method == MOVES:
        return
    b = compiler.builder
    plain = normal(compiler)
    base = plain if material.displacement_method == "BUMP" else _undisplaced_normal(compiler)
    compiler.surface_normal = bump_normal(
        compiler,
        lambda: b.op1("VECTOR_DOT_PRODUCT", (*compiler.vector(output, "Displacement"), *plain)),
        strength=b.constant(1.0),
        distance=b.constant(1.0),
        filter_width=DISPLACEMENT_FILTER_WIDTH,
        base=base,
        object_space=False,
    )


def _undisplaced_normal(compiler: Compiler) -> Vector:
    """The normal before the surface was moved, world space, on the side of the ray: the whole relief is bump upon it,
    where a material asks for displacement and bump."""
    b = compiler.builder
    x, y, z, *_ = b.op("ATTRIBUTE_VALUE", (), (0, 0, b.attribute(UNDISPLACED_NORMAL)))
    world = b.op3("VECTOR_TRANSFORM", (x, y, z), (1, 0, 2))
    back = b.op1("POINT_BACKFACING")
    side = b.op1("MATH_MULTIPLY_ADD", (back, b.constant(-2.0), b.constant(1.0)))
    return b.scale(world, side)


def compile_displacement(material: bpy.types.Material | None, context: Context) -> scene.Program | None:
    """How far a surface moves, world space, as emission; None where it stays."""
    if material is None or material.node_tree is None or material.displacement_method == "BUMP":
        return None
    inlined = bpy.types.InlineShaderNodes.from_material(material)
    compiler = Compiler(inlined.node_tree, f'Material "{material.name}"', context)
    output = compiler.tree.get_output_node("CYCLES")
    if output is None or not compiler.is_linked(output, "Displacement"):
        return None
    with _deep_trees():
        compiler.builder.closure("CLOSURE_EMISSION", compiler.vector(output, "Displacement"))
    return compiler.builder.finish()


@contextmanager
def _deep_trees() -> Iterator[None]:
    """Chains of hundreds of nodes are walked recursively."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(max(before, 50_000))
    try:
        yield
    finally:
        sys.setrecursionlimit(before)
