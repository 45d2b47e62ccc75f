"""Kernels that another process compiles while this one compiles others."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numba
import pytest

import atra
from atra.compiled import beside, store
from atra.compiled.instruction_sets import native_lanes
from atra.exact import settling_kernels, ties_kernels
from atra.raster import clusters, culling
from atra.raster.drawing import drawing_kernel
from atra.raster.frames import compile_drawing, compile_other_kernels
from tests.compiled.test_kernel_cache import TWO_KINDS, imported
from tests.meshes import cornell_box, cornell_camera


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The commands of processes that would have been started."""
    commands: list[list[str]] = []

    class Process:
        def __init__(self, command: list[str], **_: object) -> None:
            commands.append(command)

        def wait(self) -> int:
            return 0

    monkeypatch.setattr(subprocess, "Popen", Process)
    monkeypatch.setenv(beside.VARIABLE, "1")
    monkeypatch.setattr(beside, "resolve_threads", lambda threads: 2)
    return commands


@pytest.fixture
def unkept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> object:
    """A kernel that is compiled nowhere yet."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "kept"))
    path = tmp_path / "two_kinds.py"
    path.write_text(TWO_KINDS)
    return imported(path).half


def test_a_kernel_that_is_kept_nowhere_is_compiled_in_another_process(started: list[list[str]], unkept: object) -> None:
    beside.compile_beside(unkept, compile_drawing, 8, False)
    assert [command[0] for command in started] == [sys.executable]
    assert started[0][2] == "from atra.raster.frames import compile_drawing as f; f(*(8, False))"


@pytest.mark.parametrize("reason", ["in memory", "on disk", "one core", "switched off", "nowhere to keep it", "frozen"])
def test_no_process_is_started_where_it_would_not_help(
    reason: str, started: list[list[str]], unkept: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = unkept
    if reason in ("in memory", "on disk"):
        kernel(3)  # type: ignore[operator]
    if reason == "on disk":
        kernel = imported(tmp_path / "two_kinds.py").half
        assert not kernel.overloads
    elif reason == "one core":
        monkeypatch.setattr(beside, "resolve_threads", lambda threads: 1)
    elif reason == "switched off":
        monkeypatch.setenv(beside.VARIABLE, "0")
    elif reason == "nowhere to keep it":
        monkeypatch.setattr(beside, "cache_folder", lambda: None)
    elif reason == "frozen":
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    beside.compile_beside(kernel, compile_drawing, 8, False)
    assert not started


def test_where_no_process_can_be_started_this_one_goes_on(unkept: object, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise PermissionError("no processes here")

    monkeypatch.setattr(subprocess, "Popen", refused)
    monkeypatch.setattr(beside, "resolve_threads", lambda threads: 2)
    monkeypatch.setenv(beside.VARIABLE, "1")
    beside.compile_beside(unkept, compile_drawing, 8, False)


KERNELS = [
    kernel
    for room in (clusters, culling, settling_kernels, ties_kernels)
    for kernel in vars(room).values()
    if hasattr(kernel, "overloads") and kernel._cache.cache_path
]


@pytest.mark.parametrize("parallel", [False, True])
def test_what_is_compiled_before_a_frame_is_what_the_frame_calls(parallel: bool) -> None:
    def forget() -> None:
        for kernel in KERNELS:
            kernel._reset_overloads()

    forget()
    mesh = cornell_box()
    camera = atra.OrthographicCamera((0, 0, 3), (0, 0, 0), width=8, height=8) if parallel else cornell_camera(8, 8)
    with atra.RasterTracer(mesh, camera) as tracer:
        tracer.trace()
    drawing = drawing_kernel(native_lanes(), parallel)
    drawn = list(drawing.overloads)
    compile_drawing(native_lanes(), parallel)
    assert list(drawing.overloads) == drawn
    called = {kernel: set(kernel.overloads) for kernel in KERNELS if kernel.overloads}
    assert {clusters.number_triangles, culling.cull_clusters, ties_kernels.find_overlaps} <= set(called)
    forget()
    compile_other_kernels(parallel)
    for kernel, signatures in called.items():
        assert signatures <= set(kernel.overloads), kernel


def test_the_process_beside_keeps_what_this_one_then_loads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "two_kinds.py").write_text(TWO_KINDS + "\ndef compile_half():\n    half(3)\n")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setenv(beside.VARIABLE, "1")
    monkeypatch.setattr(beside, "resolve_threads", lambda threads: 2)
    monkeypatch.syspath_prepend(tmp_path)
    processes = []
    real = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: processes.append(real(*a, **k)) or processes[-1])
    module = imported(tmp_path / "two_kinds.py")
    beside.compile_beside(module.half, module.compile_half)
    assert processes[0].wait(timeout=120) == 0
    assert store.is_kept(module.half)
    assert not module.half.overloads
    assert module.half(42) == 21
