"""The lifetime of a tracer: planned, built, traced and closed, one call at a time."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from atra.errors import EmbreeError
from atra.geometry.view import View


class Lifetime(ABC):
    """What is planned and built once, by `with` or by hand, traced any number of times, and closed.

    `with` plans and builds on entry, and closes on exit, or at once where that fails. A call waits for one in progress
    in another thread. plan_time_s, build_time_s: seconds each took, 0 before.

    Subclasses say how: `_plan` and `_build` prepare, and `trace` works inside `_tracing()`; whether with Embree, with
    another library or by other tracers is theirs.
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


class TracerLifetime(Lifetime):
    """The lifetime of what sees through a camera, which `look` may change."""

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
