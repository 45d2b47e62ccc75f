"""The lifetime of tracers, ray scenes, renderers and bakers: built on first use, used any number of times, closed.

One rule for threads holds for all of them. Several threads may call in any order; each call waits for the one in
progress. So a call sees one camera and one mesh completely: those of the last `look` and `update` before it. After
`close` a call raises ClosedError, unless it only hands out what was found before. Memory given as `out` belongs to the
call: no other thread may use it until the call returns. Functions called from within, such as `stop` of a renderer, run
in worker threads and must not call the object that calls them: both would wait for each other.

An object dropped without `close` is released at once: it does not refer to itself, and neither its worker threads nor
its Embree device refer to it.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import TracebackType
from typing import Any, Concatenate, Generic, ParamSpec, Self, TypeVar

import numpy as np

from atra.errors import ClosedError, InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset

Given = ParamSpec("Given")
Returned = TypeVar("Returned")
Result = TypeVar("Result")
Own = TypeVar("Own", bound="Lifetime")


def in_turn(method: Callable[Concatenate[Own, Given], Returned]) -> Callable[Concatenate[Own, Given], Returned]:
    """A method of a `Lifetime` that waits for calls in progress, so that all it reads belongs together."""

    @wraps(method)
    def waiting(self: Own, *arguments: Given.args, **named: Given.kwargs) -> Returned:
        with self._lock:
            return method(self, *arguments, **named)

    return waiting


class Lifetime(ABC):
    """What is built once, on first use, by `with` or by `build`, then used any number of times, and closed.

    `with` builds on entry and closes on exit, or at once where building fails. Calls of several threads are taken in
    turn (`atra.tracing.lifetime`). plan_time_s, build_time_s: seconds that planning and building took, 0 before.

    A subclass says how in `_plan` and `_build`. Its public calls read what may change inside `_in_use()` or `in_turn`.
    """

    def __init__(self) -> None:
        self.plan_time_s = self.build_time_s = 0.0
        # Frames share buffers, and a scene must stay while it is traced.
        self._lock = threading.RLock()
        self._is_built = self._is_closed = False

    @abstractmethod
    def _plan(self) -> float:
        """Prepare on the CPU what does not change from frame to frame; returns the seconds to count."""

    @abstractmethod
    def _build(self) -> float:
        """Build the BVH, or what stands for it, over what is planned; returns the seconds to count."""

    @abstractmethod
    def _release(self) -> None:
        """Let go of everything, however far it came; called once."""

    def build(self) -> None:
        """Plan and build now rather than on first use, or anew. Raises ClosedError after `close`."""
        with self._lock:
            self._check_open()
            self._is_built = False
            self.plan_time_s = self._plan()
            self.build_time_s = self._build()
            self._is_built = True

    @contextmanager
    def _in_use(self) -> Iterator[None]:
        """As long as it lasts nothing else happens. Builds first where that was not done; raises ClosedError."""
        with self._lock:
            self._check_open()
            if not self._is_built:
                self.build()
            yield

    def _check_open(self) -> None:
        if self._is_closed:
            raise ClosedError(f"this {type(self).__name__} is closed; make a new one")

    def close(self) -> None:
        """Release what was planned and built; waits for a frame in progress. Closing twice is harmless."""
        with self._lock:
            if not self._is_closed:
                self._is_closed = True
                self._release()

    def __enter__(self) -> Self:
        try:
            self.build()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class MeshLifetime(Lifetime):
    """The lifetime of what is built over a mesh, whose vertices `update` changes."""

    mesh: Mesh

    @abstractmethod
    def _take(self, mesh: Mesh) -> None:
        """Take the mesh, and all that hangs on it; changes nothing where it is refused."""

    def update(self, mesh: Mesh) -> None:
        """Go on with `mesh`: other vertices, such as another pose, of the same faces.

        What is built is built anew at once; where that fails, the next use builds again.
        Raises InputError for other faces, and what making and building a new one would; ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            check_same_faces(self.mesh, mesh)
            self._take(mesh)
            self._build_again()

    def _build_again(self) -> None:
        if self._is_built:
            self.build()


class TracerLifetime(MeshLifetime, Generic[Result]):
    """The lifetime of a tracer, whose camera `look` changes. Result: what `trace` returns."""

    camera: View

    @abstractmethod
    def _trace(self, offset: tuple[float, float], out: Any) -> Result:
        """One frame, while nothing else happens."""

    @abstractmethod
    def _show(self, mesh: Mesh, camera: View) -> None:
        """Take mesh and camera, and all that hangs on them; changes nothing where they are refused."""

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Result | None = None) -> Result:
        """Trace one frame; all rays go through sub-pixel position `offset` of their pixels, in [0, 1) x [0, 1).

        Builds first where that was not done. out: an earlier result of this tracer whose arrays are overwritten, which
        saves allocating an image; it must not be read any more.
        Raises InputError for an offset outside the pixel or an `out` that does not fit, ClosedError after `close`.
        """
        check_offset(offset)
        with self._in_use():
            return self._trace(offset, out)

    def _look(self, camera: View) -> bool:
        """Take the camera; returns whether what is built goes on serving."""
        self._show(self.mesh, camera)
        return False

    def look(self, camera: View) -> None:
        """Trace what `camera` sees from the next frame on; it may be of another size or kind.

        What hangs on the camera and is built is built anew at once, and the times say what that took. A camera that is
        refused changes nothing; where building fails, the next use builds again.
        Raises what making and building a new tracer would; ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            if not self._look(camera):
                self._build_again()

    def _take(self, mesh: Mesh) -> None:
        self._show(mesh, self.camera)


def check_same_faces(before: Mesh, mesh: Mesh) -> None:
    """Raise InputError where `mesh` is no other pose of the mesh before."""
    if mesh.faces.shape != before.faces.shape or len(mesh.vertices) != len(before.vertices):
        raise InputError(
            f"the mesh has {len(mesh.vertices):,} vertices and {mesh.triangle_count:,} triangles, expected other "
            f"vertices of the same faces, {len(before.vertices):,} and {before.triangle_count:,}; "
            "make a new object for another mesh"
        )
    if not np.array_equal(mesh.faces, before.faces):
        face = int(np.argmax((mesh.faces != before.faces).any(axis=1)))
        raise InputError(
            f"face {face} is {mesh.faces[face].tolist()}, expected {before.faces[face].tolist()} as before: update "
            "takes other vertices of the same faces; make a new object for another mesh"
        )
