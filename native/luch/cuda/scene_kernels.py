"""The stages of the wavefront for one scene: compiled for it, or the general ones until those are ready."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from luch.cuda import compiler
from luch.cuda import plan as plans
from luch.cuda.device import DeviceError, Kernel, Module, architecture_of, cupy
from luch.cuda.programs import INSTRUCTION, Linked, operations, source
from luch.kept import kind_of_view
from luch.same import same
from luch.scene import Scene

STAGES = "RENDER_STAGES"
# Registers of the interpreter of the general kernels (native/cuda/render/interpreter.cuh).
INTERPRETER_REGISTERS = 256


def structure_flags(kind: str) -> list[str]:
    """For kernels that trace single rays themselves. kind: a structure, as "KD_TREE"."""
    name = "".join(part.capitalize() for part in kind.split("_"))
    return [f"-DLUCH_STRUCTURE={name}", f"-DLUCH_STRUCTURE_HEADER=<luch/accel/{kind.lower()}.h>"]


class Sources(NamedTuple):
    """What a scene's own kernels are compiled from."""

    programs: str  # text of luch_scene_programs.cuh
    flags: list[str]  # beside those of the precision
    plan: dict[str, bool | int]  # LUCH_PLAN_... by name
    operations: set[str]  # that its programs hold


def sources_of(facts: dict[str, Any], blocks: list[tuple[str, Any]], scene: Scene) -> Sources:
    """facts, blocks: core.render.Renderer.device_facts and its RenderTask's blocks."""
    arrays = dict(blocks)
    programs = [Linked(*row) for row in facts["programs"]]
    instructions = np.frombuffer(arrays["instructions"], INSTRUCTION)
    operands = np.frombuffer(arrays["operands"], np.uint32)
    held = operations(programs, instructions)
    plan = plans.plan_of(scene, held, facts)
    flags = [
        "-DLUCH_SCENE_PROGRAMS",
        f"-DLUCH_TRANSPARENT={int(facts['transparent'])}",
        *structure_flags(facts["structure"]),
        *plans.flags(plan),
    ]
    return Sources(source(programs, facts["materials"], instructions, operands), flags, plan, held)


class SceneKernels:
    """``kernel(name)`` is the best that is there at the moment; asked anew at every wave."""

    def __init__(self, facts: dict[str, Any], blocks: list[tuple[str, Any]], scene: Scene,
                 goes_on: Callable[[], bool] | None = None) -> None:  # fmt: skip
        """As sources_of(). goes_on: asked while there is nothing but to wait for the compiler; NotWanted where it says
        no.
        """
        self._text, self._flags, self.plan, self._operations = sources_of(facts, blocks, scene)
        self._view = kind_of_view(scene)
        self._precision, self._wanted = scene.settings.precision, scene.settings.own_kernels
        self._module: Module | None = None
        self._under_way: compiler.Compilation | None = None
        self.compile_seconds = 0.0
        self.general = self._changed = False
        self._start(facts, goes_on)

    @property
    def settled(self) -> bool:
        """Whether these kernels drew all so far, and no others are on their way."""
        return not self._changed and self._under_way is None

    def serve(self, facts: dict[str, Any], scene: Scene) -> bool:
        """Whether another view of the same scene needs the same code."""
        view = kind_of_view(scene)
        if scene.settings.own_kernels != self._wanted:
            return False
        if not same(view, self._view):
            if plans.plan_of(scene, self._operations, facts) != self.plan:
                return False
            self._view = view
        return True

    def _start(self, facts: dict[str, Any], goes_on: Callable[[], bool] | None) -> None:
        architecture = architecture_of(cupy())
        usable = facts["structure"] == "CWBVH" and facts["registers"] <= INTERPRETER_REGISTERS
        usable = usable and not self.plan["TIME"]  # the clocks of other code would tell other prices
        usable = usable and not self.plan["PHOTONS"]  # which general kernels lack
        flags = compiler.ready_made(STAGES)[0]
        general = compiler.ahead_file(STAGES, self._precision, architecture, flags) if usable else None
        self.has_general = general is not None
        if self._wanted or general is None:
            kept = compiler.kept(STAGES, self._precision, architecture, self._text, self._flags)
            if kept is not None:
                self._module = self._loaded(kept)
                return
            self._compile(architecture)
        if general is not None:
            self._module, self.general = self._loaded(general.read_bytes()), True
        elif self._under_way is not None:
            self._take(goes_on)

    def _compile(self, architecture: int) -> None:
        self._under_way = compiler.compiling(STAGES, self._precision, architecture, self._text, self._flags)

    def _take(self, goes_on: Callable[[], bool] | None) -> None:
        """The scene's own, which are waited for where they still compile."""
        compilation = self._under_way
        assert compilation is not None
        try:
            image = compilation.wait(goes_on)
        except compiler.NotWanted:
            raise
        except Exception as failure:  # whatever it was, of the compiler's thread
            raise DeviceError(f"The kernels of this scene do not compile: {failure}") from failure
        self._changed = self._module is not None
        self._module, self._under_way, self.general = self._loaded(image), None, False
        self.compile_seconds = compilation.seconds

    def _loaded(self, image: bytes) -> Module:
        self.code_bytes = len(image)  # of all stages, tables of constants included
        return compiler.scene_module(image, int(cupy().cuda.Device().id))

    def kernel(self, name: str) -> Kernel:
        """Between two waves the scene's own kernels take over from the general ones: the same results."""
        if self._under_way is not None and not self._under_way.is_alive():
            self._take(None)
        assert self._module is not None
        return self._module.kernel(name)
