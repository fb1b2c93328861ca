"""The extension zip: addon/ + blender_manifest.toml + one wheel of the core per Python, built and validated."""

from __future__ import annotations

import base64
import hashlib
import re
import shutil
import zipfile
from pathlib import Path
from typing import Dict, List

from buildtools.compile_core import configure_and_make, core_options
from buildtools.failure import BuildFailure
from buildtools.places import BUILD, DIST, NATIVE, ROOT, VENV_PYTHON
from buildtools.run import require

STAGE = BUILD / "extension"
WHEELS = DIST / "wheels"


def build_extension(isas: str, jobs: int, headers: Dict[str, Path]) -> Path:
    """Path of the zip under dist/. headers: further Pythons as tag -> folder with their Python.h ("cp314": ...)."""
    shutil.rmtree(WHEELS, ignore_errors=True)
    wheel = _build_wheel(isas)
    for tag, folder in headers.items():
        _build_wheel_for(tag, folder, wheel, isas, jobs)
    _stage_sources(sorted(WHEELS.glob("*.whl")))
    blender_ext = _blender_ext()
    for old in DIST.glob("luch-*.zip"):
        old.unlink()
    require([*blender_ext, "build", "--source-dir", str(STAGE), "--output-dir", str(DIST)], "the zip was not built")
    archive = next(DIST.glob("luch-*.zip"), None)
    if archive is None:
        raise BuildFailure(f"Blender's packer left no zip in {DIST}")
    require([*blender_ext, "validate", str(archive)], f"{archive.name} is not a valid extension")
    return archive


def _build_wheel(isas: str) -> Path:
    """For .venv's Python, by scikit-build-core, from the build that is there already."""
    command = [str(VENV_PYTHON), "-m", "pip", "wheel", "-q", "--disable-pip-version-check", "--no-deps"]
    command += ["--no-build-isolation", "-w", str(WHEELS), str(NATIVE), f"--config-settings=build-dir={BUILD}"]
    for option in core_options(isas, str(VENV_PYTHON)):
        name, value = option[2:].split("=", 1)
        command.append(f"--config-settings=cmake.define.{name}={value}")
    require(command, "the wheel was not built")
    return next(WHEELS.glob("*.whl"))


def _build_wheel_for(tag: str, headers: Path, wheel: Path, isas: str, jobs: int) -> None:
    """The same wheel for a Python of which only the headers are here, such as that of a distribution's Blender."""
    if not (headers / "Python.h").is_file():
        raise BuildFailure(f"{headers}: no Python.h there; give the folder that holds it as --headers {tag}=FOLDER")
    folder = ROOT / f".build-{tag}"
    modules = folder / "modules"
    suffix = f".cpython-{tag[2:]}-x86_64-linux-gnu.so"
    options = [
        *core_options(isas, str(VENV_PYTHON)),
        f"-DLUCH_PYTHON_HEADERS={headers}",
        f"-DLUCH_MODULE_SUFFIX={suffix}",
        f"-DLUCH_OUTPUT_DIR={modules}",
    ]
    configure_and_make(folder, options, jobs)
    with zipfile.ZipFile(wheel) as source:
        own_tag = wheel.name.split("-")[2]
        entries = {
            name: source.read(name).replace(own_tag.encode(), tag.encode())
            for name in source.namelist()
            if not name.endswith((".so", "RECORD"))
        }
        record = next(name for name in source.namelist() if name.endswith("RECORD"))
    entries.update({f"luch/{path.name}": path.read_bytes() for path in sorted(modules.glob(f"_core_*{suffix}"))})
    entries[record] = _record(entries, record)
    with zipfile.ZipFile(wheel.with_name(wheel.name.replace(own_tag, tag)), "w", zipfile.ZIP_DEFLATED) as target:
        for name, data in entries.items():
            target.writestr(name, data)


def _record(entries: Dict[str, bytes], record: str) -> bytes:
    """A wheel's list of files with their hashes."""
    lines = []
    for name, data in entries.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={digest},{len(data)}")
    return "\n".join([*lines, f"{record},,", ""]).encode()


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
