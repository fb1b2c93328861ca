"""One case of a seed: what it is, and what must hold of it."""

from __future__ import annotations

import io
import json
import re
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from luch.render import Progress, render
from luch.scene import Scene
from luch.scenefile import HEADER, read_scene, write_scene

from fuzz.mutations import damage, damage_bytes
from fuzz.scenes import random_scene

LONGEST_S = 2.0  # then a render is cancelled; it has CANCEL_S to end
CANCEL_S = 3.0
# A refusal tells what is wrong: one of these, and more than two words.
NAMED = re.compile(
    r"Scene|Mesh|Object|Instance|Material|Image|Light|World|Camera|Film|Settings|Shader program|Volume|Shutter|"
    r"Structure|Precision|Effect|\.luch|zip|file|pass|Hair|Curve", re.IGNORECASE
)  # fmt: skip


class Finding(Exception):
    """What must not happen has happened."""


def run_case(kind: str, seed: int, folder: Path) -> str:
    """ "rendered", "refused" or "cancelled"; raises Finding. folder: for files.

    kinds: "scene" (a random scene), "damaged" (with some fields set to what no exporter would write), "file" (its file
    with bytes flipped), "header" (its file whose header or arrays were damaged, and whose checksums are right), "blender"
    (a file made in Blender, exported by a render of Blender's).
    """
    if kind == "blender":
        return _blender_case(seed)
    rng = np.random.default_rng([seed, 7])
    scene, told = random_scene(seed), ""
    if kind == "damaged":
        told = "; ".join(damage(scene, rng))
    elif kind in ("file", "header"):
        return _file_case(kind, seed, scene, folder, rng)
    return _render_case(scene, told)


def _blender_case(seed: int) -> str:
    import bpy

    import addon
    from addon.engine import capture_scene
    from fuzz.blender import random_file

    if not hasattr(bpy.types.Scene, "luch"):
        addon.register()
    scene = random_file(seed)
    try:
        exported = capture_scene(scene, scene.view_layers[0])
    except RuntimeError as error:
        text = str(error)
        if "Luch: " not in text or text.rstrip().endswith("Error)"):  # of a kind that no sentence was written for
            raise Finding(f"export: {text}") from error
        return "refused"
    return _render_case(exported, "from Blender")


def _file_case(kind: str, seed: int, scene: Scene, folder: Path, rng: np.random.Generator) -> str:
    path = folder / f"{kind}-{seed}.luch"
    write_scene(scene, path)
    data = path.read_bytes()
    path.write_bytes(damage_bytes(data, rng) if kind == "file" else _damage_members(data, rng))
    try:
        try:
            scene = read_scene(path)
        except ValueError as error:
            return _refusal(error, "")
        except Exception as error:
            raise Finding(f"reading: {type(error).__name__}: {error}") from error
        return _render_case(scene, "as read")
    finally:
        path.unlink()


def _damage_members(data: bytes, rng: np.random.Generator) -> bytes:
    """The same archive with one member damaged before it is packed."""
    result = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(result, "w", zipfile.ZIP_DEFLATED) as new:
        names = old.namelist()
        chosen = HEADER if rng.random() < 0.5 else names[int(rng.integers(len(names)))]
        for name in names:
            content = old.read(name)
            if name == chosen:
                content = _damage_header(content, rng) if name == HEADER else damage_bytes(content, rng)
            new.writestr(name, content)
    return result.getvalue()


def _damage_header(content: bytes, rng: np.random.Generator) -> bytes:
    """A value of the JSON replaced by another kind of value, or its text damaged."""
    if rng.random() < 0.3:
        return damage_bytes(content, rng)
    header = json.loads(content)
    owner, key = header, "scene"
    while isinstance(owner[key], dict | list) and owner[key] and rng.random() < 0.93:
        owner = owner[key]
        keys: list[Any] = list(owner) if isinstance(owner, dict) else list(range(len(owner)))
        key = keys[int(rng.integers(len(keys)))]
    values = (None, True, -1, 0, 2**32, 1e300, float("nan"), "", "x", [], {}, [1, 2, 3], {"array": "arrays/0.npy"})
    owner[key] = values[int(rng.integers(len(values)))]
    return json.dumps(header).encode()


def _refusal(error: ValueError, told: str) -> str:
    text = str(error)
    if not NAMED.search(text) or len(text.split()) < 3:
        raise Finding(f"a refusal that names nothing: {text!r} ({told})")
    return "refused"


def _render_case(scene: Scene, told: str) -> str:
    ends = time.monotonic() + LONGEST_S
    scene.settings.samples = min(scene.settings.samples, 4)
    if scene.film.width * scene.film.height > 64 * 64:  # honest, but not what is looked for here
        return "refused"

    def goes_on(progress: Progress) -> bool:
        return time.monotonic() < ends

    try:
        result = render(scene, progress=goes_on)
    except ValueError as error:
        return _refusal(error, told)
    except Exception as error:
        raise Finding(f"{type(error).__name__}: {error} ({told})") from error
    if time.monotonic() > ends + CANCEL_S:
        raise Finding(f"took {time.monotonic() - ends + LONGEST_S:.1f} s, though cancelled after {LONGEST_S} ({told})")
    for name, image in result.passes.items():
        if image.shape[:2] != scene.film.size[::-1]:
            raise Finding(f"pass {name} has the shape {image.shape} ({told})")
        if not np.isfinite(image).all():
            raise Finding(f"pass {name} is not finite ({told})")
    return "cancelled" if result.cancelled else "rendered"
