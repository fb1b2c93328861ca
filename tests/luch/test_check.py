"""What fuzzing found: parts of a scene that do not fit together are refused by name, before anything reads them."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fuzz.cases import run_case
from luch import memory
from luch.cuda import DeviceError
from luch.render import render
from luch.scene import Attribute, Image, Instances, Mesh, Scene
from luch.scenefile import HEADER, SceneFileError, read_scene, write_scene
from luch.shader import ProgramBuilder
from luch.shader_code import OPS
from luch.watching import watched
from support.effects import program
from support.everything import everything

Change = Callable[[Scene], None]


def set_to(owner: Callable[[Scene], object], name: str, value: object) -> Change:
    return lambda scene: setattr(owner(scene), name, value)


def ramp(offset: int) -> Change:
    """A colour ramp whose table begins somewhere."""

    def build(builder: ProgramBuilder) -> None:
        factor = builder.op3("POINT_POSITION", (), (0, 0))[0]
        builder.table(np.zeros((16, 4), np.float32))
        colors = builder.op("COLOR_RAMP", (factor,), (offset, 16, 0))
        builder.closure("CLOSURE_EMISSION", (colors[0], colors[1], colors[2]))

    return lambda scene: setattr(scene.materials[0], "surface", program(build))


def reading(name: str, slot: int, at: int) -> Change:
    """An operation that names an image or attribute by a slot of its program; there is one of each."""

    def build(builder: ProgramBuilder) -> None:
        builder.image(0)
        builder.attribute("UVMap")
        words = [0] * OPS[name].params
        words[at] = slot
        outputs = builder.op(name, builder.vector(0.0, 0.0, 0.0)[: OPS[name].inputs], words)
        builder.closure("CLOSURE_EMISSION", (outputs[0], outputs[1], outputs[2]))

    def change(scene: Scene) -> None:
        scene.images = [Image("Wood", np.ones((2, 2, 4), np.uint8))]
        scene.materials[0].surface = program(build)

    return change


def short_matrix(scene: Scene) -> None:
    scene.camera.matrix = np.zeros((2, 3))


def far_object(scene: Scene) -> None:
    assert isinstance(scene.instances, Instances)
    scene.instances.object[1] = 4_000_000_000


def too_many_registers(scene: Scene) -> None:
    scene.materials[0].surface.register_count = 2**32 - 1


CASES: dict[str, tuple[Change, str]] = {
    "an object of a mesh that is not there": (set_to(lambda s: s.objects[2], "mesh", 2**32 - 1), 'Object "Leaf"'),
    "no mesh at all": (set_to(lambda s: s, "meshes", []), 'Object "Floor" shows mesh 0 of 0'),
    "an object without material": (set_to(lambda s: s.objects[0], "materials", []), 'Object "Floor" has no material'),
    "a material that is not there": (set_to(lambda s: s.objects[1], "materials", [9]), 'Object "Pane".*9.* of 4'),
    "an instance of no object": (far_object, "Instances: .*4000000000 of 4"),
    "threads without end": (set_to(lambda s: s.settings, "threads", 65535), "Settings: threads is 65535"),
    "bounces that wrap around": (set_to(lambda s: s.settings, "max_bounces", 2**32 - 1), "Settings: max_bounces"),
    "a first sample below 0": (set_to(lambda s: s.settings, "first_sample", -1), "Settings: first_sample is -1"),
    "16 GB of registers": (too_many_registers, 'Material "Stone".*4294967295 registers'),
    "an exposure without end": (set_to(lambda s: s.film, "exposure", float("inf")), "Film: its exposure is inf"),
    "a border outside": (set_to(lambda s: s.film, "border", (3, 3, 2, 2)), "Film: the border"),
    "a vast world map": (set_to(lambda s: s.world, "map_resolution", 65536), 'World "Sky": its map resolution'),
    "a short matrix": (short_matrix, r"Camera: its matrix must be \(3, 4\)"),
    "a lamp's short matrix": (set_to(lambda s: s.lights[0], "matrix", np.zeros(3)), 'Light "Bulb": its matrix'),
    "a number below 0": (set_to(lambda s: s.lights[1], "max_bounces", -1), 'Light "Window" holds a number'),
    "a table beyond its end": (ramp(4), 'Material "Stone": operation COLOR_RAMP.*64 numbers from 4'),
    "an image beyond the last": (reading("IMAGE", 7, 0), 'Material "Stone": operation IMAGE .*image 7 of 1'),
    "an attribute beyond the last": (reading("ATTRIBUTE_COLOR", 3, 2), "ATTRIBUTE_COLOR .*attribute 3 of 1"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_parts_that_do_not_fit_are_refused_by_name(name: str) -> None:
    change, told = CASES[name]
    scene = everything()
    change(scene)
    with pytest.raises(ValueError, match=told):
        render(scene)


def test_a_wild_slot_within_bounds_still_renders() -> None:
    scene = everything()
    ramp(0)(scene)
    assert np.isfinite(render(scene).passes["Combined"]).all()


def test_a_constant_beyond_float32_is_infinite_and_the_picture_is_not() -> None:
    builder = ProgramBuilder()
    assert builder.known(builder.constant(1e300)) == float("inf")
    scene = everything()
    scene.materials[0].surface = program(lambda b: b.closure("CLOSURE_EMISSION", b.vector(1e300, -1e300, 1.0)))
    assert np.isfinite(render(scene).passes["Combined"]).all()


def rewritten(path: Path, name: str, content: Callable[[bytes], bytes], packed: int = zipfile.ZIP_DEFLATED) -> Path:
    """The file with one member replaced; its checksums are right."""
    result = path.with_name("damaged.luch")
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(result, "w") as new:
        for member in old.namelist():
            data = old.read(member)
            chosen = member == name
            new.writestr(member, content(data) if chosen else data, packed if chosen else zipfile.ZIP_DEFLATED)
    return result


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.luch"
    write_scene(everything(), path)
    return path


def with_header(text: bytes) -> Callable[[bytes], bytes]:
    """A .npy whose header says something else."""
    return lambda data: data[:8] + len(text).to_bytes(2, "little") + text + data[128:]


@pytest.mark.parametrize(
    "header",
    [b"{'descr': '<f4\n", b"\0\0\0", b"{" * 200, b"{'descr': '<f4', 'fortran_order': False, 'shape': (1" + b"0" * 14 + b",)}\n"],
    ids=["cut", "no text", "braces", "400 terabytes"],
)  # fmt: skip
def test_an_array_that_is_none_is_refused_and_no_memory_is_taken_for_it(file: Path, header: bytes) -> None:
    with pytest.raises(SceneFileError, match=r"damaged\.luch: .*arrays/1\.npy is not an array"):
        read_scene(rewritten(file, "arrays/1.npy", with_header(header)))


def test_what_unpacks_without_bound_is_refused(file: Path) -> None:
    with pytest.raises(SceneFileError, match=r"arrays/1\.npy is packed in a way"):
        read_scene(rewritten(file, "arrays/1.npy", lambda data: data, zipfile.ZIP_BZIP2))


def test_attributes_that_are_no_pairs_are_refused(file: Path) -> None:
    def damaged(data: bytes) -> bytes:
        header = json.loads(data)
        header["scene"]["meshes"][0]["attributes"] = {"map": [1, 2, 3]}
        return json.dumps(header).encode()

    with pytest.raises(SceneFileError, match=r"Scene\.meshes\[0\]\.attributes"):
        read_scene(rewritten(file, HEADER, damaged))


def test_a_directory_that_points_before_the_beginning_is_refused(file: Path, tmp_path: Path) -> None:
    data = bytearray(file.read_bytes())
    at = data.rindex(b"PK\x05\x06")
    data[at + 16 : at + 20] = (len(data) + 1000).to_bytes(4, "little")  # where the directory begins
    damaged = tmp_path / "damaged.luch"
    damaged.write_bytes(data)
    with pytest.raises(SceneFileError, match="not a whole"):
        read_scene(damaged)


def test_arrays_are_read_as_they_were_written(file: Path) -> None:
    scene, again = everything(), read_scene(file)
    again.meshes[0].positions[0] = 0.0  # not a view of read-only bytes
    assert replace(again.settings) == scene.settings
    np.testing.assert_array_equal(again.meshes[1].positions, scene.meshes[1].positions)


def vast_mesh(**sizes: int) -> Mesh:
    """A mesh of any size that takes no memory: all rows are one."""
    count = sizes.get("triangles", 1)
    mesh = Mesh(
        "Vast",
        np.broadcast_to(np.zeros(3, np.float32), (sizes.get("vertices", 3), 3)),
        np.broadcast_to(np.zeros(3, np.uint32), (count, 3)),
        np.broadcast_to(np.zeros(1, np.uint16), (1, count))[0],
    )
    if "corners" in sizes:
        mesh.attributes["UVMap"] = Attribute(np.broadcast_to(np.zeros(2, np.float32), (sizes["corners"], 2)), "CORNER")
    return mesh


@pytest.mark.promise(20)
@pytest.mark.parametrize(
    ("sizes", "told"),
    [({"triangles": 1 << 30}, "primitives"), ({"vertices": 1 << 31}, "vertices"), ({"corners": 1 << 31}, "numbers of")],
)
def test_what_the_core_cannot_count_is_refused_before_it_is_copied(sizes: dict[str, int], told: str) -> None:
    scene = everything()
    scene.meshes.append(vast_mesh(**sizes))
    with pytest.raises(ValueError, match=f'Mesh "Vast": with it the scene has .*{told}'):
        render(scene)


@pytest.mark.promise(20)
def test_a_mesh_of_fifty_million_triangles_is_refused_where_it_does_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = everything()
    scene.meshes.append(vast_mesh(triangles=50_000_000, vertices=25_000_000))
    monkeypatch.setattr(memory, "available_bytes", lambda: float(1 << 29))
    with pytest.raises(MemoryError, match=r"at least 0\.9\d GiB \(\d+ bytes\).*0\.50 GiB are free"):
        render(scene)


@pytest.mark.promise(7)
def test_a_picture_that_does_not_fit_is_refused_before_it_is_allocated() -> None:
    scene = everything()
    scene.film.width = scene.film.height = 60_000
    with pytest.raises(MemoryError, match=r"at least .*60000 x 60000 pixels \d+\.\d+, geometry"):
        render(scene)


@pytest.mark.promise(7)
def test_an_allocation_that_fails_says_what_was_wanted_and_a_gpus_keeps_its_own_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class OutOfMemoryError(MemoryError):
        """As CuPy raises it."""

    def failing(error: MemoryError) -> Callable[[object], None]:
        def prepare(loop: object) -> None:
            raise error

        return prepare

    monkeypatch.setattr("luch.render._Loop.prepare", failing(MemoryError("std::bad_alloc")))
    with pytest.raises(MemoryError, match=r"needs more than .* bytes\)"):
        render(everything())
    OutOfMemoryError.__module__ = "cupy.cuda.memory"
    monkeypatch.setattr("luch.render._Loop.prepare", failing(OutOfMemoryError("allocating 5,368,709,120 bytes")))
    with pytest.raises(DeviceError, match=r"5,368,709,120 bytes.*Lower the resolution"):
        render(everything())
    monkeypatch.undo()
    assert np.isfinite(render(everything()).passes["Combined"]).all()


@pytest.mark.promise(2)
def test_an_exception_of_another_thread_arrives_where_it_was_waited_for() -> None:
    class Silent:
        def cancel(self) -> None:
            """Nothing runs."""

    def work() -> None:
        raise ZeroDivisionError("in the worker")

    with pytest.raises(ZeroDivisionError, match="in the worker"):
        watched(work, Silent(), lambda: True)


@pytest.mark.promise(11)
def test_two_processes_at_once_draw_what_one_draws(tmp_path: Path) -> None:
    write_scene(everything(), tmp_path / "scene.luch")
    script = (
        "import sys, hashlib; from luch.render import render; from luch.scenefile import read_scene\n"
        "scene = read_scene(sys.argv[1]); scene.settings.samples, scene.settings.threads = 256, 0\n"
        "print(hashlib.sha256(render(scene).passes['Combined'].tobytes()).hexdigest())"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "scene.luch")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) for _ in range(2)]
    seen = [process.communicate(timeout=60)[0] for process in both]
    assert seen[0] == seen[1] != ""
    scene = read_scene(tmp_path / "scene.luch")
    scene.settings.samples = 256
    assert seen[0].strip() == hashlib.sha256(render(scene).passes["Combined"].tobytes()).hexdigest()


def test_a_ray_that_meets_one_border_again_and_again_ends(tmp_path: Path) -> None:
    """Seed 36314: fog whose object is stretched to 1e7 m, where numbers have no digits left, and rays stay where they
    are. It rendered for ever, deaf to a cancel."""
    assert run_case("scene", 36314, tmp_path) == "rendered"
