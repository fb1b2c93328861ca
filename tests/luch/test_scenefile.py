"""Scene files: what is written is read back exactly; what is damaged is named."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch.scene import (
    Attribute,
    Camera,
    Film,
    Image,
    Instances,
    Light,
    Material,
    Mesh,
    Object,
    Program,
    Scene,
    Settings,
    World,
)
from luch.scenefile import VERSION, SceneFileError, read_scene, write_scene
from luch.shader import OPS, ProgramBuilder

FIRST_OPERATION = min(OPS.values(), key=lambda op: op.code)


def program() -> Program:
    return Program(
        code=np.array([0, 0, *range(FIRST_OPERATION.inputs + FIRST_OPERATION.outputs)], np.uint32),
        constants=np.float32([0.1, np.inf, -0.0]),
        register_count=7,
        flags=3,
        tables=np.zeros((0,), np.float32),
        images=[0],
        attributes=["UVMap", "Größe"],
        aovs=["glow"],
    )


def full_scene() -> Scene:
    """One of everything, no field at its default where another value makes sense."""
    rng = np.random.default_rng(3)
    shared = rng.random((5, 3), dtype=np.float32)
    mesh = Mesh(
        name="Tor ⛩",
        positions=shared,
        triangles=np.uint32([[0, 1, 2], [2, 3, 4]]),
        material_slots=np.uint16([0, 1]),
        normals=shared,
        normals_domain="POINT",
        attributes={
            "UVMap": Attribute(rng.random((6, 2), dtype=np.float32), "CORNER"),
            "tint": Attribute(rng.random((3, 4), dtype=np.float32), "SPHERE"),
        },
        uv_active="UVMap",
        texture_location=(1.0, 0.1, -3.5),
        spheres=rng.random((3, 4), dtype=np.float32),
    )
    instances = Instances(
        object=np.uint32([0, 0]),
        matrix=rng.random((2, 3, 4)) + 1e7,
        random=np.float32([0.25, 1 / 3]),
        generated=np.zeros((2, 3), np.float32),
        uv=np.zeros((2, 2), np.float32),
    )
    half = np.float16([[[0.1], [65504]]])
    return Scene(
        name="Szene",
        meshes=[mesh, Mesh("Empty", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32), np.zeros(0, np.uint16))],
        objects=[Object("Tor", 0, [0, 1], pass_index=3, holdout=True, asset="Hof")],
        instances=instances,
        materials=[Material("Stein", program(), emission_estimate=(1.0, 2.0, 1e-30))],
        images=[Image("half", half), Image("byte", np.uint8([[[1, 2, 3, 4]]]), "SRGB", "PREMULTIPLIED")],
        lights=[Light("Sonne", "SUN", program=program()), Light("Punkt", "POINT", radius=0.1)],
        world=World("Himmel", program(), visibility=5),
        camera=Camera(kind="ORTHO", shift_x=0.1, latitude=(-0.5, 0.25)),
        film=Film(border=(1, 2, 30, 40), passes=["Combined", "Depth"], aovs=[("glow", "COLOR")], lightgroups=["key"]),
        settings=Settings(samples=3, clamp_indirect=10.0),
        origin=(1e7, 0.1, -2.0),
        frame=25,
        warnings=['Material "Stein": node "Foo" is unknown.'],
    )


def assert_same(a: Any, b: Any, where: str = "scene") -> None:
    assert type(a) is type(b), where
    if dataclasses.is_dataclass(a):
        for f in dataclasses.fields(a):
            assert_same(getattr(a, f.name), getattr(b, f.name), f"{where}.{f.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes(), where
    elif isinstance(a, list | tuple):
        assert len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{i}]")
    elif isinstance(a, dict):
        assert list(a) == list(b), where
        for key in a:
            assert_same(a[key], b[key], f"{where}[{key!r}]")
    else:
        assert a == b, where


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.luch"
    write_scene(full_scene(), path)
    return path


def rewrite(file: Path, change: Any) -> None:
    """Puts a changed header in place of the file's own."""
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = json.loads(members["scene.json"])
    change(header, members)
    members.setdefault("scene.json", b"")
    if members["scene.json"]:
        members["scene.json"] = json.dumps(header).encode()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def test_a_scene_comes_back_exactly(file: Path) -> None:
    assert_same(read_scene(file), full_scene())


def test_an_empty_scene_comes_back(tmp_path: Path) -> None:
    write_scene(Scene(), tmp_path / "empty.luch")
    assert_same(read_scene(tmp_path / "empty.luch"), Scene())


def test_numpy_numbers_come_back_as_python_numbers(tmp_path: Path) -> None:
    scene = Scene(camera=Camera(lens_mm=np.float32(35.0), blades=np.int64(5)))  # type: ignore[arg-type]
    write_scene(scene, tmp_path / "scene.luch")
    camera = read_scene(tmp_path / "scene.luch").camera
    assert (camera.lens_mm, camera.blades) == (35.0, 5) and type(camera.lens_mm) is float


def test_an_array_that_is_used_twice_is_stored_once(file: Path) -> None:
    mesh = read_scene(file).meshes[0]
    assert mesh.normals is mesh.positions


def test_a_field_that_an_older_file_lacks_takes_its_default(file: Path) -> None:
    rewrite(file, lambda header, _: header["scene"]["settings"].pop("clamp_indirect"))
    assert read_scene(file).settings.clamp_indirect == Settings().clamp_indirect


def test_a_million_triangles_are_written_and_read_in_seconds(tmp_path: Path) -> None:
    n = 1_000_000
    mesh = Mesh("Big", np.zeros((n, 3), np.float32), np.zeros((n, 3), np.uint32), np.zeros(n, np.uint16))
    write_scene(Scene(meshes=[mesh]), tmp_path / "big.luch")
    assert len(read_scene(tmp_path / "big.luch").meshes[0].triangles) == n


DAMAGES: dict[str, tuple[Any, str]] = {
    "newer": (lambda h, _: h.update(version=VERSION + 1), f"version {VERSION + 1}.*Update Luch"),
    "no version": (lambda h, _: h.pop("version"), "version None means nothing"),
    "another format": (lambda h, _: h.update(format="cake"), "holds no Luch scene"),
    "not an object": (lambda h, m: m.update({"scene.json": b""}), "not a whole .luch file"),
    "no header": (lambda h, m: m.pop("scene.json"), "holds no|not a whole"),
    "array gone": (lambda h, m: m.pop("arrays/0.npy"), r"Scene.meshes\[0\].positions: arrays/0.npy is missing"),
    "array cut": (lambda h, m: m.update({"arrays/0.npy": m["arrays/0.npy"][:90]}), "arrays/0.npy is not an array"),
    "array of the wrong kind": (
        lambda h, m: m.update({"arrays/0.npy": m["arrays/1.npy"]}),
        r"Scene.meshes\[0\].positions holds uint32 numbers, not float32",
    ),
    "text for a number": (
        lambda h, _: h["scene"]["camera"].update(lens_mm="long"),
        "Scene.camera.lens_mm holds str, not float",
    ),
    "true for a number": (lambda h, _: h["scene"]["settings"].update(samples=True), "samples holds bool, not int"),
    "tuple too short": (lambda h, _: h["scene"].update(origin=[1.0]), "Scene.origin has 1 items, not 3"),
    "unnamed operations": (lambda h, _: h.pop("operations"), "operations holds NoneType, not list"),
    "unknown operation": (
        lambda h, _: h["operations"].__setitem__(0, ["POLISH", 1, 1, 0]),
        "shader operation POLISH is not known",
    ),
    "changed operation": (
        lambda h, _: h["operations"][0].__setitem__(1, 77),
        "the shader operation .* has changed since",
    ),
    "unknown field": (lambda h, _: h["scene"]["film"].update(taste="sweet"), "field 'taste'"),
    "missing field": (lambda h, _: h["scene"]["world"].pop("program"), "Scene.world.*program"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_damage_is_named_with_its_place(name: str, file: Path) -> None:
    change, message = DAMAGES[name]
    rewrite(file, change)
    with pytest.raises(SceneFileError, match=message) as caught:
        read_scene(file)
    assert str(file) in str(caught.value)


def test_programs_mean_the_same_where_operations_have_other_numbers(tmp_path: Path) -> None:
    builder = ProgramBuilder()
    (facing,) = builder.op("POINT_BACKFACING")
    (grey,) = builder.op("MATH_ADD", (facing, builder.constant(0.5)))
    builder.closure("CLOSURE_EMISSION", (grey, grey, grey))
    scene = full_scene()
    scene.materials[0].surface = builder.finish()
    scene.lights, scene.world = [], None  # other programs, of words that stay as they are
    path = tmp_path / "scene.luch"
    write_scene(scene, path)
    expected = scene.materials[0].surface.code
    with zipfile.ZipFile(path) as archive:
        header = json.loads(archive.read("scene.json"))
        member = header["scene"]["materials"][0]["surface"]["code"]["array"]

    other = list(reversed(header["operations"]))
    code, at = expected.copy(), 0
    while at < len(code):
        row = header["operations"][expected[at]]
        code[at] = other.index(row)
        at += 2 + row[1] + row[2] + int(expected[at + 1])
    assert not np.array_equal(code, expected)
    buffer = io.BytesIO()
    np.save(buffer, code)

    def elsewhere(h: Any, members: Any) -> None:
        h["operations"] = other
        members[member] = buffer.getvalue()

    rewrite(path, elsewhere)
    assert np.array_equal(read_scene(path).materials[0].surface.code, expected)


def test_files_whose_operations_have_no_names_are_refused(file: Path) -> None:
    rewrite(file, lambda h, _: h.update(version=1))
    with pytest.raises(SceneFileError, match="version 1 of the format, this Luch reads from 2 on"):
        read_scene(file)


def test_other_files_are_refused(tmp_path: Path, file: Path) -> None:
    for data in (b"", b"hello", file.read_bytes()[:-200], file.read_bytes()[:400]):
        (tmp_path / "bad.luch").write_bytes(data)
        with pytest.raises(SceneFileError, match=r"bad\.luch: this is not a whole \.luch file"):
            read_scene(tmp_path / "bad.luch")
    with pytest.raises(FileNotFoundError):
        read_scene(tmp_path / "none.luch")


def test_a_flipped_bit_is_found(file: Path) -> None:
    data = bytearray(file.read_bytes())
    with zipfile.ZipFile(file) as archive:
        start = archive.getinfo("arrays/0.npy").header_offset + 60
    data[start] ^= 16
    file.write_bytes(bytes(data))
    with pytest.raises(SceneFileError):
        read_scene(file)


def test_pickles_are_never_executed(file: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    rewrite(file, lambda h, m: m.update({"arrays/0.npy": buffer.getvalue()}))
    with pytest.raises(SceneFileError, match="not an array"):
        read_scene(file)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(file: Path) -> None:
    before = file.read_bytes()
    bad = Scene(name=object())  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"Scene\.name holds a object"):
        write_scene(bad, file)
    assert file.read_bytes() == before
    assert [p.name for p in file.parent.iterdir()] == [file.name]
