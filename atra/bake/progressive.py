"""A progressive bake: a thread adds samples, and whoever wants to see the map takes a snapshot."""

from __future__ import annotations

import threading
from types import TracebackType
from typing import Self

from atra.bake.baker import Baker
from atra.bake.maps import Lightmap
from atra.bake.surface import BakeScene
from atra.geometry.view import View

MOST_WAIT_S = 0.05
"""How long an edit may go unseen by a thread that has nothing left to do."""


class ProgressiveBake:
    """Bakes in a thread of its own until every texel has `target` samples, what the view shows first.

        with ProgressiveBake(baker, target=512) as bake:
            bake.set_view(camera)
            lightmap = bake.snapshot()

    baker: planned and built; it is the thread's until the end of `with`, which stops it after the batches in flight.
    """

    def __init__(self, baker: Baker, target: int = 512) -> None:
        self._baker, self._target = baker, target
        self._slot: Lightmap | None = None
        self._stop, self._wakes = threading.Event(), threading.Event()
        self._edits: list[BakeScene | View | None] = []
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="atra-bake", daemon=True)

    def _work(self) -> None:
        try:
            while not self._stop.is_set():
                self._take_edits()
                if self._baker.advance(self._target, self._interrupted):
                    self._slot = self._baker.maps
                else:
                    with self._lock:
                        if not self._edits:
                            self._done.set()
                    self._wakes.wait(MOST_WAIT_S)
        except BaseException as error:
            self._error = error
        finally:
            self._done.set()

    def _interrupted(self) -> bool:
        return self._stop.is_set() or self._wakes.is_set()

    def _take_edits(self) -> None:
        with self._lock:
            edits, self._edits = self._edits, []
            self._wakes.clear()
        for edit in edits:
            if isinstance(edit, BakeScene):
                self._baker.update(edit)
                self._slot = None
            else:
                self._baker.set_view(edit)

    def _edit(self, edit: BakeScene | View | None) -> None:
        with self._lock:
            self._done.clear()
            self._edits.append(edit)
            self._wakes.set()

    def set_view(self, camera: View | None) -> None:
        """Light first what the camera sees, from the next batch on; None: nothing comes first."""
        self._edit(camera)

    def update(self, scene: BakeScene) -> None:
        """Take other lights, surfaces or sky: the map starts anew."""
        self._edit(scene)

    def snapshot(self) -> Lightmap | None:
        """The latest map, which nobody changes any more; None where there is none yet. Waits for nothing. Raises what
        the thread raised."""
        if self._error is not None:
            raise self._error
        return self._slot

    @property
    def share_done(self) -> float:
        """As `Baker.share_done`, of now. Waits for nothing."""
        return self._baker.share_done(self._target)

    @property
    def seen(self) -> int | None:
        """How many texels the view shows; None without one. Waits for nothing."""
        visible = self._baker.visible
        return None if visible is None else int(visible.sum())

    def wait(self, timeout_s: float | None = None) -> bool:
        """Until every texel has its samples; whether that is so. Raises what the thread raised."""
        done = self._done.wait(timeout_s)
        if self._error is not None:
            raise self._error
        return done

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._wakes.set()
        self._thread.join()
