"""A session: what is drawn next, while the camera moves and when it rests; knows no page, no thread and no renderer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError
from atra.light.viewer.request import Pose, Request

REST_S = 0.3
"""Seconds without a change after which samples accumulate."""

LEAST_GAP_S, GROWTH = 0.1, 0.25
"""Shortest time between two pictures of one accumulation, in seconds and as a share of its time so far."""

WAKE_S = 0.5
"""Longest wait, in seconds; on Windows Ctrl-C cannot interrupt an endless one."""


class Picture(NamedTuple):
    """What is seen. image: (H, W, 3) uint8, sRGB. stage_s: seconds by stage of what was drawn last, told with the
    samples. note: Markdown, told alone where there are no stages."""

    image: NDArray[np.uint8]
    stage_s: Mapping[str, float]
    note: str = ""


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture to be shown, and the one request that all of it was drawn for. samples: 0 while the camera moves."""

    request: Request
    picture: Picture
    samples: int = 0


class Artist(Protocol):
    """What draws. All but the constructor is called by one thread; raises AtraError for what cannot be drawn."""

    def sketch(self, request: Request) -> Picture:
        """Draw one frame, fast."""

    def add(self, request: Request, stop: Callable[[], bool]) -> int:
        """Add a sample to the picture of `request`, which starts again unless it keeps those of the last call's; when
        `stop` says True on the way, it keeps the samples that it had. Returns their number."""

    def show(self, request: Request) -> Picture:
        """The samples so far, as `request`, which keeps them, shows them."""


class Screen(Protocol):
    """What shows. Both are called by the session's thread."""

    def show(self, frame: Frame) -> None: ...

    def tell(self, problem: str) -> None:
        """One line of why there is no picture of what was asked for last."""


class Session:
    """Draws what was asked for last, for ever.

    `want`, from any thread, says what; whatever was asked for before is dropped, and a wave of rays that is traced for
    it is the last. The first picture of another camera or of other parameters is a sketch; when nothing has changed for
    `REST_S`, samples accumulate until there are enough. What changes nothing but colours and powers of lights, or what
    is shown of the samples, keeps them and is shown at once.
    One thread calls `run`, or `step` again and again.
    """

    def __init__(
        self, artist: Artist, screen: Screen, first: Request, clock: Callable[[], float] = perf_counter
    ) -> None:
        self._artist, self._screen, self._clock = artist, screen, clock
        self._changed = threading.Condition()
        self._newest = first, clock()  # and when it was asked for: both are read at once
        self._shown: Request | None = None
        self._refused: Request | None = None
        self._samples = 0
        self._began_s = self._sent_s = 0.0
        self._is_asked = self._is_closed = False

    @property
    def wanted(self) -> Request:
        """What was asked for last."""
        return self._newest[0]

    def want(self, pose: Pose | None = None, **settings: Any) -> None:
        """Ask for another camera, or for other values of fields of `Settings`."""
        with self._changed:
            old = self.wanted
            request = Request(pose or old.pose, replace(old.settings, **settings))
            if request != old:
                self._newest = request, self._clock()
            self._is_asked = True
            self._changed.notify()

    def close(self) -> None:
        """Make `run` return after the wave that it is at."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()

    def run(self) -> None:
        """Until `close`; begins when something has been asked for, since a first picture may be of another shape."""

        def is_due() -> bool:
            return self._is_closed or (self._is_asked and self._shown is not self.wanted)

        while not self._is_closed:
            pause_s = self.step() if self._is_asked else None
            with self._changed:
                self._changed.wait_for(is_due, WAKE_S if pause_s is None else pause_s)

    def step(self) -> float | None:
        """Draw one frame or add one sample; returns the seconds until there is more to do, None: until it is wanted."""
        request, since_s = self._newest
        if request is self._refused:
            return None
        try:
            if request is not self._shown:
                keeps = self._samples > 0 and self._shown is not None and request.keeps_samples_of(self._shown)
                self._shown = request
                if not keeps:
                    self._samples = 0
                self._send(request, self._artist.show(request) if keeps else self._artist.sketch(request))
                return 0.0
            rest_s = since_s + REST_S - self._clock()
            if self._samples == 0 and rest_s > 0.0:
                return rest_s
            if self._samples >= request.settings.enough:
                return None
            self._add(request)
            return 0.0
        except AtraError as error:
            self._refused, self._samples = request, 0
            self._screen.tell(str(error))
            return None

    def _add(self, request: Request) -> None:
        def is_stale() -> bool:
            return self._is_closed or not self.wanted.keeps_samples_of(request)

        if self._samples == 0:
            self._began_s = self._clock()
        self._samples = self._artist.add(request, is_stale)
        if is_stale() or not self._samples:
            return
        gap_s = max(LEAST_GAP_S, GROWTH * (self._sent_s - self._began_s))
        if self._samples in (1, request.settings.enough) or self._clock() - self._sent_s >= gap_s:
            self._send(request, self._artist.show(request))

    def _send(self, request: Request, picture: Picture) -> None:
        self._screen.show(Frame(request, picture, self._samples))
        self._sent_s = self._clock()
