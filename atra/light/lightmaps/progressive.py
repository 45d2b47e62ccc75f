"""Progressive baking: a thread adds samples while others take snapshots of the map."""

from __future__ import annotations

import threading
import weakref
from types import TracebackType
from typing import Self

from atra.geometry.view import View
from atra.light.lightmaps.baker import Baker
from atra.light.lightmaps.maps import Lightmap
from atra.light.scene import Scene

MOST_WAIT_S = 0.05
"""How long an idle thread may overlook an edit."""


class _Work:
    """The thread's work and the state it shares. It holds no reference to its `ProgressiveBake`, so that one can be
    collected, and its finalizer then stops the thread."""

    def __init__(self, baker: Baker, target: int) -> None:
        self.baker, self.target = baker, target
        self.slot: Lightmap | None = None
        self.error: BaseException | None = None
        self.done = threading.Event()
        self._stop, self._wakes = threading.Event(), threading.Event()
        self._edits: list[Scene | View | None] = []
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
            if isinstance(edit, Scene):
                self.baker.update(edit)
                self.slot = None
            else:
                self.baker.look(edit)

    def edit(self, edit: Scene | View | None) -> None:
        with self._lock:
            self.done.clear()
            self._edits.append(edit)
            self._wakes.set()

    def stop(self) -> None:
        """Stop after the batches in flight, without waiting: a finalizer may run in any thread, including this one."""
        self._stop.set()
        self._wakes.set()


class ProgressiveBake:
    """Bakes in a thread until every texel has `target` samples; what the view shows comes first.

        with ProgressiveBake(baker, target=512) as bake:
            bake.look(camera)
            lightmap = bake.snapshot()

    baker: it belongs to the thread until the `with` block ends, which stops after the batches in
    flight. Losing the last reference stops it, too.
    """

    def __init__(self, baker: Baker, target: int = 512) -> None:
        self._work = _Work(baker, target)
        self._thread = threading.Thread(target=self._work.run, name="atra-bake", daemon=True)
        weakref.finalize(self, self._work.stop)

    def look(self, camera: View | None) -> None:
        """From the next batch on, light first what the camera sees; None ends that."""
        self._work.edit(camera)

    def update(self, scene: Scene) -> None:
        """Change lights, surfaces or sky; the map starts again."""
        self._work.edit(scene)

    def snapshot(self) -> Lightmap | None:
        """The latest map, which will not change; None if there is none yet. Never waits. Raises what the thread
        raised."""
        if self._work.error is not None:
            raise self._work.error
        return self._work.slot

    @property
    def share_done(self) -> float:
        """`Baker.share_done` now. Never waits."""
        return self._work.baker.share_done(self._work.target)

    @property
    def seen(self) -> int | None:
        """How many texels the view shows; None without a view. Never waits."""
        visible = self._work.baker.visible
        return None if visible is None else int(visible.sum())

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until every texel has its samples; returns whether that is so. Raises what the thread raised."""
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
