"""A progressive bake: a thread adds samples, and whoever wants to see the map takes a snapshot."""

from __future__ import annotations

import threading
import weakref
from types import TracebackType
from typing import Self

from atra.geometry.view import View
from atra.light.lightmaps.baker import Baker
from atra.light.lightmaps.maps import Lightmap
from atra.light.lightmaps.surface import BakeScene

MOST_WAIT_S = 0.05
"""How long an edit may go unseen by a thread that has nothing left to do."""


class _Work:
    """What the thread does, and what it shares with its `ProgressiveBake`, which it does not refer to: one that is
    dropped is then released, and its finalizer tells the thread to stop."""

    def __init__(self, baker: Baker, target: int) -> None:
        self.baker, self.target = baker, target
        self.slot: Lightmap | None = None
        self.error: BaseException | None = None
        self.done = threading.Event()
        self._stop, self._wakes = threading.Event(), threading.Event()
        self._edits: list[BakeScene | View | None] = []
        self._lock = threading.Lock()

    def run(self) -> None:
        try:
            while not self._stop.is_set():
                self._take_edits()
                if self.baker.advance(self.target, self._interrupted):
                    self.slot = self.baker.maps
                else:
                    with self._lock:
                        if not self._edits:
                            self.done.set()
                    self._wakes.wait(MOST_WAIT_S)
        except BaseException as error:
            self.error = error
        finally:
            self.done.set()

    def _interrupted(self) -> bool:
        return self._stop.is_set() or self._wakes.is_set()

    def _take_edits(self) -> None:
        with self._lock:
            edits, self._edits = self._edits, []
            self._wakes.clear()
        for edit in edits:
            if isinstance(edit, BakeScene):
                self.baker.update(edit)
                self.slot = None
            else:
                self.baker.look(edit)

    def edit(self, edit: BakeScene | View | None) -> None:
        with self._lock:
            self.done.clear()
            self._edits.append(edit)
            self._wakes.set()

    def stop(self) -> None:
        """After the batches in flight. Does not wait, as a finalizer may run in any thread, this one among them."""
        self._stop.set()
        self._wakes.set()


class ProgressiveBake:
    """Bakes in a thread of its own until every texel has `target` samples, what the view shows first.

        with ProgressiveBake(baker, target=512) as bake:
            bake.look(camera)
            lightmap = bake.snapshot()

    baker: it is the thread's until the end of `with`, which stops it after the batches in flight.
    One that is dropped within `with` stops, too.
    """

    def __init__(self, baker: Baker, target: int = 512) -> None:
        self._work = _Work(baker, target)
        self._thread = threading.Thread(target=self._work.run, name="atra-bake", daemon=True)
        weakref.finalize(self, self._work.stop)

    def look(self, camera: View | None) -> None:
        """Light first what the camera sees, from the next batch on; None: nothing comes first."""
        self._work.edit(camera)

    def update(self, scene: BakeScene) -> None:
        """Take other lights, surfaces or sky: the map starts anew."""
        self._work.edit(scene)

    def snapshot(self) -> Lightmap | None:
        """The latest map, which nobody changes any more; None where there is none yet. Waits for nothing. Raises what
        the thread raised."""
        if self._work.error is not None:
            raise self._work.error
        return self._work.slot

    @property
    def share_done(self) -> float:
        """As `Baker.share_done`, of now. Waits for nothing."""
        return self._work.baker.share_done(self._work.target)

    @property
    def seen(self) -> int | None:
        """How many texels the view shows; None without one. Waits for nothing."""
        visible = self._work.baker.visible
        return None if visible is None else int(visible.sum())

    def wait(self, timeout_s: float | None = None) -> bool:
        """Until every texel has its samples; whether that is so. Raises what the thread raised."""
        done = self._work.done.wait(timeout_s)
        if self._work.error is not None:
            raise self._work.error
        return done

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._work.stop()
        self._thread.join()
