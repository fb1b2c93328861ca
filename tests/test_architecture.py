"""Who may know whom (docs/design.md, section 2), read from the imports and includes themselves."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
INCLUDE = ROOT / "native" / "include"
STDLIB_ONLY = [ROOT / "build.py", *(ROOT / "buildtools").glob("*.py")]

# Folder of include/luch -> the folders whose headers it may include, beside its own.
MAY_INCLUDE = {
    "math": set(),
    "geometry": {"math"},
    "sampling": {"math"},
    "accel": {"geometry", "math"},
    "bsdf": {"sampling", "math"},
    "texture": {"sampling", "math"},
    "light": {"sampling", "geometry", "math"},
    "camera": {"sampling", "geometry", "math"},
    "film": {"sampling", "math"},
    "shade": {"bsdf", "texture", "light", "camera", "geometry", "sampling", "math"},
    "integrator": {"shade", "bsdf", "texture", "light", "camera", "film", "accel", "geometry", "sampling", "math"},
}
# A header between folders is a contract: plain data that both sides need. (from folder, header)
CONTRACTS = {
    ("geometry", "luch/shade/scene_view.h"),
    ("bsdf", "luch/shade/scene_view.h"),
    ("light", "luch/shade/scene_view.h"),
    ("light", "luch/bsdf/closure.h"),
}
ONLY = {  # module -> where it may be imported
    "bpy": ("addon/", "tests/", "buildtools/inside/", "native/tools/"),
    "cupy": ("native/luch/cuda.py", "native/luch/cuda/", "tests/"),
    "OpenImageIO": ("native/luch/image.py", "tests/", "buildtools/inside/", "native/tools/"),
}


def tracked(*suffixes: str) -> list[Path]:
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    return [ROOT / name for name in listing if name.endswith(suffixes) and (ROOT / name).exists()]


def imported_modules(path: Path) -> set[str]:
    """Absolute module names that a Python file imports, anywhere in it."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            modules.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            modules.add(node.module)
    return modules


def includes(path: Path) -> list[str]:
    return re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(encoding="utf-8"), re.MULTILINE)


def code_only(text: str) -> str:
    """The text without comments and string literals."""
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', " ", text, flags=re.DOTALL)


def headers() -> list[Path]:
    return sorted(INCLUDE.rglob("*.h"))


def header_id(path: Path) -> str:
    return path.relative_to(INCLUDE).as_posix()


@pytest.mark.parametrize("module", ONLY)
def test_a_module_is_imported_only_where_it_is_at_home(module: str) -> None:
    offenders = [
        name
        for name, path in ((path.relative_to(ROOT).as_posix(), path) for path in tracked(".py"))
        if not name.startswith(ONLY[module]) and any(m.split(".")[0] == module for m in imported_modules(path))
    ]
    assert not offenders, f"{module} may be imported only under {ONLY[module]}"


def test_the_native_package_does_not_know_the_addon_or_the_tests() -> None:
    forbidden = {"addon", "tests", "support", "buildtools"}
    offenders = {
        path.relative_to(ROOT).as_posix(): sorted(found)
        for path in tracked(".py")
        if path.is_relative_to(ROOT / "native" / "luch")
        if (found := {m.split(".")[0] for m in imported_modules(path)} & forbidden)
    }
    assert not offenders


def test_the_addon_reaches_the_core_only_through_the_luch_package() -> None:
    offenders = {
        path.relative_to(ROOT).as_posix(): sorted(found)
        for path in tracked(".py")
        if path.is_relative_to(ROOT / "addon")
        if (found := {m for m in imported_modules(path) if m.startswith(("luch._", "addon", "tests", "buildtools"))})
    }
    assert not offenders, "inside the add-on, import it relatively: its installed name is another"


def test_build_py_needs_only_the_standard_library_and_python_3_9() -> None:
    import sys

    for path in STDLIB_ONLY:
        foreign = {m.split(".")[0] for m in imported_modules(path)} - set(sys.stdlib_module_names) - {"buildtools"}
        assert not foreign, f"{path.name} imports {foreign}"
        ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 9))


@pytest.mark.parametrize("header", headers(), ids=header_id)
def test_a_shared_header_includes_only_rooms_below_its_own(header: Path) -> None:
    parts = header.relative_to(INCLUDE / "luch").parts
    room = parts[0] if len(parts) > 1 else ""
    assert not room or room in MAY_INCLUDE, f"{room} is a new room: say in MAY_INCLUDE whom it may know"
    for include in includes(header):
        assert include.startswith("luch/"), f"{include}: shared headers use no other header (NVRTC has none)"
        assert (INCLUDE / include).exists(), f"{include} does not exist"
        target = Path(include).parts[1:-1]
        if target and target[0] != room and (room, include) not in CONTRACTS:
            assert target[0] in MAY_INCLUDE[room], f"{room} may not know {target[0]} ({include})"


@pytest.mark.parametrize("header", headers(), ids=header_id)
def test_a_shared_header_is_fit_for_the_device(header: Path) -> None:
    text = header.read_text(encoding="utf-8")
    code = code_only(text)
    assert text.count("#pragma once") == 1
    if header_id(header) == "luch/math/bounds.h":  # names the host's doubles, too
        code = re.sub(r"^inline constexpr double [^;]+;", "", code, flags=re.MULTILINE)
    doubles = re.findall(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+)(?:[eE][+-]?\d+)?(?![\w.])", code)
    doubles = [literal for literal in doubles if re.search(r"[.eE]", literal)]
    assert not doubles, f"double literals make slow .f64 instructions: {doubles[:5]}"
    for word in ("throw", "new", "malloc", "dynamic_cast", "std"):
        assert not re.search(rf"(?<![\w.]){word}\b(?!\s*:(?!:))", code), f"`{word}` has no place in a shared header"
    # A static member function or constexpr constant is no state; a static variable is.
    states = re.findall(r"\bstatic\s+(?!constexpr|inline|LUCH_FN|_assert)[\w:<>]+\s+\w+\s*(?:=|;|\{)", code)
    assert not states, f"static state: {states}"
    if header.name != "platform.h":
        asks = re.findall(r"#\s*(?:if|ifdef|ifndef|elif)\b[^\n]*(?:__CUDA|__GNUC__|__clang__|_MSC_VER)[^\n]*", code)
        assert not asks, f"only platform.h asks which compiler reads it: {asks}"


def test_builtins_of_shared_headers_are_known_to_nvrtc() -> None:
    """nvcc takes GNU's builtins from the C++ compiler; NVRTC has only those that platform.h gives it."""
    known = set(re.findall(r"#define (__builtin_\w+)", (INCLUDE / "luch" / "platform.h").read_text(encoding="utf-8")))
    known |= {f"__builtin_{name}" for name in ("bit_cast", "ctz", "clz", "popcount", "fmaf", "convertvector")}
    for header in headers():
        used = set(re.findall(r"__builtin_\w+", code_only(header.read_text(encoding="utf-8"))))
        assert used <= known, f"{header_id(header)}: platform.h gives NVRTC no {sorted(used - known)}"


def test_cpu_sources_include_no_python_and_bindings_only_pybind11() -> None:
    for path in tracked(".h", ".cpp"):
        if path.is_relative_to(ROOT / "native" / "cpu"):
            offenders = [i for i in includes(path) if i.startswith(("pybind11", "Python", "bindings/", "cuda/"))]
            assert not offenders, f"{path.relative_to(ROOT)} includes {offenders}"
