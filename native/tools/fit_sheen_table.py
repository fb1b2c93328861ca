"""Fits the microfibre sheen's linearly transformed cosine and writes luch/bsdf/sheen_table.h.

Run by hand: python native/tools/fit_sheen_table.py

The lobe towards w is z A^2 / (pi ((A x + B z)^2 + A^2 y^2 + z^2)^2) in a frame whose x axis points to
the viewer. What users expect of it is what Blender draws; so we look at that: faces whose closure
normal is tilted by known angles are lit by one sun after another and seen by an orthographic
camera. The square root of what is seen is linear in A, B and (1 + B^2) / A, which least squares
finds; the colour pass gives the albedo.
"""

from pathlib import Path

import bpy
import numpy as np

OUT = Path(__file__).parents[1] / "include" / "luch" / "bsdf" / "sheen_table.h"
SIZE = 32
MIN_ROUGHNESS = 1e-3  # smoother fibres are drawn as this
SUNS = [(20.0, 0.0), (45.0, 0.0), (70.0, 0.0), (30.0, 60.0), (50.0, 35.0), (65.0, 75.0), (80.0, 20.0)]  # degrees


def build_faces(normals: np.ndarray, roughness: np.ndarray) -> bpy.types.Object:
    """One unit square per table entry, with its normal and roughness as face attributes."""
    i = np.arange(SIZE * SIZE)
    x, y = (i % SIZE).astype(float), (i // SIZE).astype(float)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    vertices = np.zeros((SIZE * SIZE, 4, 3))
    vertices[:, :, 0], vertices[:, :, 1] = x[:, None] + corners[:, 0], y[:, None] + corners[:, 1]
    mesh = bpy.data.meshes.new("faces")
    mesh.from_pydata(vertices.reshape(-1, 3).tolist(), [], np.arange(4 * SIZE * SIZE).reshape(-1, 4).tolist())
    mesh.attributes.new("tilt", "FLOAT_VECTOR", "FACE").data.foreach_set("vector", normals.astype(np.float32).ravel())
    mesh.attributes.new("rough", "FLOAT", "FACE").data.foreach_set("value", roughness.astype(np.float32))
    obj = bpy.data.objects.new("faces", mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def build_material(sheen: bool) -> bpy.types.Material:
    material = bpy.data.materials.new("sheen" if sheen else "reference")
    material.use_nodes = True
    material.cycles.use_bump_map_correction = False
    tree = material.node_tree
    tree.nodes.clear()
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    closure = tree.nodes.new("ShaderNodeBsdfSheen" if sheen else "ShaderNodeBsdfDiffuse")
    closure.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    if sheen:
        for name, socket, output in (("tilt", "Normal", "Vector"), ("rough", "Roughness", "Fac")):
            attribute = tree.nodes.new("ShaderNodeAttribute")
            attribute.attribute_name = name
            tree.links.new(attribute.outputs[output], closure.inputs[socket])
    tree.links.new(closure.outputs[0], out.inputs[0])
    return material


def render(layer_pass: str) -> np.ndarray:
    """The named pass, (SIZE * SIZE,), first channel, face order."""
    scene = bpy.context.scene
    path = "/tmp/luch_sheen.exr"
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    import OpenImageIO as oiio

    for part in range(oiio.ImageBuf(path).nsubimages):
        image = oiio.ImageBuf(path, part, 0)
        for channel, name in enumerate(image.spec().channelnames):
            if name.endswith(f"{layer_pass}.R"):
                return image.get_pixels(oiio.FLOAT)[::-1, :, channel].astype(float).ravel()
    raise KeyError(f"the render has no pass {layer_pass}")


def set_up_scene() -> bpy.types.Object:
    """Orthographic camera over the faces, no world, one sample; returns the sun."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 1, False, 0
    scene.cycles.light_sampling_threshold = 0.0
    scene.cycles.use_adaptive_sampling, scene.cycles.pixel_filter_type = False, "BOX"
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.view_layers[0].use_pass_diffuse_color = True
    scene.view_layers[0].update_render_passes()
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", SIZE
    eye = bpy.data.objects.new("camera", camera)
    eye.location = (SIZE / 2, SIZE / 2, 10.0)
    scene.collection.objects.link(eye)
    scene.camera = eye
    light = bpy.data.lights.new("sun", "SUN")
    light.angle, light.energy = 0.0, 1.0
    sun = bpy.data.objects.new("sun", light)
    sun.rotation_mode = "QUATERNION"
    scene.collection.objects.link(sun)
    return sun


def main() -> None:
    from mathutils import Vector

    sun = set_up_scene()
    cos = np.tile(np.linspace(0.0, 1.0, SIZE), SIZE)
    rough = np.repeat(np.linspace(0.0, 1.0, SIZE), SIZE)
    sin = np.sqrt(1.0 - cos**2)
    normals = np.stack([sin, np.zeros_like(sin), cos], axis=1)
    faces = build_faces(normals, rough)
    viewer = np.array([0.0, 0.0, 1.0])
    b = np.array([0.0, -1.0, 0.0])  # normal x viewer, made unit, for every tilt
    t = np.cross(b, normals)
    rows, seen = [], []
    sheen, reference = build_material(True), build_material(False)
    albedo = None
    for elevation, azimuth in SUNS:
        a, f = np.radians(elevation), np.radians(azimuth)
        w = np.array([np.sin(a) * np.cos(f), np.sin(a) * np.sin(f), np.cos(a)])
        sun.rotation_quaternion = Vector(w).to_track_quat("Z", "Y")
        faces.data.materials.clear()
        faces.data.materials.append(reference)
        irradiance = np.pi * render("Combined") / (w @ viewer)
        faces.data.materials.clear()
        faces.data.materials.append(sheen)
        light = render("Combined") / irradiance
        if albedo is None:
            albedo = render("Diffuse Color")
        x, y, z = t @ w, np.full(SIZE * SIZE, b @ w), normals @ w
        with np.errstate(divide="ignore", invalid="ignore"):
            rows.append(np.stack([x * x + y * y, 2.0 * x * z, z * z], axis=1))
            seen.append(1.0 / np.sqrt(np.pi * light / (albedo * z)))
    matrix, right = np.stack(rows, axis=1), np.stack(seen, axis=1)
    table = np.zeros((3, SIZE * SIZE))
    worst = 0.0
    for i in range(SIZE * SIZE):
        valid = np.isfinite(right[i])
        if albedo[i] < 1e-5 or valid.sum() < 3:
            continue
        solution, *_ = np.linalg.lstsq(matrix[i][valid], right[i][valid], rcond=None)
        A, B, third = solution
        table[:, i] = A, B, albedo[i]
        if albedo[i] > 1e-3:  # below, five decimals of the albedo limit what is seen
            worst = max(worst, abs((1.0 + B * B) / (A * third) - 1.0))
    print(f"entries fitted: {np.count_nonzero(table[2])}, worst inconsistency of the three unknowns: {worst:.2e}")
    table = table.reshape(3, SIZE, SIZE)
    share = MIN_ROUGHNESS * (SIZE - 1)  # the first row was seen a little way towards the second
    table[:, 0] = (table[:, 0] - share * table[:, 1]) / (1.0 - share)
    table[:, 0] *= (table[0, 0] > 1e-5) & (table[2, 0] > 1e-5)
    parts = []
    for name, values in zip(("SHEEN_A", "SHEEN_B", "SHEEN_ALBEDO"), table, strict=True):
        words = [f"{v:.6g}" for v in values.ravel()]
        words = [(v if any(c in v for c in ".e") else v + ".0") + "f" for v in words]
        lines = ",\n    ".join(", ".join(words[i : i + 10]) for i in range(0, len(words), 10))
        parts.append(f"LUCH_CONST float {name}[{len(words)}] = {{\n    {lines}}};\n")
    OUT.write_text(
        "// Microfibre sheen, [roughness][cosine]. Written by native/tools/fit_sheen_table.py; do not edit.\n"
        '#pragma once\n#include "luch/platform.h"\n\nnamespace luch {\n\n'
        f"inline constexpr int SHEEN_TABLE_SIZE = {SIZE};\n// clang-format off\n"
        + "\n".join(parts)
        + "// clang-format on\n\n}  // namespace luch\n"
    )


if __name__ == "__main__":
    main()
