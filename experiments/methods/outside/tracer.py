"""A foreign method behind the `Tracer` protocol: made where it is measured, timed apart from all checks."""

from __future__ import annotations

import inspect
from time import perf_counter
from typing import Any, ClassVar, Protocol

import psutil

from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from experiments.harness.method import Tracing
from experiments.methods.one_view import OneViewTracer
from experiments.methods.outside.guards import ClockGuard, ThreadGuard, checked_images, delays_s, mesh_digest

_PIXEL_CENTRE = (0.5, 0.5)
_MESH_CHECKS = 3
"""Frames after which the mesh is looked at; after these, only when the tracer is closed."""


class ForeignMethod(Protocol):
    """What a class from outside offers; `atra new-method` writes one that works.

    Options: a dataclass of numbers, texts and truths with defaults; left out where there is nothing to choose. label:
    the name in figures; left out, that of the method. The constructor takes mesh, camera, options and `threads`, and
    `trace` answers with depth (H, W) floats along the view axis, inf = miss, and prim_id (H, W) integers, -1 or
    0xFFFFFFFF = miss. `trace(offset)` takes another sub-pixel position where the method can do that.
    time_s: seconds of the last frame by the method's own clock, where that knows better than the harness's.
    """

    Options: ClassVar[type]

    def __init__(self, mesh: Mesh, camera: View, options: Any, threads: int) -> None: ...

    def build(self) -> None: ...

    def trace(self) -> Any: ...

    def close(self) -> None: ...


class OutsideTracer(OneViewTracer):
    """A foreign method as a tracer. Nothing of it runs before `build`, so planning a sweep meets none of its faults.

    frame_time_s: seconds of the last frame, without the checks of what it returned. packet_width, embree_bytes: 0, as
    nobody tells.
    """

    packet_width = 0

    def __init__(self, kind: type[ForeignMethod], mesh: Mesh, camera: View, options: Any, tracing: Tracing) -> None:
        super().__init__()
        self._kind, self._options = kind, options
        self.threads = resolve_threads(tracing.threads)
        self._own: Any = None
        self.frame_time_s = 0.0
        self._show(mesh, camera)

    def _build(self) -> tuple[float, float]:
        self._end()
        self.frame_time_s = 0.0
        self._clock = ClockGuard(self.camera.width * self.camera.height)
        self._guard = ThreadGuard(self.threads, self._processes)
        self._digest, self._frames = mesh_digest(self.mesh), 0
        start = perf_counter()
        self._own = self._make_own()
        self._own.build()
        taken_s = perf_counter() - start
        self._check_mesh()
        return 0.0, taken_s

    def _make_own(self) -> Any:
        """Making it is part of its build time."""
        return self._kind(self.mesh, self.camera, self._options, threads=self.threads)

    def _trace(self, offset: tuple[float, float], out: Hits | None) -> Hits:
        """out: left alone; a foreign method answers with arrays of its own."""
        given = () if tuple(offset) == _PIXEL_CENTRE else (offset,)
        if given and not inspect.signature(self._own.trace).parameters:
            raise InputError(f"{self._kind.__name__}.trace takes no offset, so it traces pixel centres alone")
        processes = self._processes()
        self._guard.begin()
        before_s = delays_s(processes)
        start = perf_counter()
        found = self._own.trace(*given)
        waited_s = perf_counter() - start
        delayed_s = delays_s(processes) - before_s
        self._guard.end()
        self.frame_time_s = self._clock.frame_time_s(waited_s, getattr(self._own, "time_s", None), delayed_s)
        self._frames += 1
        if self._frames <= _MESH_CHECKS:
            self._check_mesh()
        images = checked_images(found, self.camera.height, self.camera.width, self.mesh.triangle_count)
        return Hits(*images, offset, self.mesh, self.camera, self.threads)

    def _check_mesh(self) -> None:
        if mesh_digest(self.mesh) != self._digest:
            raise InputError("the method changed the mesh, which other methods trace, too")

    def _processes(self) -> list[psutil.Process]:
        here = psutil.Process()
        return [here, *here.children(recursive=True)]

    def _end(self) -> None:
        own, self._own = self._own, None
        if own is not None:
            own.close()

    def _release(self) -> None:
        built = self._own is not None
        self._end()
        if built:
            self._check_mesh()
