"""The demo: a reading corner in morning light. Glass, metal, wood, cloth; sun, sky, area, spot, point, glowing globes.

`build()` makes it in the running bpy. `python tests/scenes/demo.py OUT.blend` saves it (in .venv, with tests/ on the path).
"""

from __future__ import annotations

import math
import sys

import bpy
from mathutils import Vector

from scenes import materials as look
from scenes import modelling as make

WIDTH, HEIGHT = 960, 540
ROOM_X, ROOM_Y, ROOM_Z = (-2.6, 3.0), (-5.2, 2.6), 2.9  # inner faces, metres
WINDOW_Y, WINDOW_Z = (-0.9, 1.9), (0.55, 2.45)


def build() -> bpy.types.Scene:
    """A fresh file with only the demo in it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.name = "Luch demo"
    walls()
    window()
    sideboard()
    still_life()
    mirror()
    armchair()
    table()
    pendants()
    floor_lamp()
    daylight(scene)
    camera(scene)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    return scene


def walls() -> None:
    pale, deep = look.plaster("Warm white", (0.72, 0.68, 0.61)), look.plaster("Lagoon", (0.075, 0.15, 0.165))
    x0, x1 = ROOM_X
    y0, y1 = ROOM_Y
    middle_x, middle_y, width, depth, thick = (x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0, 0.2
    make.box("Floor", (width + 0.4, depth + 0.4, thick), (middle_x, middle_y, -thick / 2), look.parquet())
    make.box("Ceiling", (width + 0.4, depth + 0.4, thick), (middle_x, middle_y, ROOM_Z + thick / 2), pale)
    make.box("Back wall", (width + 0.4, thick, ROOM_Z), (middle_x, y1 + thick / 2, ROOM_Z / 2), deep)
    make.box("Right wall", (thick, depth, ROOM_Z), (x1 + thick / 2, middle_y, ROOM_Z / 2), pale)
    make.box("Behind", (width + 0.4, thick, ROOM_Z), (middle_x, y0 - thick / 2, ROOM_Z / 2), pale)
    # The left wall, around the window.
    wy0, wy1 = WINDOW_Y
    wz0, wz1 = WINDOW_Z
    x = x0 - thick / 2
    make.box("Left wall, near", (thick, wy0 - y0, ROOM_Z), (x, (wy0 + y0) / 2, ROOM_Z / 2), pale)
    make.box("Left wall, far", (thick, y1 - wy1, ROOM_Z), (x, (y1 + wy1) / 2, ROOM_Z / 2), pale)
    make.box("Left wall, under", (thick, wy1 - wy0, wz0), (x, 0.5 * (wy0 + wy1), wz0 / 2), pale)
    make.box("Left wall, over", (thick, wy1 - wy0, ROOM_Z - wz1), (x, 0.5 * (wy0 + wy1), (ROOM_Z + wz1) / 2), pale)
    trim = look.material("Trim", Base_Color=(0.8, 0.78, 0.73), Roughness=0.35)
    make.box("Skirting, back", (width, 0.025, 0.12), (middle_x, y1 - 0.012, 0.06), trim, round_by=0.006)
    make.box("Skirting, right", (0.025, depth, 0.12), (x1 - 0.012, middle_y, 0.06), trim, round_by=0.006)


def window() -> None:
    paint = look.material("Window paint", Base_Color=(0.82, 0.81, 0.78), Roughness=0.3)
    (y0, y1), (z0, z1) = WINDOW_Y, WINDOW_Z
    x = ROOM_X[0] - 0.12
    for index in range(4):  # stiles
        y = y0 + (y1 - y0) * index / 3
        make.box("Stile", (0.06, 0.055, z1 - z0), (x, y, (z0 + z1) / 2), paint, round_by=0.008)
    for z in (z0 + 0.025, z0 + 0.64 * (z1 - z0), z1 - 0.025):  # rails
        make.box("Rail", (0.055, y1 - y0, 0.05), (x, (y0 + y1) / 2, z), paint, round_by=0.008)
    make.box("Sill", (0.34, y1 - y0 + 0.16, 0.04), (ROOM_X[0] + 0.03, (y0 + y1) / 2, z0 - 0.015), paint, round_by=0.012)


def sideboard() -> None:
    wood, brass = look.walnut(), look.metal("Brass", (0.88, 0.62, 0.28), 0.22)
    make.box("Sideboard", (2.3, 0.46, 0.5), (0.1, 2.3, 0.47), wood, round_by=0.012)
    for index in range(3):
        x = 0.1 + (index - 1) * 0.755
        make.box("Door", (0.73, 0.02, 0.44), (x, 2.065, 0.47), wood, round_by=0.006)
        make.cylinder("Knob", 0.016, 0.03, (x + 0.28, 2.055, 0.47), brass, turn=(90, 0, 0))
    for x in (-0.92, 1.12):
        for y in (2.14, 2.46):
            make.cylinder("Foot", 0.018, 0.22, (x, y, 0.0), brass)


def still_life() -> None:
    """On the sideboard: Suzanne in bronze on books, a vase with twigs, a glass ball, a ribbed bowl."""
    top = 0.72
    covers = [(0.45, 0.09, 0.06), (0.72, 0.62, 0.42), (0.07, 0.13, 0.2)]
    height = top
    for index, color in enumerate(covers):
        thick = (0.036, 0.028, 0.04)[index]
        size = (0.34 - 0.025 * index, 0.25 - 0.02 * index, thick)
        cloth = look.material(f"Book {index}", Base_Color=color, Roughness=0.6)
        make.box("Book", size, (0.52, 2.3, height + thick / 2), cloth, round_by=0.004, turn=(0, 0, 7 - 9 * index))
        height += thick
    bronze = look.metal("Rose gold", (0.93, 0.52, 0.36), 0.16)
    make.monkey("Suzanne", 0.2, (0.52, 2.3, height + 0.19), bronze, turn=(-4, 0, 12))

    body = make.spline([(0.055, 0.0), (0.1, 0.05), (0.13, 0.16), (0.1, 0.28), (0.045, 0.36), (0.05, 0.41)])
    inner = [(radius - 0.008, z) for radius, z in reversed(body) if z > 0.02]
    profile = [(0.0, 0.0), *body, *inner, (0.0, 0.02)]
    make.lathe("Vase", profile, (-0.62, 2.3, top), look.glaze("Celadon", (0.42, 0.53, 0.47)))
    twig = look.material("Twig", Base_Color=(0.13, 0.075, 0.045), Roughness=0.7)
    berry = look.material("Berry", Base_Color=(0.55, 0.05, 0.03), Roughness=0.25, Coat_Weight=0.6)
    for index in range(7):
        angle, reach = 2.4 * index, 0.16 + 0.05 * (index % 3)
        points = [
            (
                -0.62 + reach * t * t * math.cos(angle) + 0.02 * math.sin(5 * t + index),
                2.3 + 0.5 * reach * t * t * math.sin(angle),
                top + 0.06 + (0.72 + 0.07 * (index % 4)) * t,
            )
            for t in (step / 10 for step in range(11))
        ]
        make.tube("Twig", points, 0.0045, twig)
        for step in range(4, 11):
            x, y, z = points[step]
            side = 0.016 * (-1) ** step
            make.ball("Berry", 0.0105, (x + side, y - 0.01, z + 0.012), berry)

    make.ball("Crystal ball", 0.105, (-0.13, 2.24, top + 0.127), look.glass("Crystal", ior=1.52))
    make.ring("Stand", 0.06, 0.012, (-0.13, 2.24, top + 0.03), look.metal("Dark steel", (0.3, 0.3, 0.32), 0.3))
    bowl = make.spline([(0.05, 0.0), (0.11, 0.025), (0.155, 0.085), (0.17, 0.13)])
    inner = [(radius - 0.007, z + 0.004) for radius, z in reversed(bowl)]
    make.lathe(
        "Bowl", [(0, 0), *bowl, *inner, (0, 0.006)], (1.0, 2.27, top), look.metal("Copper", (0.95, 0.6, 0.46), 0.3)
    )


def mirror() -> None:
    """Convex, as a butler's mirror: it shows the whole room."""
    silver = look.metal("Mirror", (0.94, 0.95, 0.95), 0.0)
    radius, bulge = 0.56, 0.07
    sphere = (radius**2 + bulge**2) / (2 * bulge)
    edge = math.asin(radius / sphere)
    angles = [edge * (1 - step / 16) for step in range(17)]
    cap = [(sphere * math.sin(a) if a > 1e-9 else 0.0, sphere * (math.cos(a) - math.cos(edge))) for a in angles]
    make.lathe("Mirror", cap, (0.12, 2.585, 1.72), silver, steps=96, turn=(90, 0, 0))
    frame = look.metal("Frame brass", (0.9, 0.64, 0.3), 0.18, Anisotropic=0.3)
    make.ring("Mirror frame", 0.575, 0.022, (0.12, 2.575, 1.72), frame, turn=(90, 0, 0))


def armchair() -> None:
    cloth, wood = look.velvet((0.52, 0.215, 0.035)), bpy.data.materials["Walnut"]
    anchor = make.add(None, "Armchair", (1.85, 0.55, 0.0), (0, 0, -38))
    parts = [
        make.cushion("Seat", (0.7, 0.7, 0.2), (0, -0.02, 0.4), cloth),
        make.cushion("Base", (0.74, 0.74, 0.16), (0, 0, 0.28), cloth),
        make.cushion("Back", (0.74, 0.2, 0.72), (0, 0.35, 0.66), cloth, turn=(-11, 0, 0)),
        make.cushion("Arm", (0.17, 0.76, 0.42), (-0.42, 0, 0.43), cloth),
        make.cushion("Arm", (0.17, 0.76, 0.42), (0.42, 0, 0.43), cloth),
        make.cushion("Pillow", (0.42, 0.14, 0.3), (0.02, 0.16, 0.6), look.velvet((0.1, 0.2, 0.23)), turn=(-20, 4, 3)),
    ]
    parts += [make.cylinder("Leg", 0.022, 0.2, (x, y, 0.0), wood) for x in (-0.36, 0.36) for y in (-0.3, 0.3)]
    for part in parts:
        part.parent = anchor


def table() -> None:
    """A marble table on a rug, with a carafe of water, two goblets and two steel balls."""
    make.cylinder("Rug", 1.45, 0.018, (0.35, 0.1, 0.0), look.rug())
    at = Vector((-0.15, -0.05, 0.0))
    steel = look.metal("Black steel", (0.06, 0.06, 0.065), 0.35)
    make.cylinder("Table top", 0.46, 0.03, (at.x, at.y, 0.43), look.marble())
    make.cylinder("Table stem", 0.025, 0.41, (at.x, at.y, 0.02), steel)
    make.cylinder("Table foot", 0.25, 0.02, (at.x, at.y, 0.018), steel)
    top = 0.461
    clear = look.glass("Glass", (0.985, 1.0, 0.995), ior=1.5)
    outer = make.spline(
        [(0.07, 0.0), (0.085, 0.03), (0.09, 0.1), (0.06, 0.18), (0.032, 0.23), (0.034, 0.27), (0.046, 0.31)]
    )
    inner = [(radius - 0.0035, max(z, 0.008)) for radius, z in reversed(outer)]
    make.lathe("Carafe", [(0, 0), *outer, *inner, (0, 0.008)], (at.x - 0.08, at.y + 0.12, top), clear, steps=96)
    # The water reaches a little into the glass, so that no film of air lies between.
    level = 0.15
    filled = [(radius - 0.002, z) for radius, z in outer if 0.006 < z < level]
    surface = filled[-1][0]
    make.lathe(
        "Water", [(0, 0.006), *filled, (surface, level), (0, level)], (at.x - 0.08, at.y + 0.12, top),
        look.glass("Water", ior=1.33), steps=96,
    ).data.set_sharp_from_angle(angle=math.radians(60))  # fmt: skip
    outer = make.spline(
        [(0.036, 0.0), (0.03, 0.006), (0.006, 0.02), (0.005, 0.07), (0.03, 0.1), (0.042, 0.14), (0.036, 0.19)]
    )
    inner = [(radius - 0.002, z + 0.001) for radius, z in reversed(outer) if z > 0.1]
    for place in ((0.17, 0.02), (0.06, -0.17)):
        make.lathe("Goblet", [(0, 0), *outer, *inner, (0, 0.105)], (at.x + place[0], at.y + place[1], top), clear)
    chrome = look.metal("Chrome", (0.78, 0.79, 0.8), 0.04)
    make.ball("Chrome ball", 0.05, (at.x - 0.2, at.y - 0.12, top + 0.05), chrome)
    make.ball("Brass ball", 0.033, (at.x - 0.11, at.y - 0.22, top + 0.033), bpy.data.materials["Brass"])


def pendants() -> None:
    """Three glowing globes on brass stems."""
    brass = bpy.data.materials["Brass"]
    glow = look.glow("Globe", (1.0, 0.62, 0.3), 9.0)
    for x, y, z, radius in ((1.28, 1.75, 2.02, 0.1), (1.62, 1.95, 1.72, 0.13), (1.95, 1.7, 2.15, 0.085)):
        make.ball("Globe", radius, (x, y, z), glow)
        make.cylinder("Cap", radius * 0.45, 0.035, (x, y, z + radius * 0.9), brass)
        make.cylinder("Stem", 0.006, ROOM_Z - z - radius, (x, y, z + radius), brass)


def floor_lamp() -> None:
    """A brass lamp behind the armchair, a point lamp under its open shade."""
    x, y = 2.55, 1.35
    brass = bpy.data.materials["Brass"]
    make.cylinder("Lamp foot", 0.16, 0.02, (x, y, 0.0), brass)
    make.cylinder("Lamp stem", 0.012, 1.42, (x, y, 0.02), brass)
    linen = look.material("Linen", Base_Color=(0.75, 0.62, 0.43), Roughness=0.9)
    shade = [(0.235, 1.3), (0.15, 1.62), (0.146, 1.62), (0.231, 1.3), (0.235, 1.3)]
    make.lathe("Shade", shade, (x, y, 0.0), linen, smooth=False, steps=48)
    lamp("POINT", "Bulb", (x, y, 1.44), 26.0, (1.0, 0.66, 0.36), shadow_soft_size=0.07)


def lamp(kind: str, name: str, at: make.Point, power: float, color: look.Rgb, **properties: object) -> bpy.types.Object:
    data = bpy.data.lights.new(name, kind)
    data.energy, data.color = power, color
    for key, value in properties.items():
        setattr(data, key, value)
    return make.add(data, name, at)


def daylight(scene: bpy.types.Scene) -> None:
    """A low sun and a sky through the window, a soft panel for what the rest of the house sends in, a spot."""
    sun = lamp("SUN", "Sun", (-4, -2, 4), 17.0, (1.0, 0.8, 0.58), angle=math.radians(2.5))
    make.aim(sun, tuple(sun.location + Vector((1.0, 0.42, -0.62))))
    x, y, z = ROOM_X[0] - 0.35, sum(WINDOW_Y) / 2, sum(WINDOW_Z) / 2
    sky = lamp("AREA", "Window light", (x, y, z), 95.0, (0.72, 0.86, 1.0), shape="RECTANGLE", size=3.0, size_y=1.9)
    make.aim(sky, (x + 1, y, z - 0.12))
    fill = lamp("AREA", "Room light", (0.3, -4.6, 2.3), 24.0, (1.0, 0.9, 0.78), shape="RECTANGLE", size=3.6, size_y=1.6)
    make.aim(fill, (0.2, 2.0, 0.9))
    spot = lamp("SPOT", "Spot", (0.35, 0.9, 2.8), 60.0, (1.0, 0.83, 0.62), spot_size=math.radians(30), spot_blend=0.6,
                shadow_soft_size=0.08)  # fmt: skip
    make.aim(spot, (0.5, 2.3, 0.9))
    world = bpy.data.worlds.new("Morning sky")
    scene.world = world
    world.use_nodes = True
    world.node_tree.nodes.clear()
    tree = look.Tree(world.node_tree)
    sky_texture = tree.node(
        "ShaderNodeTexSky", sky_type="MULTIPLE_SCATTERING", sun_disc=False, sun_elevation=math.radians(24)
    )
    background = tree.node("ShaderNodeBackground", {"Color": sky_texture.outputs[0], "Strength": 0.35})
    tree.node("ShaderNodeOutputWorld", {"Surface": background.outputs[0]})


def camera(scene: bpy.types.Scene) -> None:
    data = bpy.data.cameras.new("Camera")
    data.lens = 36
    view = make.add(data, "Camera", (0.95, -4.15, 1.36))
    make.aim(view, (0.03, 1.6, 1.06))
    scene.camera = view
    data.shift_y = -0.01


if __name__ == "__main__":
    build()
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
