"""What fails, and what is not there: promises 1, 2, 4, 5 and 19 of docs/reliability.md."""

from __future__ import annotations

import time
from typing import Any

import bpy
import numpy as np
import pytest
from luch.cuda import device as cuda_device
from support.endings import LATE_STAGES, STAGES
from support.promise_room import heavy, picture, raising

from addon import engine

CANCEL_S = 0.5  # from the first no to the end of the render
POLL_S = 0.1  # between two questions whether to go on
CI_SLACK = 3.0  # a loaded machine with two processors


@pytest.mark.promise(1)
@pytest.mark.parametrize("stage", STAGES + LATE_STAGES)
def test_any_stage_that_fails_ends_in_an_error_and_the_next_render_is_right(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    room.luch.samples = 2
    with monkeypatch.context() as broken:
        broken.setattr(stage, raising(RuntimeError(f"{stage} broke")))
        with pytest.raises(RuntimeError, match=r"Luch: .*broke \(RuntimeError\)"):
            bpy.ops.render.render(write_still=True)
    assert picture(room).any()


class Unspeakable(Exception):
    """Whose text cannot be had."""

    def __str__(self) -> str:
        raise ValueError("no text")


@pytest.mark.promise(2)
@pytest.mark.parametrize(
    ("error", "told"),
    [(ZeroDivisionError(), "ZeroDivisionError"), (OSError(28, "No space left on device"), "No space left"),
     (MemoryError(), "not enough memory"), (Unspeakable(), "Unspeakable"), (RecursionError("deep"), "deep"),
     (StopIteration(), "StopIteration"), (SystemExit(3), "SystemExit"), (KeyboardInterrupt(), "interrupted")],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_every_exception_reaches_the_user_as_a_sentence(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, error: BaseException, told: str
) -> None:
    monkeypatch.setattr("luch.render.render", raising(error))
    with pytest.raises(RuntimeError, match=told):
        bpy.ops.render.render(write_still=True)


@pytest.mark.promise(4)
def test_a_render_asks_ten_times_a_second_whether_to_go_on_and_ends_half_a_second_after_a_no(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    heavy(room)
    asked: list[float] = []

    def stops_after_a_second(self: Any) -> bool:
        asked.append(time.monotonic())
        return asked[-1] - asked[0] > 1.0

    delivered: list[float] = []
    leave = engine.ResultWriter.__exit__

    def noted(self: Any, *args: Any) -> None:
        leave(self, *args)
        delivered.append(time.monotonic())

    monkeypatch.setattr("addon.report.Reporter.user_wants_to_stop", stops_after_a_second)
    monkeypatch.setattr(engine.ResultWriter, "__exit__", noted)
    assert picture(room).shape == (256, 256, 4)
    no = next(moment for moment in asked if moment - asked[0] > 1.0)
    assert delivered[0] - no <= CANCEL_S * CI_SLACK
    gaps = np.diff([moment for moment in asked if moment <= no])
    assert np.median(gaps) <= 1.5 * POLL_S and gaps.max() <= 2 * POLL_S * CI_SLACK
    assert engine.last_stats[room.name]["stopped_by"] == "cancel"


@pytest.mark.promise(5)
@pytest.mark.parametrize("reason", ["No CUDA driver that CuPy can use", "CUDA needs CuPy", "compute capability 6.1"])
def test_without_a_gpu_that_can_be_used_the_cpu_renders_and_one_warning_says_why(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    expected = picture(room)
    room.luch.device = "CUDA"
    monkeypatch.setattr("luch.cuda.several.cupy", raising(cuda_device.DeviceError(reason)))
    assert np.array_equal(picture(room), expected)
    assert [text for text in engine.last_stats[room.name]["warnings"] if reason in text] == [
        f"Rendered on the CPU: {reason}"
    ]


class CUDADriverError(RuntimeError):
    """As CuPy raises it."""


CUDADriverError.__module__ = "cupy_backends.cuda.api.driver"


class BrokenRenderer:
    """On a GPU one of whose kernels trapped."""

    def stats(self) -> dict[str, int]:
        return {"film_pixel_bytes": 36}

    def prepare(self) -> bool:
        raise CUDADriverError("CUDA_ERROR_ILLEGAL_ADDRESS: an illegal memory access was encountered")

    def cancel(self) -> None:
        """Nothing runs."""


@pytest.mark.promise(19)
def test_a_kernel_that_faults_is_an_error_and_later_renders_go_to_the_cpu(
    room: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = picture(room)
    monkeypatch.setattr(cuda_device, "_lost", [])
    room.luch.device = "CUDA"
    with monkeypatch.context() as once:
        once.setattr("luch.cuda.several.renderer_for", lambda scene: BrokenRenderer())
        with pytest.raises(RuntimeError, match=r"GPU failed while it rendered.*ILLEGAL_ADDRESS.*started again"):
            bpy.ops.render.render(write_still=True)
    assert np.array_equal(picture(room), expected)
    assert "ILLEGAL_ADDRESS" in engine.last_stats[room.name]["warnings"][0]
