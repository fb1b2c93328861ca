"""Random small scenes, all of whose parts fit together; some numbers in them are hostile."""

from __future__ import annotations

import numpy as np
from luch.scene import (
    F32,
    F64,
    Attribute,
    Camera,
    CameraMotion,
    Curves,
    Film,
    Image,
    InstanceMotion,
    Instances,
    Light,
    Material,
    Medium,
    Mesh,
    Object,
    Phase,
    Scene,
    Settings,
    Shutter,
    World,
)

from fuzz.programs import random_program
from fuzz.values import Rng, chance, hostile, number, triple

SIZE = 6  # pixels
PASSES = (
    "Depth", "Mist", "Position", "Normal", "UV", "Object Index", "Material Index", "Diffuse Direct", "Diffuse Color",
    "Glossy Indirect", "Transmission Direct", "Volume Direct", "Emission", "Environment", "Ambient Occlusion",
    "Denoising Albedo", "Denoising Normal", "Sample Count", "CryptoObject00", "CryptoMaterial00", "CryptoAsset00",
    "Error",
)  # fmt: skip
STRUCTURES = ("AUTO", "BVH", "BVH2", "BVH2_STACKLESS", "CWBVH", "KD_TREE", "GRID", "HIERARCHICAL_GRID", "BRUTE_FORCE")


def random_scene(seed: int) -> Scene:
    """The scene of a seed. About one in three holds no hostile number; the others from one to nothing but."""
    rng = np.random.default_rng(seed)
    wild = (0.0, 0.01, 0.1, 0.5)[int(rng.integers(4))]
    moves = chance(rng, 0.25)
    film = _film(rng)
    aovs = [name for name, _ in film.aovs]
    images = [_image(rng, k, wild) for k in range(int(rng.integers(0, 3)))]
    materials = [_material(rng, k, len(images), aovs, wild) for k in range(int(rng.integers(1, 4)))]
    meshes = [_mesh(rng, k, moves, wild) for k in range(int(rng.integers(0, 4)))]
    objects = [_object(rng, k, len(meshes), len(materials)) for k in range(int(rng.integers(0, 4)) if meshes else 0)]
    return Scene(
        name="Fuzz",
        meshes=meshes,
        objects=objects,
        instances=_instances(rng, len(objects), moves, wild),
        materials=materials,
        images=images,
        lights=[_light(rng, k, len(images), wild) for k in range(int(rng.integers(0, 4)))],
        world=_world(rng, len(images), wild) if chance(rng, 0.6) else None,
        camera=_camera(rng, moves, wild),
        film=film,
        settings=_settings(rng),
        origin=triple(rng, -1e6, 1e6) if chance(rng, 0.1) else (0.0, 0.0, 0.0),
        shutter=Shutter(curve=rng.random(5).astype(np.float32) if chance(rng, 0.5) else None) if moves else None,
    )


def matrix(rng: Rng, wild: float) -> F64:
    """(3, 4), mostly near the identity; some flat, some mirrored, some far."""
    result = np.eye(3, 4)
    if chance(rng, 0.5):
        result[:, :3] += rng.normal(0.0, 0.5, (3, 3))
    result[:, 3] = rng.normal(0.0, 1.0, 3)
    if chance(rng, 0.1):
        result[:, int(rng.integers(3))] = 0.0
    if chance(rng, 0.1):
        result *= 10.0 ** rng.uniform(-12, 12)
    return _sprinkle(rng, result, wild * 0.2)


def _sprinkle(rng: Rng, array: F64, wild: float) -> F64:
    if chance(rng, min(1.0, 5.0 * wild)) and array.size:
        for _ in range(int(rng.integers(1, 4))):
            array.reshape(-1)[int(rng.integers(array.size))] = hostile(rng)
    return array


def _single(array: F64) -> F32:
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


def _mesh(rng: Rng, index: int, moves: bool, wild: float) -> Mesh:
    vertices, triangles = int(rng.integers(0, 12)), 0
    if vertices:
        triangles = int(rng.integers(0, 20))
    positions = _sprinkle(rng, rng.normal(0.0, 1.0, (vertices, 3)) * (1.0, 1.0, 0.3), wild)
    mesh = Mesh(f"Mesh {index}", _single(positions), rng.integers(0, max(vertices, 1), (triangles, 3)).astype(np.uint32),
                rng.integers(0, 3, triangles).astype(np.uint16))  # fmt: skip
    if chance(rng, 0.4):
        mesh.normals_domain = "POINT" if chance(rng, 0.5) else "CORNER"
        rows = vertices if mesh.normals_domain == "POINT" else 3 * triangles
        mesh.normals = _single(_sprinkle(rng, rng.normal(size=(rows, 3)), wild))
    rows_of = {"POINT": vertices, "CORNER": 3 * triangles, "FACE": triangles, "MESH": 1}
    if chance(rng, 0.4):
        count = int(rng.integers(0, 6))
        mesh.spheres = _single(np.abs(rng.normal(0.0, 0.5, (count, 4))))
        rows_of["SPHERE"] = count
    for name in ("UVMap", "Col", "mass", "generated", "tangent"):
        if chance(rng, 0.3):
            domain = list(rows_of)[int(rng.integers(len(rows_of)))]
            shape = rows_of[domain], int(rng.integers(1, 5))
            mesh.attributes[name] = Attribute(_single(_sprinkle(rng, rng.normal(size=shape), wild)), domain)
    mesh.uv_active, mesh.color_active = "UVMap", "Col"
    if moves and chance(rng, 0.5):
        keys = int(rng.integers(2, 4))
        mesh.motion_positions = _single(positions + rng.normal(0.0, 0.2, (keys, vertices, 3)))
        if mesh.normals is not None:
            mesh.motion_normals = np.repeat(mesh.normals[None], keys, axis=0)
    _add_hair(rng.spawn(1)[0], mesh, moves, wild)
    return mesh


def _add_hair(rng: Rng, mesh: Mesh, moves: bool, wild: float) -> None:
    """From numbers of its own, so that seeds of old keep their scenes."""
    if not chance(rng, 0.4):
        return
    counts = rng.integers(0, 6, int(rng.integers(0, 5)))
    points = rng.normal(0.0, 0.7, (int(counts.sum()), 4))
    points[:, 3] = np.abs(points[:, 3]) * 10.0 ** rng.uniform(-4, 0)
    if len(points) > 2 and chance(rng, 0.3):
        points[1:3] = points[0]
    first = np.cumsum([0, *counts[:-1]])[: len(counts)].astype(np.uint32)
    rows = _single(_sprinkle(rng, points, wild))
    mesh.curves = Curves(rows, first, rng.integers(0, 3, len(counts)).astype(np.uint16))
    if moves and chance(rng, 0.5):
        keys = int(rng.integers(2, 4))
        mesh.curves.motion_points = _single(points + rng.normal(0.0, 0.2, (keys, *points.shape)))
    for name, domain, count in (("UVMap", "CURVE", len(counts)), ("mass", "CURVE_POINT", len(points))):
        if chance(rng, 0.4):
            shape = count, int(rng.integers(1, 5))
            mesh.attributes[name] = Attribute(_single(_sprinkle(rng, rng.normal(size=shape), wild)), domain)


def _object(rng: Rng, index: int, meshes: int, materials: int) -> Object:
    return Object(
        f"Object {index}",
        int(rng.integers(meshes)),
        [int(rng.integers(materials)) for _ in range(int(rng.integers(1, 4)))],
        visibility=int(rng.integers(64)) if chance(rng, 0.2) else 63,
        holdout=chance(rng, 0.1),
        shadow_terminator=number(rng, 0.0, 1.0) if chance(rng, 0.3) else 0.0,
        attributes={"object:tint": (0.1, 0.2, 0.3, 1.0)} if chance(rng, 0.3) else {},
    )


def _instances(rng: Rng, objects: int, moves: bool, wild: float) -> Instances | None:
    if not objects:
        return None
    count = int(rng.integers(0, 6))
    places = np.array([matrix(rng, wild) for _ in range(count)]).reshape(count, 3, 4)
    motion = None
    if moves and count and chance(rng, 0.6):
        keys = int(rng.integers(2, 4))
        steps = np.array([places[0] + k * 0.1 * rng.normal(size=(3, 4)) for k in range(keys)])
        motion = InstanceMotion(np.zeros(1, np.uint32), np.array([keys], np.uint32), steps)
    return Instances(
        rng.integers(0, objects, count).astype(np.uint32), places, rng.random(count).astype(np.float32),
        rng.random((count, 3)).astype(np.float32), rng.random((count, 2)).astype(np.float32), motion,
    )  # fmt: skip


def _medium(rng: Rng, wild: float) -> Medium:
    kinds = ("HENYEY_GREENSTEIN", "DRAINE", "FOURNIER_FORAND")
    phases = [
        Phase(kinds[int(rng.integers(3))], triple(rng, 0.0, 2.0, wild=wild), number(rng, -1.0, 1.5, wild=wild),
              number(rng, 0.0, 1.0, wild=wild))
        for _ in range(int(rng.integers(0, 3)))
    ]  # fmt: skip
    return Medium(triple(rng, 0.0, 2.0, wild=wild), triple(rng, 0.0, 1.0, wild=wild), phases)


def _material(rng: Rng, index: int, images: int, aovs: list[str], wild: float) -> Material:
    volume = _medium(rng, wild) if chance(rng, 0.15) else None
    return Material(
        f"Material {index}",
        random_program(rng, "SURFACE", images, aovs, wild),
        emission_sampling=("AUTO", "NONE", "FRONT", "BACK", "FRONT_BACK")[int(rng.integers(5))],
        transparent_shadows=chance(rng, 0.8),
        emission_estimate=triple(rng, wild=wild) if chance(rng, 0.3) else (0.0, 0.0, 0.0),
        volume=volume,
        only_volume=volume is not None and chance(rng, 0.3),
    )


def _image(rng: Rng, index: int, wild: float) -> Image:
    height, width, channels = int(rng.integers(1, 6)), int(rng.integers(1, 6)), int(rng.integers(1, 5))
    values = rng.random((height, width, channels))
    kind = int(rng.integers(3))
    pixels = (values * 255).astype(np.uint8) if kind == 0 else _single(_sprinkle(rng, values, wild))
    if kind == 1:
        with np.errstate(over="ignore", under="ignore"):
            pixels = pixels.astype(np.float16)
    alpha = ("STRAIGHT", "PREMULTIPLIED", "CHANNEL_PACKED", "NONE")[int(rng.integers(4))]
    return Image(f"Image {index}", pixels, "SRGB" if kind == 0 and chance(rng, 0.5) else "LINEAR", alpha)


def _light(rng: Rng, index: int, images: int, wild: float) -> Light:
    def size(high: float) -> float:
        return number(rng, 0.0, high, wild=wild)

    return Light(
        f"Light {index}",
        ("POINT", "SPOT", "SUN", "AREA")[int(rng.integers(4))],
        matrix(rng, wild),
        color=triple(rng, wild=wild),
        power=number(rng, -1.0, 100.0, wild=wild),
        normalize=chance(rng, 0.5),
        radius=size(0.5),
        soft_falloff=chance(rng, 0.5),
        spot_size=size(3.1415927),
        spot_blend=size(1.0),
        angle=size(3.1415927),
        shape=("SQUARE", "RECTANGLE", "DISK", "ELLIPSE")[int(rng.integers(4))],
        size=size(2.0),
        size_y=size(2.0),
        spread=size(3.1415927),
        program=random_program(rng, "LIGHT", images, [], wild) if chance(rng, 0.3) else None,
        visibility=int(rng.integers(64)),
        cast_shadow=chance(rng, 0.8),
        use_mis=chance(rng, 0.8),
        max_bounces=int(rng.integers(4)) if chance(rng, 0.2) else 1024,
    )


def _world(rng: Rng, images: int, wild: float) -> World:
    return World(
        "World",
        random_program(rng, "WORLD", images, [], wild),
        sampling=("NONE", "MANUAL")[int(rng.integers(2))],
        map_resolution=int(rng.integers(4, 33)),
        volume=_medium(rng, wild) if chance(rng, 0.1) else None,
    )


def _camera(rng: Rng, moves: bool, wild: float) -> Camera:
    place = np.eye(3, 4)
    place[:, 3] = (0.1, 0.2, 4.0)
    if chance(rng, 0.3):
        place = matrix(rng, wild)
    return Camera(
        ("PERSP", "ORTHO", "EQUIRECTANGULAR")[int(rng.integers(3))],
        place,
        lens_mm=number(rng, 1.0, 100.0, wild=wild * 0.2),
        ortho_scale=number(rng, 0.1, 10.0, wild=wild * 0.2),
        shift_x=number(rng, -1.0, 1.0, wild=wild * 0.2) if chance(rng, 0.2) else 0.0,
        clip_start=number(rng, 0.0, 1.0, wild=wild * 0.2),
        clip_end=number(rng, 1.0, 1e4, wild=wild * 0.2),
        use_dof=chance(rng, 0.3),
        focus_distance=number(rng, 0.0, 10.0, wild=wild),
        fstop=number(rng, 0.0, 8.0, wild=wild),
        blades=int(rng.integers(0, 8)),
        aperture_ratio=number(rng, 0.1, 2.0, wild=wild),
        motion=CameraMotion(np.stack([place, place + 0.01]), (30.0, 50.0)) if moves and chance(rng, 0.5) else None,
    )


def _film(rng: Rng) -> Film:
    names = [name for name in PASSES if chance(rng, 0.15)]
    return Film(
        width=SIZE,
        height=SIZE - 1,
        border=(1, 0, SIZE - 1, SIZE - 2) if chance(rng, 0.2) else None,
        filter=("BOX", "GAUSSIAN", "BLACKMAN_HARRIS")[int(rng.integers(3))],
        transparent=chance(rng, 0.3),
        transparent_glass=chance(rng, 0.3),
        passes=["Combined", *names],
        aovs=[("mask", "VALUE"), ("tint", "COLOR")] if chance(rng, 0.2) else [],
        lightgroups=["key"] if chance(rng, 0.2) else [],
    )


def _settings(rng: Rng) -> Settings:
    return Settings(
        samples=int(rng.integers(1, 4)),
        seed=int(rng.integers(1000)),
        threads=int(rng.integers(1, 3)),
        max_bounces=int(rng.integers(0, 13)),
        volume_bounces=int(rng.integers(0, 3)),
        transparent_bounces=int(rng.integers(0, 9)),
        clamp_direct=1.0 if chance(rng, 0.2) else 0.0,
        clamp_indirect=1.0 if chance(rng, 0.2) else 0.0,
        filter_glossy=number(rng, 0.0, 1.0) if chance(rng, 0.2) else 0.0,
        light_tree=chance(rng, 0.7),
        accelerator=STRUCTURES[int(rng.integers(len(STRUCTURES)))],
        precision=("WATERTIGHT", "FAST", "DOUBLE")[int(rng.integers(3))],
        estimate_error=chance(rng, 0.7),
        curve_shape=("RIBBON", "THICK", "THICK_LINEAR")[int(rng.spawn(1)[0].integers(3))],
        integrator=("PATH", "PATH", "PHOTON", "DISTRIBUTION")[int(rng.spawn(1)[0].integers(4))],
    )
