"""The command line: options reach the scene, files come out, mistakes are told in one sentence."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from luch import image
from luch.cli import CANCELLED, describe, main
from luch.scene import Camera, Film, Light, Material, Mesh, Object, Program, Scene
from luch.scenefile import write_scene


@dataclass
class FakeResult:
    passes: dict[str, Any]
    stats: dict[str, Any]
    cancelled: bool = False
    sums: None = None


@dataclass
class FakeRenderer:
    """Stands for luch.render: remembers the scene, tells progress once, answers with a grey picture."""

    scenes: list[Scene] = field(default_factory=list)
    during: Callable[[], None] = lambda: None

    def render(self, scene: Scene, *, progress: Callable[[Any], bool] | None = None) -> FakeResult:
        self.scenes.append(scene)
        self.during()
        told = types.SimpleNamespace(
            fraction=0.5, samples=1, total_samples=2, remaining_seconds=np.inf, preparing=False
        )
        goes_on = progress is None or progress(told)
        pixels = np.full((scene.film.height, scene.film.width, 4), 0.5, np.float32)
        stats = {"samples": scene.settings.samples, "render_seconds": 0.5, "bytes": 2**40, "notes": ["a"]}
        return FakeResult({"Combined": pixels, "CryptoObject00": pixels}, stats, not goes_on)


@pytest.fixture
def renderer(monkeypatch: pytest.MonkeyPatch) -> FakeRenderer:
    fake = FakeRenderer()
    module = types.ModuleType("luch.render")
    module.render = fake.render  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "luch.render", module)
    return fake


def scene() -> Scene:
    empty = Program(np.zeros(0, np.uint32), np.zeros(0, np.float32), 0, 0, np.zeros(0, np.float32), [], [])
    return Scene(
        name="Hof",
        meshes=[Mesh("Tor", np.zeros((3, 3), np.float32), np.uint32([[0, 1, 2]]), np.uint16([0]))],
        objects=[Object("Tor", 0, [0])],
        materials=[Material("Stein", empty)],
        lights=[Light("a", "SUN"), Light("b", "AREA"), Light("c", "AREA")],
        camera=Camera(use_dof=True),
        film=Film(width=8, height=4, passes=["Combined", "CryptoObject00"]),
        warnings=['Object "Tor": has no normals.'],
    )


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_scene(scene(), tmp_path / "hof.luch")
    return tmp_path / "hof.luch"


def test_render_writes_an_exr_with_statistics_and_cryptomatte(
    file: Path, renderer: FakeRenderer, capsys: pytest.CaptureFixture[str]
) -> None:
    output = file.parent / "out.exr"
    options = ["--samples", "9", "--time", "2.5", "--seed", "4", "--threads", "3"]
    assert main(["render", str(file), "-o", str(output), *options]) == 0
    settings = renderer.scenes[0].settings
    assert (settings.samples, settings.time_limit, settings.seed, settings.threads) == (9, 2.5, 4, 3)
    passes, metadata = image.read_exr(output)
    assert passes["ViewLayer.Combined"].shape == (4, 8, 4)
    assert metadata["luch.samples"] == 9 and metadata["luch.bytes"] == str(2**40)
    manifests = [value for key, value in metadata.items() if key.endswith("/manifest")]
    assert len(manifests) == 1 and '"Tor"' in manifests[0]
    told = capsys.readouterr()
    assert "9 samples in 0.50 s" in told.out and 'Object "Tor": has no normals.' in told.err


def test_render_leaves_the_scenes_settings_alone_without_options(file: Path, renderer: FakeRenderer) -> None:
    assert main(["render", str(file), "-o", str(file.parent / "out.png")]) == 0
    assert renderer.scenes[0].settings == scene().settings
    assert image.read_image(file.parent / "out.png").pixels.shape == (4, 8, 4)


def test_ctrl_c_keeps_the_picture_so_far(file: Path, renderer: FakeRenderer) -> None:
    renderer.during = lambda: signal.raise_signal(signal.SIGINT)
    before = signal.getsignal(signal.SIGINT)
    assert main(["render", str(file), "-o", str(file.parent / "out.exr"), "--quiet"]) == CANCELLED
    assert (file.parent / "out.exr").exists()
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "{none}", "-o", "{folder}/a.exr"], "No such file"),
        (["render", "{file}", "-o", "{folder}/a.jpg"], "must end in .exr or .png"),
        (["render", "{file}", "-o", "{folder}/no/a.exr"], "folder does not exist"),
        (["render", "{bad}", "-o", "{folder}/a.exr"], "not a whole .luch file"),
        (["info", "{bad}"], "not a whole .luch file"),
    ],
)
def test_mistakes_are_told_in_one_sentence(
    arguments: list[str], message: str, file: Path, renderer: FakeRenderer, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = file.parent
    (folder / "bad.luch").write_bytes(b"no")
    names = {"file": file, "folder": folder, "none": folder / "none.luch", "bad": folder / "bad.luch"}
    assert main([argument.format(**names) for argument in arguments]) == 1
    told = capsys.readouterr().err
    assert message in told and told.startswith("luch: ") and told.count("\n") == 1
    assert not renderer.scenes


@pytest.mark.parametrize("option", [["--samples", "0"], ["--time", "-1"], ["--samples", "many"]])
def test_senseless_numbers_are_refused(option: list[str], file: Path, renderer: FakeRenderer) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["render", str(file), "-o", "a.exr", *option])
    assert caught.value.code == 2 and not renderer.scenes


def test_info_says_what_is_in_a_scene(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(file)]) == 0
    text = capsys.readouterr().out
    for part in ("Hof", "1 with 1 triangles", "Stein", "2 area, 1 sun", "depth of field", "8 x 4", "has no normals"):
        assert part in text
    assert re.search(r"\n  on +sun lamps +", text) and re.search(r"\n  off +coat +every coat weight is 0", text)
    assert all(line.strip() for line in describe(Scene()))


def test_python_m_luch_renders_a_file_from_nothing_else(file: Path) -> None:
    output = file.parent / "real.exr"
    environment = {"PYTHONPATH": str(Path(image.__file__).parents[1])}
    command = [sys.executable, "-m", "luch", "render", str(file), "-o", str(output), "--samples", "2", "--threads", "1"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    passes, metadata = image.read_exr(output)
    assert passes["ViewLayer.Combined"].shape == (4, 8, 4) and metadata["luch.samples"] == 2
    assert "sun lamps" in metadata["luch.effects"] and len(metadata["luch.effects"]) < 500  # names, no reasons
    assert "ViewLayer.CryptoObject02" in passes
