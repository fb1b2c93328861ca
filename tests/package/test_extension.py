"""The extension zip: built, validated by Blender's own tool, installed into an empty user folder, rendering."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def extension_zip() -> Path:
    """Built as a user builds it, for the instruction sets that the tests' core was built for."""
    isas = sorted(
        {path.name.split(".")[0].removeprefix("_core_") for path in (ROOT / "native/luch").glob("_core_*.so")}
    )
    command = [sys.executable, str(ROOT / "build.py"), "package", "--isa", ";".join(isas)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return Path(result.stdout.strip().splitlines()[-1])


def test_zip_holds_the_addon_the_manifest_and_one_wheel(extension_zip: Path) -> None:
    names = zipfile.ZipFile(extension_zip).namelist()
    wheels = [name for name in names if name.endswith(".whl")]
    assert {"__init__.py", "blender_manifest.toml", "LICENSE"} <= set(names)
    assert len(wheels) == 1 and "cp313" in wheels[0]
    assert not [name for name in names if name.endswith((".pyc", ".so")) or "test" in name]


def test_wheel_holds_every_module_of_the_core_and_no_foreign_one(extension_zip: Path, tmp_path: Path) -> None:
    archive = zipfile.ZipFile(extension_zip)
    wheel = next(name for name in archive.namelist() if name.endswith(".whl"))
    packed = set(zipfile.ZipFile(archive.extract(wheel, tmp_path)).namelist())
    sources = {f"luch/{path.relative_to(ROOT / 'native/luch')}" for path in (ROOT / "native/luch").rglob("*.py")}
    cores = {f"luch/{path.name}" for path in (ROOT / "native/luch").glob("_core_*cpython-313*.so")}
    native = ROOT / "native"  # what luch/cuda compiles on the user's machine
    device = {f"luch/include/{path.relative_to(native / 'include')}" for path in (native / "include").rglob("*.*")}
    device |= {f"luch/cuda_source/{path.relative_to(native / 'cuda')}" for path in (native / "cuda").rglob("*.*")}
    ahead = {f"luch/{path.relative_to(native / 'luch')}" for path in (native / "luch" / "kernels").rglob("*.*")}
    assert {name for name in packed if name.startswith("luch/")} == sources | cores | device | ahead


def test_wheel_alone_traces_rays_with_numpy_and_nothing_else(extension_zip: Path, tmp_path: Path) -> None:
    """As after `pip install` into an empty environment: no Blender, no CuPy, no OpenImageIO."""
    archive = zipfile.ZipFile(extension_zip)
    wheel = archive.extract(next(name for name in archive.namelist() if name.endswith(".whl")), tmp_path)
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    numpy_home = Path(np.__file__).parents[1]
    for name in ("numpy", "numpy.libs"):
        if (numpy_home / name).exists():
            (site / name).symlink_to(numpy_home / name)
    program = (
        "import json, sys, luch, numpy as np; "
        "accel = luch.Accel(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32)); "
        "t, prim, u, v = accel.closest(np.array([[0, 0, 0, 0, 1, 1, 1, 9]], np.float32)); "
        "from luch.cuda import available, compiler; compiler.table(); "
        "print(json.dumps([luch.__file__, float(t[0]), int(prim[0]), available(), "
        "sorted({'bpy', 'cupy', 'OpenImageIO'} & set(sys.modules))]))"
    )
    command = [sys.executable, "-S", "-c", program]  # -S: none of this environment's own packages
    environment = {**os.environ, "PYTHONPATH": str(site)}
    told = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    file, t, prim, cuda, others = json.loads(told.stdout)
    assert Path(file).is_relative_to(site)
    assert (t, prim, cuda, others) == (pytest.approx(1 / 3), 0, False, [])


def test_installed_from_the_zip_into_an_empty_user_folder_it_renders(extension_zip: Path, tmp_path: Path) -> None:
    picture = tmp_path / "picture.png"
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment["BLENDER_USER_RESOURCES"] = str(tmp_path / "user")
    script = Path(__file__).with_name("install_and_render.py")
    command = [sys.executable, str(script), str(extension_zip), str(picture)]
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "INSTALLED luch._core_" in result.stdout, (result.stdout + result.stderr)[-3000:]
    pixels = np.asarray(oiio.ImageInput.open(str(picture)).read_image(oiio.FLOAT))
    assert pixels.shape[:2] == (32, 48)
    assert 0.02 < pixels[..., :3].mean() < 0.98 and pixels[..., :3].std() > 0.02, "a picture, not a blank"


def test_a_python_that_cannot_be_run_needs_its_headers_alone(tmp_path: Path) -> None:
    """As for a distribution's Blender: CMake must neither look for an interpreter nor compare versions."""
    from buildtools.compile_core import core_options
    from buildtools.places import NATIVE, tool

    headers = tmp_path / "python3.99"
    headers.mkdir()
    (headers / "Python.h").touch()
    suffix = ".cpython-399-x86_64-linux-gnu.so"
    options = [*core_options("v2;v3", sys.executable), f"-DLUCH_PYTHON_HEADERS={headers}"]
    options += [f"-DLUCH_MODULE_SUFFIX={suffix}", f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"]
    build = tmp_path / "build"
    subprocess.run([tool("cmake"), "-S", str(NATIVE), "-B", str(build), "-G", "Ninja", *options], check=True)
    recipe = (build / "build.ninja").read_text()
    assert f"_core_v2{suffix}" in recipe
    assert f"_core_v3{suffix}" in recipe
    assert f"-isystem {headers}" in recipe
