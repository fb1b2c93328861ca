"""What fuzzing found: parts of a scene that do not fit together are refused by name, before anything reads them."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from luch.render import render
from luch.scene import Image, Instances, Scene
from luch.scenefile import HEADER, SceneFileError, read_scene, write_scene
from luch.shader import ProgramBuilder
from luch.shader_code import OPS
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
