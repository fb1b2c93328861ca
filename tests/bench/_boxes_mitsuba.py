"""Mitsuba's pictures of the boxes: started by boxes.py, in a process of its own, answers one JSON line for each asked.

First line out: {"version", "variant", "why"}; why: the reason if it is not the fast variant. Asked: {"box", "size",
"bounces", "sampler", "samples", "seed", "output"}; answered: {"cpu_s"}, the picture as .npy. Argument: threads.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support.plain_boxes import BOXES, Box, Surface, Thing

FAST, SLOW = "llvm_ad_rgb", "scalar_rgb"


def choose_variant(threads: int) -> str | None:
    """The reason where it is the slow one."""
    import drjit

    try:
        mi.set_variant(FAST)
        drjit.eval(drjit.arange(mi.Float, 4) + 1.0)
        drjit.set_thread_count(threads)
    except (ImportError, RuntimeError) as error:
        mi.set_variant(SLOW)
        return f"{FAST} does not start ({str(error).splitlines()[0]})"
    return None


def bsdf(surface: Surface) -> dict[str, Any]:
    """Two-sided, as in Blender."""
    colour = {"type": "rgb", "value": list(surface.colour)}
    if surface.kind == "glass":
        return {"type": "dielectric", "int_ior": surface.ior, "ext_ior": 1.0}
    if surface.kind == "metal":
        inner = {"type": "roughconductor", "material": "none", "distribution": "ggx",
                 "alpha": surface.roughness**2, "specular_reflectance": colour}  # fmt: skip
    else:
        inner = {"type": "diffuse", "reflectance": colour}
    return {"type": "twosided", "bsdf": inner}


def mesh(thing: Thing) -> Any:
    vertices, triangles = np.array(thing.vertices, np.float32), np.array(thing.triangles(), np.uint32)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf(thing.surface))
    properties["face_normals"] = not thing.smooth
    shape = mi.Mesh(thing.name, len(vertices), len(triangles), properties, has_vertex_normals=thing.smooth)
    values = mi.traverse(shape)
    values["vertex_positions"], values["faces"] = vertices.ravel(), triangles.ravel()
    if thing.smooth:
        normals = vertices - np.array(thing.middle, np.float32)
        values["vertex_normals"] = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).ravel()
    values.update()
    return shape


def scene_of(box: Box) -> Any:
    """What is in the box, and its lamp."""
    lamp, frame = box.lamp, mi.ScalarTransform4f()
    x, y, z = lamp.middle
    return mi.load_dict({
        "type": "scene",
        **{thing.name: mesh(thing) for thing in box.things},
        "lamp": {
            "type": "rectangle",
            "to_world": frame.look_at(origin=[x, y, z], target=[x, y, z - 1.0], up=[0, 1, 0]).scale(lamp.side / 2.0),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": lamp.radiance}},
        },
    })  # fmt: skip


def eye_of(box: Box, size: int, sampler: str) -> Any:
    at, frame = box.eye.at, mi.ScalarTransform4f()
    return mi.load_dict({
        "type": "perspective", "fov": box.eye.angle_deg, "fov_axis": "x",
        "to_world": frame.look_at(origin=list(at), target=[at[0], at[1] + 1.0, at[2]], up=[0, 0, 1]),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        "sampler": {"type": sampler},
    })  # fmt: skip


def answer(asked: dict[str, Any], scene: Any) -> dict[str, float]:
    """CPU seconds of all threads, from the call to the picture as an array. Raises ValueError for a number of samples
    that the sampler would change."""
    eye = eye_of(BOXES[asked["box"]], asked["size"], asked["sampler"])
    eye.sampler().set_sample_count(asked["samples"])
    if eye.sampler().sample_count() != asked["samples"]:
        raise ValueError(f"{asked['sampler']} takes {eye.sampler().sample_count()} samples for {asked['samples']}")
    # A depth counts the path's edges: the one from the eye and the one to the lamp are no bounces.
    integrator = mi.load_dict({"type": "path", "max_depth": asked["bounces"] + 2})
    began = time.process_time()
    pixels = np.array(integrator.render(scene, sensor=eye, seed=asked["seed"], spp=asked["samples"]))
    spent = time.process_time() - began
    np.save(asked["output"], pixels[..., :3])
    return {"cpu_s": spent}


def main() -> None:
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what Mitsuba logs is no answer
    why = choose_variant(int(sys.argv[1]))
    print(json.dumps({"version": mi.__version__, "variant": mi.variant(), "why": why}), file=answers, flush=True)
    scenes: dict[str, Any] = {}
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["box"] not in scenes:
            scenes[asked["box"]] = scene_of(BOXES[asked["box"]])
        print(json.dumps(answer(asked, scenes[asked["box"]])), file=answers, flush=True)


if __name__ == "__main__":
    main()
