"""The lifetime of a tracer: planned, built, traced and closed, one call at a time.

The rule for threads, of all tracers, ray scenes, renderers and bakers. Calls of several threads may come in any order;
each waits for the one in progress. So a call sees one camera (or scene) completely: that of the last `look` (or
`update`) before it, whatever other threads ask for meanwhile. After `close` a call raises EmbreeError, unless it only
hands out what was found before. Memory given as `out` belongs to the call: no other thread may use it until it returns.
Functions that are called from within, such as `stop` of a renderer, run in worker threads and must not call the object
that they are called by: they would wait for each other.

What is dropped without `close` is released at once: no object of these refers to itself, and neither worker threads
nor Embree's devices refer to the object that they work for.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import TracebackType
from typing import Any, Concatenate, Generic, ParamSpec, Self, TypeVar

from atra.errors import EmbreeError
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
    """What is planned and built once, by `with` or by hand, traced any number of times, and closed.

    `with` plans and builds on entry, and closes on exit, or at once where that fails. Calls of several threads are
    taken in turn (`atra.tracing.lifetime`). plan_time_s, build_time_s: seconds each took, 0 before.

    Subclasses say how: `_plan` and `_build` prepare, and public calls read what may change inside `_tracing()` or
    `in_turn`; whether they work with Embree, with another library or by other tracers is theirs.
    """

    def __init__(self) -> None:
        self.plan_time_s = self.build_time_s = 0.0
        # Frames share buffers, and a scene must stay while it is traced.
        self._lock = threading.RLock()
        self._is_planned = self._is_built = self._is_closed = False

    @abstractmethod
    def _plan(self) -> float:
        """Plan; returns the seconds to count."""

    @abstractmethod
    def _build(self) -> float:
        """Build what is planned; returns the seconds to count."""

    @abstractmethod
    def _release(self) -> None:
        """Let go of everything, however far it came; called once."""

    def plan(self) -> None:
        """Prepare on the CPU all that does not change from frame to frame. Raises EmbreeError after `close`."""
        with self._lock:
            self._check_open()
            self.plan_time_s = self._plan()
            self._is_planned = True

    def build(self) -> None:
        """Build the BVH over what `plan` prepared (planning first if that was not done)."""
        with self._lock:
            self._check_open()
            if not self._is_planned:
                self.plan()
            self.build_time_s = self._build()
            self._is_built = True

    @contextmanager
    def _tracing(self) -> Iterator[None]:
        """As long as it lasts nothing else happens. Raises EmbreeError before `build` and after `close`."""
        with self._lock:
            if self._is_closed:
                raise EmbreeError("this tracer is closed and cannot trace any more; make a new one")
            if not self._is_built:
                raise EmbreeError("this is not built yet; use it in a `with` block or call build() first")
            yield

    def _check_open(self) -> None:
        if self._is_closed:
            raise EmbreeError("this tracer is closed; make a new one")

    def close(self) -> None:
        """Release what was planned and built; waits for a frame in progress. Closing twice is harmless."""
        with self._lock:
            if not self._is_closed:
                self._is_closed = True
                self._release()

    def __enter__(self) -> Self:
        try:
            self.plan()
            self.build()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class TracerLifetime(Lifetime, Generic[Result]):
    """The lifetime of what sees through a camera, which `look` may change. Result: what `trace` returns."""

    @abstractmethod
    def _trace(self, offset: tuple[float, float], out: Any) -> Result:
        """One frame, while nothing else happens."""

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Result | None = None) -> Result:
        """Trace one frame; all rays go through sub-pixel position `offset` of their pixels, in [0, 1) x [0, 1).

        out: an earlier result of this tracer whose arrays are to be overwritten, which saves allocating an image; it
        must not be read any more.
        Raises InputError for an offset outside the pixel or an `out` that does not fit, EmbreeError when the tracer is
        not built or already closed.
        """
        check_offset(offset)
        with self._tracing():
            return self._trace(offset, out)

    @abstractmethod
    def _look(self, camera: View) -> bool:
        """Take the camera, changing nothing where it is refused; returns whether what is built goes on serving."""

    def look(self, camera: View) -> None:
        """Trace what `camera` sees from the next frame on; it may be of another size or kind.

        What hangs on the camera is planned and built anew at once, as far as it had been, and the times say what that
        took. A camera that is refused changes nothing; where planning or building fails, the tracer is as before
        `plan`.
        Raises what making, planning and building a new tracer would; EmbreeError after `close`.
        """
        with self._lock:
            self._check_open()
            if self._look(camera):
                return
            was_planned, was_built = self._is_planned, self._is_built
            self._is_planned = self._is_built = False
            if was_planned:
                self.plan()
            if was_built:
                self.build()
