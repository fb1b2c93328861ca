"""The CUDA kernels through nvcc, without a GPU: to PTX, and on to machine code for every architecture of kernels.json."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from buildtools.failure import BuildFailure
from buildtools.places import BUILD, NATIVE, VENV_PYTHON
from buildtools.run import output

FOLDER = BUILD / "kernels"
AHEAD = NATIVE / "luch" / "kernels"
DEFAULT = "WATERTIGHT"
OLDEST = 75  # PTX for it runs on everything newer
# Box distances are rounded once, on purpose (accel/wide_ray.h): in the compressed wide tree, which every scene's top is.
FUSES_BOXES = re.compile("CWBVH|TRACE_.*|RENDER_STAGES|RENDER_WALKS")
# Where a walk is in doubt, its cells are found in double (accel/grid.h).
WALKS_IN_DOUBLE = re.compile("(TRACE_)?(HIERARCHICAL_)?GRID")
# Kernels that hold all that any scene may need: compiled as a whole, ptxas copies every function into each kernel that
# calls it, 228 s and 10 MB an architecture; as functions that stand once, and linked, it takes 9 s and 3.5 MB. By a
# user's driver they would be compiled as a whole: luch.cuda.compiler has them compiled for the scene instead.
LINKED = ("RENDER_STAGES",)
LINKED_REGISTERS = 128  # of functions that stand apart: as the stages have them
# Functions of rare effects, which modules that serve many scenes lack.
OF_RARE = re.compile("closest_moving|any_moving|test_piece|move_instance")


class Unit(NamedTuple):
    """What is compiled once for each architecture."""

    module: str
    precision: str
    defines: Tuple[str, ...] = ()


def table() -> Dict[str, Any]:
    """native/cuda/kernels.json."""
    result: Dict[str, Any] = json.loads((NATIVE / "cuda" / "kernels.json").read_text(encoding="utf-8"))
    return result


def units() -> List[Unit]:
    """Every module and tracer in every precision, and what kernels.json says of defines; the longest to compile, the
    stages, first.
    """
    precisions = [name for name in table()["flags"] if name != "all"]
    served = [(name, DEFAULT) for name in [*table()["stages"], *table()["builders"]]]
    served += [(module, precision) for module in _traced() for precision in precisions]
    result = []
    for module, precision in served:
        every = table()["ahead"].get(module, [[]])
        result += [Unit(module, precision, tuple(defines)) for defines in (every if precision == DEFAULT else [[]])]
    return sorted(result, key=lambda unit: unit.module not in LINKED)


def _traced() -> Dict[str, str]:
    """What walks structures: bare, and in a render."""
    return {**table()["modules"], **table()["tracers"]}


def compile_kernels(everywhere: bool) -> Optional[Dict[Unit, Path]]:
    """PTX of every unit, and FOLDER/MODULE-PRECISION-sm_XX.cubin. None where no nvcc is. Raises BuildFailure.

    everywhere: all units for all architectures; else those of the default precision, the others for the oldest and the
    newest.
    """
    nvcc = shutil.which("nvcc")
    if nvcc is None:
        return None
    found = nvcc
    FOLDER.mkdir(parents=True, exist_ok=True)

    def to_ptx(unit: Unit) -> str:
        flags = table()["flags"]["all"] + table()["flags"][unit.precision] + list(unit.defines)
        flags += ["-rdc=true"] if unit.module in LINKED else []
        folders = ["-I", str(NATIVE / "include"), "-I", str(NATIVE / "cuda")]
        source = NATIVE / "cuda" / {**_traced(), **table()["builders"], **table()["stages"]}[unit.module]
        return _errors(
            [found, "-ptx", f"-arch=compute_{OLDEST}", *flags, *folders, str(source), "-o", str(ptx_of(unit))]
        )

    def to_cubin(task: Tuple[Unit, int]) -> str:
        unit, architecture = task
        ptx, target = str(ptx_of(unit)), f"-arch=sm_{architecture}"
        cubin = str(_cubin_of(unit, architecture))
        if unit.module not in LINKED:
            return _errors([_beside(found, "ptxas"), target, ptx, "-o", cubin])
        parts = f"{cubin}.o"
        return _errors(
            [_beside(found, "ptxas"), "-c", f"-maxrregcount={LINKED_REGISTERS}", target, ptx, "-o", parts]
        ) or _errors([_beside(found, "nvlink"), target, parts, "-o", cubin])

    def wanted(unit: Unit) -> List[int]:
        known: List[int] = table()["architectures"]
        return known if everywhere or unit.precision == DEFAULT else [known[0], known[-1]]

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        failures = [text for text in pool.map(to_ptx, units()) if text]
        if not failures:
            tasks = [(unit, architecture) for unit in units() for architecture in wanted(unit)]
            failures = [text for text in pool.map(to_cubin, tasks) if text]
    if failures:
        print("\n".join(failures)[:8000])
        raise BuildFailure(f"{len(failures)} kernels do not compile")
    return {unit: ptx_of(unit) for unit in units()}


def ptx_of(unit: Unit) -> Path:
    """Where a unit's PTX lies."""
    words = [word.split("LUCH_PLAN_")[-1].replace("=", "") for word in unit.defines]
    return FOLDER / ("-".join([unit.module, unit.precision, *words]) + ".ptx")


def _cubin_of(unit: Unit, architecture: int) -> Path:
    return FOLDER / f"{ptx_of(unit).stem}-sm_{architecture}.cubin"


def _beside(nvcc: str, tool: str) -> str:
    path = Path(nvcc).resolve().with_name(tool)
    return str(path) if path.exists() else tool


def _errors(command: List[str]) -> str:
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    return "" if result.returncode == 0 else f"{' '.join(command)}:\n{result.stdout}{result.stderr}"


def faults(unit: Unit, ptx: str) -> List[str]:
    """What a unit's instructions must not hold: slow doubles where speed is asked, sums fused behind our back."""
    module, precision, defines = unit
    wrong = []
    if precision == "FAST" and not WALKS_IN_DOUBLE.fullmatch(module) and re.search(r"\.f64\b", ptx):
        wrong.append("instructions in double precision (.f64), which FAST must not have")
    if precision != "FAST" and re.search(r"\bfma\.rn\.f64\b", ptx):
        wrong.append("fma.rn.f64: an edge function is contracted")
    if precision != "FAST" and not FUSES_BOXES.fullmatch(module) and re.search(r"\bfma\.rn\.f32\b", ptx):
        wrong.append("fma.rn.f32: results would differ from the CPU's")
    if precision != "FAST" and re.search(r"\.ftz\b", ptx):
        wrong.append(".ftz: denormal numbers would be lost")
    rare = OF_RARE.search(ptx) if module.startswith("TRACE_") and not defines else None
    if rare:
        wrong.append(f"{rare.group()}: code of an effect that most scenes lack")
    return [f"{module}, {precision}: {text}" for text in wrong]


def check_kernels() -> None:
    """For the gate: all compile for all architectures, and their PTX is what precision promises."""
    compiled = compile_kernels(everywhere=False)
    if compiled is None:
        print("   left out: no nvcc on PATH")
        return
    wrong = [text for unit, path in compiled.items() for text in faults(unit, path.read_text(encoding="utf-8"))]
    if wrong:
        print("\n".join(wrong))
        raise BuildFailure(f"{len(wrong)} faults in the PTX of kernels")
    print(f"   {len(compiled)} units for {', '.join(f'sm_{a}' for a in table()['architectures'])}")


def place_kernels() -> None:
    """For `build --cuda`: the machine code under the names that luch.cuda looks for, in native/luch/kernels."""
    if compile_kernels(everywhere=True) is None:
        raise BuildFailure("build --cuda needs nvcc on PATH; without it kernels are compiled on first use by NVRTC")
    code = (
        "import json, sys; from luch.cuda.compiler import ahead_name; "
        "print(json.dumps([ahead_name(*each) for each in json.loads(sys.argv[1])]))"
    )
    wanted = [(unit, architecture) for unit in units() for architecture in table()["architectures"]]
    wanted += [(unit, 0) for unit in units() if unit.module not in LINKED]
    asked = [(unit.module, unit.precision, architecture, unit.defines) for unit, architecture in wanted]
    names = output([str(VENV_PYTHON), "-c", code, json.dumps(asked)])
    if names is None:
        raise BuildFailure("luch.cuda could not be imported from native/")
    shutil.rmtree(AHEAD, ignore_errors=True)
    AHEAD.mkdir()
    for (unit, architecture), name in zip(wanted, json.loads(names)):
        shutil.copyfile(_cubin_of(unit, architecture) if architecture else ptx_of(unit), AHEAD / name)
    size = sum(path.stat().st_size for path in AHEAD.iterdir())
    print(f"{len(wanted)} kernels, {size / 1e6:.0f} MB in {AHEAD}; the next package carries them")
