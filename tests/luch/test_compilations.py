"""Kernels that compile while their scene is rendered: one compiler for all renders that wait for it. No GPU is needed."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from luch import core
from luch.cuda import compiler, plan, scene_kernels, trace
from luch.cuda.device import DeviceError
from luch.samplers import FAMILIES
from luch.scene import Scene, Settings
from support import cuda_on_cpu
from support.frames import resident_mib
from support.points import block

ASKED = ("RENDER_STAGES", "WATERTIGHT", 90, "programs", ("-DA=1",))
FACTS = {"programs": [], "materials": 0, "structure": "CWBVH", "registers": 8, "transparent": False}
BLOCKS = [("instructions", np.zeros(0, np.uint8)), ("operands", np.zeros(0, np.uint8))]


class Compiler:
    """In the place of NVRTC: compiles when it is let."""

    def __init__(self) -> None:
        self.may_end, self.calls, self.error = threading.Event(), 0, ""

    def __call__(self, *asked: Any) -> bytes:
        self.calls += 1
        assert self.may_end.wait(30.0)
        if self.error:
            raise DeviceError(self.error)
        return b"own"


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Iterator[Compiler]:
    made = Compiler()
    monkeypatch.setattr(compiler, "compiled", made)
    monkeypatch.setattr(compiler, "kept", lambda *asked: None)
    monkeypatch.setattr(compiler, "ahead_file", lambda *asked: SimpleNamespace(read_bytes=lambda: b"general"))
    monkeypatch.setattr(
        compiler, "scene_module", lambda image, device: SimpleNamespace(kernel=lambda name: (name, image))
    )
    monkeypatch.setattr(scene_kernels.plans, "plan_of", lambda *given: {"TIME": False, "PHOTONS": False})
    for user in (compiler, scene_kernels):
        monkeypatch.setattr(user, "architecture_of", lambda module: 90)
        monkeypatch.setattr(user, "cupy", lambda: SimpleNamespace(cuda=SimpleNamespace(Device=lambda: SimpleNamespace(id=0))))  # fmt: skip
    yield made
    made.may_end.set()
    assert compiler.quiet(30.0)


def frame() -> scene_kernels.SceneKernels:
    return scene_kernels.SceneKernels(dict(FACTS), BLOCKS, Scene())


@pytest.mark.promise(8)
def test_a_hundred_frames_that_are_drawn_meanwhile_start_one_compiler(slow: Compiler) -> None:
    threads = threading.active_count()
    frames = [frame() for _ in range(100)]
    assert threading.active_count() == threads + 1 and slow.calls == 1
    assert all(one.general and one.kernel("shade")[1] == b"general" for one in frames)
    slow.may_end.set()
    assert compiler.quiet(30.0)
    assert threading.active_count() == threads
    assert all(one.kernel("shade")[1] == b"own" and not one.general for one in frames)


def test_who_wants_general_kernels_alone_starts_no_compiler(slow: Compiler) -> None:
    lasting = Scene(settings=Settings(own_kernels=False))
    one = scene_kernels.SceneKernels(dict(FACTS), BLOCKS, lasting)
    assert (slow.calls, one.general, one.settled, one.kernel("shade")[1]) == (0, True, True, b"general")
    assert one.serve(dict(FACTS), lasting) and not one.serve(dict(FACTS), Scene())
    slow.may_end.set()
    beside = scene_kernels.SceneKernels(FACTS | {"structure": "KD_TREE"}, BLOCKS, lasting)  # which they do not serve
    assert (slow.calls, beside.general, beside.settled) == (1, False, True)


def test_times_are_told_to_be_mixed_where_kernels_change(slow: Compiler) -> None:
    begun = frame()
    assert not begun.settled
    slow.may_end.set()
    assert compiler.quiet(30.0) and begun.kernel("shade")[1] == b"own"
    assert not begun.settled, "some of it was drawn by others"


@pytest.mark.parametrize("effect", ["VOLUMES", "HAIR", "CURVES", "MOTION", "SUBSURFACE", "SAMPLER", "TIME", "PHOTONS"])
def test_whatever_a_scene_needs_general_kernels_begin_it(
    slow: Compiler, monkeypatch: pytest.MonkeyPatch, effect: str
) -> None:
    """All but the clocks of Render Time, as those of other code would tell other prices, and photon maps."""
    monkeypatch.setattr(scene_kernels.plans, "plan_of", lambda *given: {"TIME": False, "PHOTONS": False, effect: True})
    if effect in ("TIME", "PHOTONS"):
        slow.may_end.set()
    assert frame().general == (effect not in ("TIME", "PHOTONS"))


def test_kernels_beside_the_stages_are_compiled_ahead_for_all_that_moves_grows_and_draws() -> None:
    """Names under which they are looked for are those under which build.py places them; no scene waits for them."""

    def ready(module: str, defines: tuple[str, ...]) -> bool:
        placed = {compiler.ahead_name(module, "WATERTIGHT", 90, those) for those in compiler.ready_made(module)}
        return compiler.ahead_name(module, "WATERTIGHT", 90, defines) in placed

    samplers = [plan.sampler_flags(Scene(settings=Settings(sampler=name))) for name in FAMILIES]
    assert all(ready("RENDER_PATHS", flags) for flags in samplers) and len(set(samplers)) == len(FAMILIES)
    for moves in (False, True):
        assert all(ready("RENDER_WALKS", trace.MOVING * moves + flags) for flags in samplers)
        for curves in ("", *plan.CURVE_SHAPES):
            assert ready("TRACE_CWBVH", trace.ray_kernels("CWBVH", True, moves, curves)[0])
    assert not ready("TRACE_CWBVH", trace.TIMED_RAYS)


def test_who_cancels_does_not_wait_for_the_compiler(slow: Compiler, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no general kernels are: as long as the scene's own take, seconds, nobody was asked."""
    monkeypatch.setattr(compiler, "ahead_file", lambda *asked: None)
    asked: list[float] = []

    def goes_on() -> bool:
        asked.append(time.perf_counter())
        return len(asked) < 4

    began = time.perf_counter()
    with pytest.raises(compiler.NotWanted):
        scene_kernels.SceneKernels(dict(FACTS), BLOCKS, Scene(), goes_on)
    with pytest.raises(compiler.NotWanted):
        compiler.load("TRACE_BVH2", "WATERTIGHT", (), goes_on)
    assert len(asked) == 5 and time.perf_counter() - began < 0.5 + 5 * compiler.ASK_SECONDS
    slow.may_end.set()
    assert compiler.quiet(30.0)  # both went on
    assert slow.calls == 2


def test_a_process_that_ends_waits_for_its_compiler() -> None:
    """NVRTC in a thread that nobody waits for: "free(): invalid pointer" as the process ended."""
    lines = (
        "import time",
        "from luch.cuda import compiler",
        "compiler.compiled = lambda *asked: (time.sleep(0.5), print('compiled'))[0] or b''",
        "compiler.compiling('RENDER_STAGES', 'WATERTIGHT', 90, 'programs', ())",
        "print('ends')",
    )
    ended = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True,
                           env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})  # fmt: skip
    assert ended.stdout.split() == ["ends", "compiled"] and ended.stderr == ""


def test_scenes_that_differ_are_compiled_beside_each_other(slow: Compiler) -> None:
    first, other = compiler.compiling(*ASKED), compiler.compiling(*ASKED[:3], "others", ())
    assert first is not other and compiler.compiling(*ASKED) is first
    assert not compiler.quiet(0.0)
    slow.may_end.set()
    assert compiler.quiet(30.0) and first.image == other.image == b"own"
    assert compiler.compiling(*ASKED) is not first


def test_kernels_that_do_not_compile_are_told_by_every_frame_that_wants_them(slow: Compiler) -> None:
    slow.error = "no such word"
    frames = [frame(), frame()]
    slow.may_end.set()
    assert compiler.quiet(30.0)
    for one in frames:
        with pytest.raises(DeviceError, match="do not compile: no such word"):
            one.kernel("shade")


@pytest.mark.promise(8)
# luch.cuda.compiler asks glibc alone: malloc_trim is a function of its own.
@pytest.mark.skipif(sys.platform != "linux", reason="of glibc's heap")
def test_what_a_compiler_took_of_the_heap_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
    block = 100_000  # as compilers ask for: below what glibc takes from the system apart

    def hungry(nvrtc: Any, unit: Any) -> bytes:
        taken = [libc.malloc(block) for _ in range(1500)]
        for each in taken:
            ctypes.memset(each, 1, block)
        seen.append(resident_mib())
        for each in taken[:-1]:  # the last one stays above the others: free() alone gives nothing back
            libc.free(each)
        return b"own"

    libc.malloc_trim(0)  # what earlier tests left free would serve
    seen = [resident_mib()]
    monkeypatch.setattr(compiler, "_compile", hungry)
    monkeypatch.setattr(compiler, "cache_folder", lambda: None)
    assert compiler._compile_and_keep(None, compiler._Unit(*ASKED)) == b"own"
    assert seen[1] - seen[0] > 100.0
    assert resident_mib() - seen[0] < 20.0


# As a compiler for GPUs reads it; what C++ does not know there is not called.
DRAW = """unsigned __byte_perm(unsigned, unsigned, unsigned);
float __fmaf_rn(float, float, float);
#define __CUDACC__
#include "luch/sampling/sampler.h"
extern "C" void draw(unsigned seed, unsigned index, unsigned dimension, float* to) {
    luch::Sampler sampler{seed, index};
    luch::Vec3 three = luch::sample_3d(sampler, dimension);
    luch::Vec2 two = luch::sample_2d(sampler, dimension);
    float all[6] = {luch::sample_1d(sampler, dimension), two.x, two.y, three.x, three.y, three.z};
    for (int k = 0; k < 6; ++k) to[k] = all[k];
}
"""


def test_general_kernels_draw_from_the_family_that_a_dimension_names(tmp_path: Path) -> None:
    """Compiled for a GPU without a family they drew Sobol's points for all: other numbers than the scene's own."""
    (flags,) = compiler.ready_made(scene_kernels.STAGES)
    kernels = cuda_on_cpu.library(DRAW, tmp_path, list(compiler.source_folders()), flags)
    drawn = (ctypes.c_float * 6)()
    for family in range(len(FAMILIES)):
        dimension = 6 + (family << 30)
        for index in (0, 1, 12345):
            kernels.draw(9, index, dimension, drawn)
            (told,) = core.sampling.sample_any(9, block(index, 1), dimension)
            np.testing.assert_array_equal(np.array(drawn), told[[0, 0, 1, 0, 1, 2]])
