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
from typing import Concatenate, ParamSpec, Self, TypeVar

import numpy as np

from atra.errors import ClosedError, InputError
from atra.geometry.mesh import Mesh

Given = ParamSpec("Given")
Returned = TypeVar("Returned")
Own = TypeVar("Own", bound="Lifetime")


def synchronized(method: Callable[Concatenate[Own, Given], Returned]) -> Callable[Concatenate[Own, Given], Returned]:
    """A method of a `Lifetime` that waits for the call in progress, so that all it reads belongs together."""

    @wraps(method)
    def waiting(self: Own, *arguments: Given.args, **named: Given.kwargs) -> Returned:
        with self._lock:
            return method(self, *arguments, **named)

    return waiting


class Lifetime(ABC):
    """What is built once, on first use, by `with` or by `build`, then used any number of times, and closed.

    `with` builds on entry and closes on exit, or at once where building fails. Calls of several threads wait for each
    other. plan_time_s, build_time_s: seconds that planning and building took, 0 before.

    A subclass says how in `_build`. Its public calls read what may change inside `_in_use()` or `synchronized`.
    """

    def __init__(self) -> None:
        self.plan_time_s = self.build_time_s = 0.0
        # Frames share buffers, and a scene must stay while it is traced.
        self._lock = threading.RLock()
        self._is_built = self._is_closed = False

    @abstractmethod
    def _build(self) -> tuple[float, float]:
        """Build everything; returns the seconds of planning and of building."""

    @abstractmethod
    def _release(self) -> None:
        """Let go of everything, however far it came; called once."""

    def build(self) -> None:
        """Build now rather than on first use, or rebuild. Raises ClosedError after `close`."""
        with self._lock:
            self._check_open()
            self._is_built = False
            self.plan_time_s, self.build_time_s = self._build()
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
