"""The door: whether the parts of a scene fit together, before anything reads them.

Whatever wrote a scene (an exporter, a script, a damaged file), an index that names nothing or a count without bound
ends here, as a ValueError that names its owner; shapes of arrays are checked where the core reads them. Numbers that
are not finite pass: the builders leave such geometry out and count it, and lamps and shaders bear them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from luch.effects.programs import TILED, decode
from luch.scene import Film, Instances, Object, Program, Scene, Settings
from luch.shader_code import ATTRIBUTE_UV, Node

MOST_THREADS = 1024
MOST_BOUNCES = 1 << 24  # beyond what any path lives; limits are counted in 32 bits, one more than asked for
WIDEST_WORLD_MAP = 1 << 14  # 8,192 is the most that Blender offers; memory grows with the square
MOST_CRYPTOMATTE = 64
LARGEST_PIXEL_ASPECT = 1e6
MOST_SAMPLES = 1 << 31
FLOAT32_MAX = float(np.finfo(np.float32).max)
# Of all meshes together. A structure counts primitives in 30 bits, views count rows and numbers in 32.
_MOST = {"primitives": (1 << 30) - 1, "vertices": (1 << 32) // 3, "numbers of attributes": (1 << 32) - 1}
_SKY_ROWS, _SKY_COLUMNS = 256, 256  # SkyAtmosphere of shade/textures/sky.h: half the circle
_AGAIN = "Export the scene again."

# Operations that read a table whose size is known: numbers from its offset on.
_TABLE_SIZES = {
    "BLACKBODY": 512 * 3,
    "WAVELENGTH": 81 * 3,
    "SKY_PREETHAM": 20,
    "SKY_ATMOSPHERE": 14 + _SKY_ROWS * _SKY_COLUMNS * 3,
}
# Operations that name an attribute: which of their static words does.
_ATTRIBUTE_WORDS = {"ATTRIBUTE_VALUE": 2, "ATTRIBUTE_COLOR": 2, "ATTRIBUTE_OBJECT": 0, "TANGENT_UV": 2, "NORMAL_MAP": 2}

# Closures that choose (SubsurfaceMethod, HairColor): which static word says what, and how many there are.
_CHOICES = {
    "CLOSURE_SUBSURFACE": (1, 4),
    "CLOSURE_PRINCIPLED_SUBSURFACE": (4, 4),
    "CLOSURE_PRINCIPLED_HAIR": (1, 3),
}


def check_scene(scene: Scene) -> None:
    """Raises ValueError, with one sentence that names the owner, for a scene whose parts do not fit together."""
    _check_film(scene.film)
    _check_settings(scene.settings)
    _check_sizes(scene)
    for material in scene.materials:
        _check_program(f'Material "{material.name}"', material.surface, scene)
    for light in scene.lights:
        if light.program is not None:
            _check_program(f'Light "{light.name}"', light.program, scene)
    if scene.world is not None:
        _check_program(f'World "{scene.world.name}"', scene.world.program, scene)
        if not 0 <= scene.world.map_resolution <= WIDEST_WORLD_MAP:
            raise ValueError(
                f'World "{scene.world.name}": its map resolution is {scene.world.map_resolution}.'
                f" Choose one up to {WIDEST_WORLD_MAP}."
            )
    for item in scene.objects:
        _check_object(item, len(scene.meshes), len(scene.materials))
    if scene.instances is not None:
        _check_instances(scene.instances, len(scene.objects))


def _check_film(film: Film) -> None:
    if film.border is not None:
        x0, y0, x1, y1 = film.border
        if not (0 <= x0 < x1 <= film.width and 0 <= y0 < y1 <= film.height):
            raise ValueError(f"Film: the border {film.border} does not lie in a frame of {film.width} x {film.height}.")
    for name, value in (("exposure", film.exposure), ("filter width", film.filter_width)):
        if not abs(value) <= FLOAT32_MAX:  # NaN is not
            raise ValueError(f"Film: its {name} is {value}. Give it a finite one.")
    if not 0 <= film.cryptomatte_depth <= MOST_CRYPTOMATTE:
        raise ValueError(f"Film: its Cryptomatte depth is {film.cryptomatte_depth}. Choose one up to 16.")
    if not all(0.0 < side <= LARGEST_PIXEL_ASPECT for side in film.pixel_aspect):
        raise ValueError(f"Film: its pixel aspect is {film.pixel_aspect}. Give it sides above 0.")


def _check_settings(settings: Settings) -> None:
    bounces = [name for name in vars(settings) if name.endswith("_bounces")]
    limits = {"threads": MOST_THREADS, "first_sample": MOST_SAMPLES, "samples": MOST_SAMPLES}
    for name, most in (*limits.items(), *((name, MOST_BOUNCES) for name in bounces)):
        value = getattr(settings, name)
        if not 0 <= value <= most:
            raise ValueError(f"Settings: {name} is {value}. Choose a number up to {most}.")


def _check_sizes(scene: Scene) -> None:
    """The core counts in 32 bits: what is more would wrap around. Nothing is read here but the shapes of arrays."""
    totals = dict.fromkeys(("primitives", "vertices", "numbers of attributes"), 0)
    for mesh in scene.meshes:
        primitives = len(mesh.triangles) + (0 if mesh.spheres is None else len(mesh.spheres))
        primitives += 0 if mesh.curves is None else len(mesh.curves.points)  # at least
        keys = 1 if mesh.motion_positions is None else len(mesh.motion_positions) + 1
        sizes = primitives, keys * len(mesh.positions), sum(a.data.size for a in mesh.attributes.values())
        for (what, most), count in zip(_MOST.items(), sizes, strict=True):
            totals[what] += count
            if totals[what] > most:
                raise ValueError(
                    f'Mesh "{mesh.name}": with it the scene has {totals[what]} {what}, more than the {most} that Luch'
                    " can count. Simplify the scene, or share meshes between instances."
                )


def _check_object(item: Object, meshes: int, materials: int) -> None:
    if not 0 <= item.mesh < meshes:
        raise ValueError(f'Object "{item.name}" shows mesh {item.mesh} of {meshes}. {_AGAIN}')
    if not item.materials:
        raise ValueError(f'Object "{item.name}" has no material, not even the default one. {_AGAIN}')
    if min(item.materials) < 0 or max(item.materials) >= materials:
        raise ValueError(f'Object "{item.name}" shows materials {item.materials} of {materials}. {_AGAIN}')


def _check_instances(instances: Instances, objects: int) -> None:
    rows = instances.object
    if rows.ndim != 1:
        raise ValueError(f"Instances: their objects have the shape {rows.shape}, not (N,). {_AGAIN}")
    if len(rows) and int(rows.max()) >= objects:
        raise ValueError(f"Instances: one shows object {int(rows.max())} of {objects}. {_AGAIN}")
    if instances.motion is not None and len(instances.motion.instance):
        last = int(instances.motion.instance.max())
        if last >= len(rows):
            raise ValueError(f"Instances: number {last} of {len(rows)} is said to move. {_AGAIN}")


def _check_program(owner: str, program: Program, scene: Scene) -> None:
    """Every word of it names something that is there."""
    arrays: Sequence[tuple[str, Any]] = (
        ("code", program.code), ("constants", program.constants), ("tables", program.tables),
    )  # fmt: skip
    for name, array in arrays:
        if array.ndim != 1:
            raise ValueError(f"{owner}: the {name} of its shader program have the shape {array.shape}. {_AGAIN}")
    # A register is written by a constant or an operation, so there cannot be more of them.
    if not 0 <= program.register_count <= len(program.constants) + len(program.code):
        raise ValueError(f"{owner}: its shader program asks for {program.register_count} registers. {_AGAIN}")
    for index in program.images:
        if not 0 <= index < len(scene.images):
            raise ValueError(f"{owner}: its shader program shows image {index} of {len(scene.images)}. {_AGAIN}")
    try:
        nodes, _ = decode(program)
    except ValueError as error:
        raise ValueError(f"{owner}: {error}. {_AGAIN}") from error
    for node in nodes:
        fact = _fault_of(node, program)
        if fact:
            raise ValueError(f"{owner}: operation {node.op.name} of its shader program {fact}. {_AGAIN}")


def _fault_of(node: Node, program: Program) -> str:
    """What is wrong with an operation's static words; empty: nothing."""
    name, words = node.op.name, node.params
    if len(words) < node.op.params:
        return f"has {len(words)} static words, not {node.op.params}"
    if name in ("IMAGE", "IMAGE_BOX", "ENVIRONMENT"):
        return _fault_of_images(name, words, len(program.images))
    if name in _ATTRIBUTE_WORDS:
        slot, count = words[_ATTRIBUTE_WORDS[name]], len(program.attributes)
        unread = name == "NORMAL_MAP" and words[0] != 0  # only those in tangent space read one
        return "" if slot >= ATTRIBUTE_UV or slot < count or unread else f"reads attribute {slot} of {count}"
    if name == "LIGHT_PATH_KIND_DEPTH":  # which byte of a path's depths
        return "" if words[0] <= 24 else f"shifts by {words[0]} bits"
    if name in _CHOICES:
        at, count = _CHOICES[name]
        return "" if words[at] < count else f"is of kind {words[at]}, of {count}"
    if name == "STORE_AOV":
        return "" if words[0] < len(program.aovs) else f"stores AOV {words[0]} of {len(program.aovs)}"
    size = _table_size(name, words, program)
    if size is not None and not 0 <= size <= len(program.tables) - words[0]:
        return f"reads {size} numbers from {words[0]} on of a table of {len(program.tables)}"
    return ""


def _fault_of_images(name: str, words: tuple[int, ...], count: int) -> str:
    slots = [words[0]]
    if name == "IMAGE" and words[4] & TILED:
        if 5 + 2 * words[0] > len(words):
            return f"has {words[0]} tiles in {len(words)} static words"
        slots = [words[6 + 2 * k] for k in range(words[0])]
    missing = [slot for slot in slots if slot >= count]
    return f"shows image {missing[0]} of {count}" if missing else ""


def _table_size(name: str, words: tuple[int, ...], program: Program) -> int | None:
    """How many numbers of its table an operation may read; None: it reads none. -1: what it says is nonsense."""
    if name == "COLOR_RAMP":
        return 4 * words[1] if words[1] > 1 else -1
    if name == "CURVE":
        return words[1] * words[2] if words[1] > 1 and words[3] < words[2] else -1
    if name == "IES":
        head = program.tables[words[0] : words[0] + 2]
        if len(head) < 2 or not bool(np.isfinite(head).all()) or float(head.min()) < 1.0:
            return -1
        rows, columns = int(head[0]), int(head[1])
        return 2 + rows + columns + rows * columns
    return _TABLE_SIZES.get(name)
