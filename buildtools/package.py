"""The extension zip: addon/ + blender_manifest.toml + one wheel of the core per Python, built and validated."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import List

from buildtools.compile_core import core_options
from buildtools.failure import BuildFailure
from buildtools.places import BUILD, DIST, NATIVE, ROOT, VENV_PYTHON
from buildtools.run import output, require

STAGE = BUILD / "extension"


def build_extension(pythons: List[str], isas: str) -> Path:
    """Path of the zip under dist/. pythons: further interpreters (with headers) to build a wheel for."""
    wheels = DIST / "wheels"
    shutil.rmtree(wheels, ignore_errors=True)
    for python in [str(VENV_PYTHON), *pythons]:
        _build_wheel(python, wheels, isas)
    _stage_sources(sorted(wheels.glob("*.whl")))
    blender_ext = _blender_ext()
    for old in DIST.glob("luch-*.zip"):
        old.unlink()
    require([*blender_ext, "build", "--source-dir", str(STAGE), "--output-dir", str(DIST)], "the zip was not built")
    archive = next(DIST.glob("luch-*.zip"), None)
    if archive is None:
        raise BuildFailure(f"Blender's packer left no zip in {DIST}")
    require([*blender_ext, "validate", str(archive)], f"{archive.name} is not a valid extension")
    return archive


def _build_wheel(python: str, wheels: Path, isas: str) -> None:
    tag = output([python, "-c", "import sys; print('cp%d%d' % sys.version_info[:2])"])
    if tag is None:
        raise BuildFailure(f"{python} does not run")
    command = [str(VENV_PYTHON), "-m", "pip", "wheel", "-q", "--disable-pip-version-check", "--no-deps"]
    command += ["--no-build-isolation", "-w", str(wheels), str(NATIVE)]
    for option in core_options(isas, python):
        name, value = option[2:].split("=", 1)
        command.append(f"--config-settings=cmake.define.{name}={value}")
    command.append(f"--config-settings=build-dir={BUILD}")
    require(command, f"the wheel for {tag} was not built")


def _stage_sources(wheels: List[Path]) -> None:
    """A clean folder with what goes into the zip: the add-on at its root, the wheels named in the manifest."""
    shutil.rmtree(STAGE, ignore_errors=True)
    shutil.copytree(ROOT / "addon", STAGE, ignore=shutil.ignore_patterns("__pycache__"))
    (STAGE / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy2(wheel, STAGE / "wheels")
    shutil.copy2(ROOT / "LICENSE", STAGE)
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    listed = ", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels)
    (STAGE / "blender_manifest.toml").write_text(
        re.sub(r"(?m)^wheels = .*$", f"wheels = [{listed}]", manifest), encoding="utf-8"
    )


def _blender_ext() -> List[str]:
    """Blender's own packer, which needs no Blender running."""
    pattern = "lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
    found = sorted((VENV_PYTHON.parent.parent).glob(pattern))
    if not found:
        raise BuildFailure("bpy in .venv carries no blender_ext.py; remove .venv and run this again")
    return [str(VENV_PYTHON), str(found[-1])]
