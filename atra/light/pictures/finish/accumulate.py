"""Samples until a picture is done: estimated error, time left, and states that survive an interruption."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.light.checks import check_whole, checked_number
from atra.light.pictures.finish.tone import LUMINANCE
from atra.light.pictures.renderer import Renderer

SAVE_S = 30.0
"""Seconds between two states on the disk."""

_CHECKS = 4
"""Checks of the error each time the number of samples doubles; their places do not depend on time."""


@dataclass(frozen=True)
class Progress:
    """How far a picture is.

    samples: of every pixel. error: estimated root mean square error of the luminance over its mean; None before the
    second sample. elapsed_s: seconds of rendering, those before an interruption included. left_s: until it is done;
    None = unknown. is_done: whether the picture has what was asked for.
    """

    samples: int
    error: float | None
    elapsed_s: float
    left_s: float | None
    is_done: bool


def accumulate(
    renderer: Renderer,
    samples: int | None = None,
    *,
    error: float | None = None,
    minutes: float | None = None,
    state: Path | str | None = None,
    save_every_s: float = SAVE_S,
) -> Iterator[Progress]:
    """Add samples until the first of the limits is reached; yields after each sample.

    samples: at most so many. error: relative, such as 0.01; told by the difference of two parts of the samples, which
    knows nothing of light that no sample found. minutes: of rendering. state: a file that keeps the samples, written
    every `save_every_s` seconds and removed at the end; where it exists, the picture goes on from it, equal to the bit
    to one that was never interrupted. Raises InputError without a limit, for limits that make no sense, and for a state
    of another scene, camera or option; StorageError.
    """
    _check(samples, error, minutes)
    path = None if state is None else Path(state)
    halves, before_s = _Halves(), 0.0
    if path is not None and path.exists():
        before_s = _resume(path, renderer, halves)
    start = saved = monotonic()

    def progress() -> Progress:
        elapsed_s, count = before_s + monotonic() - start, renderer.samples
        reached = (
            (samples is not None and count >= samples)
            or (error is not None and halves.error is not None and halves.error <= error)
            or (minutes is not None and elapsed_s >= 60.0 * minutes)
        )
        left_s = 0.0 if reached else _left_s(count, halves.error, elapsed_s, samples, error, minutes)
        return Progress(count, halves.error, elapsed_s, left_s, reached)

    latest = progress()
    while not latest.is_done:
        earlier = renderer.samples
        renderer.add(1)
        if renderer.samples == earlier:  # the renderer's own option `most_samples`
            break
        halves.look(renderer)
        if path is not None and monotonic() - saved >= save_every_s:
            _save(path, renderer, halves, before_s + monotonic() - start)
            saved = monotonic()
        latest = progress()
        yield latest
    if path is not None:
        path.unlink(missing_ok=True)


def _check(samples: int | None, error: float | None, minutes: float | None) -> None:
    if samples is None and error is None and minutes is None:
        raise InputError("nothing says when the picture is done; expected samples, error or minutes")
    if samples is not None:
        check_whole("samples", samples, 1)
    for name, value in (("error", error), ("minutes", minutes)):
        if value is not None:
            checked_number(name, value, 0.0, above=True)


def _left_s(
    count: int, reached: float | None, elapsed_s: float, samples: int | None, error: float | None, minutes: float | None
) -> float | None:
    """Seconds until the first limit; errors fall with the square root of the number of samples."""
    left = inf if minutes is None else 60.0 * minutes - elapsed_s
    if count and samples is not None:
        left = min(left, elapsed_s / count * (samples - count))
    if count and error is not None and reached is not None:
        left = min(left, elapsed_s * max(0.0, (reached / error) ** 2 - 1.0))
    return None if left == inf else left


class _Halves:
    """The error by the difference of two parts of the samples: those before a power of two, and those after.

    error: relative, of the mean of all. count, luminance: samples of the earlier part, and their mean.
    """

    def __init__(self) -> None:
        self.error: float | None = None
        self.count, self.luminance = 0, np.zeros((0, 0))
        self._next: tuple[int, NDArray[np.float64]] | None = None

    def look(self, renderer: Renderer) -> None:
        """Count the samples that the renderer has now."""
        count = renderer.samples
        octave = 1 << (count.bit_length() - 1)
        if count % max(1, octave // _CHECKS):
            return
        now = renderer.image.astype(np.float64) @ np.array(LUMINANCE)
        if self._next is not None and count == 2 * self._next[0]:
            (self.count, self.luminance), self._next = self._next, None
        if self.count:
            # For parts of m and n - m samples the mean's variance is the squared difference times m (n - m) / n^2.
            rest = (count * now - self.count * self.luminance) / (count - self.count)
            share = self.count * (count - self.count) / count**2
            mean = float(now.mean())
            spread = float(((rest - self.luminance) ** 2).mean() * share)
            self.error = spread**0.5 / mean if mean > 0.0 else 0.0
        if count == octave:
            self._next = count, now

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        count, luminance = self._next or (0, np.zeros((0, 0)))
        error = np.array(np.nan if self.error is None else self.error)
        parts = {"half": np.array(self.count), "half_light": self.luminance, "next": np.array(count)}
        return parts | {"next_light": luminance, "error": error}

    def restore(self, state: Any) -> None:
        self.count, self.luminance = int(state["half"]), state["half_light"]
        self._next = (int(state["next"]), state["next_light"]) if int(state["next"]) else None
        self.error = None if np.isnan(state["error"]) else float(state["error"])


def _save(path: Path, renderer: Renderer, halves: _Halves, elapsed_s: float) -> None:
    content = io.BytesIO()
    np.savez(content, elapsed_s=elapsed_s, **renderer.state, **halves.state)  # type: ignore[arg-type]
    write_atomically(path, content.getvalue())


def _resume(path: Path, renderer: Renderer, halves: _Halves) -> float:
    """Returns the seconds that the samples took."""
    try:
        with np.load(path, allow_pickle=False) as found:
            state = dict(found)
        renderer.restore(state)
        halves.restore(state)
        return float(state["elapsed_s"])
    except InputError as error:
        raise InputError(f"{path} cannot be resumed: {error}; remove it to start anew") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} is no state of a picture ({error}); remove it to start anew") from None
