"""What a foreign method is held to: whole images, a clock that can be true, its threads, and a mesh left as it was."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import psutil
from numpy.typing import NDArray

from atra.errors import ClockError, InputError
from atra.geometry.mesh import Mesh
from atra.prim_ids import MISS

_FRAMES_TO_JUDGE = 3
"""Frames after which the method's own clock is judged by the shortest frame; one alone may have been disturbed."""

_LEAST_SHARE = 0.5
"""Share of the wait that the method's own clock must tell of, after what handing over the image may take."""

_HAND_OVER_S, _HAND_OVER_S_PER_RAY = 2e-4, 16e-9
"""Time that handing over an image may take: 8 bytes a ray at half a gigabyte a second."""

_SETTLE_S, _WATCH_S, _SPIN_S = 0.25, 0.2, 0.02
"""So long after a frame, threads are watched for so long: one that runs for the last of these times or longer waits by
spinning, as Embree's workers do, and traces nothing."""

_BUSY_S, _BUSY_SHARE = 0.03, 0.05
"""CPU seconds, and share of those of the busiest thread, above which a thread counts as one that traces. Seconds of the
clock would count fewer threads on a busy machine."""


def check_images(depth: NDArray[np.float32], prim_id: NDArray[np.uint32], triangles: int) -> None:
    """Raise InputError for NaN, which are pixels that were not drawn, too, for ids that the mesh does not have, and for
    pixels where one array says hit and the other one miss."""
    if np.isnan(depth).any():
        y, x = np.argwhere(np.isnan(depth))[0]
        raise InputError(f"draw left a depth of NaN at pixel ({x}, {y}), expected inf for a miss")
    unknown = (prim_id >= triangles) & (prim_id != MISS)
    if unknown.any():
        raise InputError(f"draw wrote prim_id {prim_id[unknown][0]}, expected one below {triangles} or {MISS:#x}")
    torn = (prim_id == MISS) != np.isinf(depth)
    if torn.any():
        y, x = np.argwhere(torn)[0]
        raise InputError(
            f"draw wrote depth {depth[y, x]} and prim_id {prim_id[y, x]} at pixel ({x}, {y}), "
            f"expected inf and {MISS:#x} for a miss"
        )


def mesh_digest(mesh: Mesh) -> tuple[int, int]:
    """Check sums of vertices and faces."""
    return crc32(mesh.vertices.data), crc32(mesh.faces.data)


def check_mesh(mesh: Mesh, digest: tuple[int, int]) -> None:
    """Raise InputError where the mesh has other check sums."""
    if mesh_digest(mesh) != digest:
        raise InputError("the method changed the mesh, which other methods trace, too")


class ClockGuard:
    """Seconds of frames by the method's own clock, where it has one, judged by the harness's."""

    def __init__(self, rays: int) -> None:
        self._allowed_s = _HAND_OVER_S + _HAND_OVER_S_PER_RAY * rays
        self._waited: list[float] = []
        self._told: list[float] = []

    def frame_time_s(self, waited_s: float, told: Any, delayed_s: float = 0.0) -> float:
        """The seconds of a frame. told: None = the method has no clock. delayed_s: as of `delays_s`, part of the wait.
        Raises ClockError for a time that is no positive number, longer than the wait, or so short that the rest of the
        wait cannot be explained."""
        if told is None:
            return waited_s
        if isinstance(told, bool) or not isinstance(told, int | float) or not 0.0 < told <= waited_s:
            raise ClockError(f"the method says that a frame took {told!r} s; the harness waited {waited_s:.3g} s")
        self._waited.append(waited_s - delayed_s)
        self._told.append(float(told))
        least = _LEAST_SHARE * (min(self._waited) - self._allowed_s)
        if len(self._told) >= _FRAMES_TO_JUDGE and min(self._told) < least:
            raise ClockError(
                f"the method says that a frame took {min(self._told):.3g} s; the harness never waited less than "
                f"{min(self._waited):.3g} s"
            )
        return float(told)


def delays_s(processes: Iterable[psutil.Process]) -> float:
    """Seconds for which the main threads of processes could run but had no core, since they began; 0 where the system
    does not tell."""
    nanoseconds = 0
    for process in processes:
        with suppress(OSError, IndexError, ValueError):
            nanoseconds += int(Path(f"/proc/{process.pid}/schedstat").read_text(encoding="ascii").split()[1])
    return 1e-9 * nanoseconds


class ThreadGuard:
    """Counts the threads that run while frames are traced. processes: those of the method, asked for after a frame."""

    def __init__(self, threads: int, processes: Callable[[], list[psutil.Process]]) -> None:
        self._threads, self._processes = threads, processes
        self._known: list[psutil.Process] = []
        self._before: dict[tuple[int, int], float] = {}
        self._busy_s: dict[tuple[int, int], float] = defaultdict(float)
        self._spinning: set[tuple[int, int]] = set()

    def begin(self) -> None:
        """A frame begins."""
        self._before = self._cpu_times()

    def end(self) -> None:
        """A frame has ended. Raises InputError once more threads have run than the point has."""
        if not self._known:  # what the first frame started is known from now on
            self._known = self._processes()
            return
        for thread, cpu_s in self._cpu_times().items():
            self._busy_s[thread] += cpu_s - self._before.get(thread, 0.0)
        least = max(_BUSY_S, _BUSY_SHARE * max(self._busy_s.values(), default=0.0))
        busy = {thread for thread, cpu_s in self._busy_s.items() if cpu_s >= least} - self._spinning
        if len(busy) > self._threads:
            self._spinning |= self._found_spinning()
            busy -= self._spinning
        if len(busy) > self._threads:
            raise InputError(f"the method ran {len(busy)} threads, the point has threads={self._threads}")

    def _found_spinning(self) -> set[tuple[int, int]]:
        """Threads that run while nothing is traced."""
        time.sleep(_SETTLE_S)
        before = self._cpu_times()
        time.sleep(_WATCH_S)
        return {thread for thread, cpu_s in self._cpu_times().items() if cpu_s - before.get(thread, 0.0) >= _SPIN_S}

    def _cpu_times(self) -> dict[tuple[int, int], float]:
        times_s: dict[tuple[int, int], float] = {}
        for process in self._known:
            with suppress(psutil.Error, OSError):
                for thread in process.threads():
                    times_s[process.pid, thread.id] = thread.user_time + thread.system_time
        return times_s
