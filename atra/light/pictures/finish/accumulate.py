"""Samples until a picture is done: estimated error, time left, and states that survive an interruption."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.light.checks import check_whole, checked_number
from atra.light.numbers_kernels import LUMINANCE
from atra.light.pictures.finish.states import read_state, write_state
from atra.light.pictures.renderer import Renderer
from atra.light.scattering.sampler_kernels import LEAST_LEFT, MOST_LEFT

SAVE_S = 30.0
"""Seconds between two states on the disk."""

_DOUBLINGS = 4
"""Changes of the picture that tell of its error."""


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

    samples: at most so many. error: relative, such as 0.01; told by how the picture changes while samples double,
    which knows nothing of light that no sample found, and little of bright edges without `jitter="pixel"`. minutes: of
    this run. state: a file that keeps the samples, written every `save_every_s` seconds, and removed once the picture
    has the error that was asked for, or, if none was, at the end; where it exists, the picture goes on from it, equal
    to the bit to one that was never interrupted. Raises InputError
    without a limit, for limits that make no sense, and for a state of another scene, camera or option; StorageError.

    Examples
    --------
    >>> import atra
    >>> from atra import light
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> scene = light.Scene.plain(mesh)
    >>> with light.PathRenderer(scene, camera) as renderer:
    ...     steps = list(light.accumulate(renderer, samples=4))
    >>> steps[-1].samples, steps[-1].is_done
    (4, True)
    """
    if samples is None and error is None and minutes is None:
        raise InputError("nothing says when the picture is done; expected samples, error or minutes")
    if samples is not None:
        check_whole("samples", samples, 1)
    for name, limit in (("error", error), ("minutes", minutes)):
        if limit is not None:
            checked_number(name, limit, 0.0, above=True)
    path = None if state is None else Path(state)
    octaves, before_s = _Octaves(), 0.0
    if path is not None and path.exists():

        def restore(kept: dict[str, Any]) -> float:
            renderer.restore(kept)
            octaves.restore(kept)
            return float(kept["elapsed_s"])

        before_s = read_state(path, restore, "picture")
    start = saved = monotonic()
    pace_s: float | None = None

    def progress() -> Progress:
        run_s, count, found = monotonic() - start, renderer.samples, octaves.error(renderer.samples)
        left = [inf if minutes is None else 60.0 * minutes - run_s]
        missing = [] if samples is None else [float(samples - count)]
        if error is not None and found is not None:
            missing.append(count * ((found / error) ** 2 - 1.0))  # errors fall with the square root of the samples
        left += [0.0 if more <= 0.0 else inf if pace_s is None else pace_s * more for more in missing]
        left_s = None if min(left) == inf else max(min(left), 0.0)
        return Progress(count, found, before_s + run_s, left_s, left_s == 0.0)

    def save(state_path: Path, elapsed_s: float) -> None:
        write_state(state_path, {"elapsed_s": elapsed_s, **renderer.state, **octaves.state})

    latest, warm, warm_s = progress(), 0, start
    while not latest.is_done:
        earlier = renderer.samples
        renderer.add(1)
        if renderer.samples == earlier:  # the renderer's own option `most_samples`
            break
        octaves.look(renderer)
        if path is not None and monotonic() - saved >= save_every_s:
            save(path, before_s + monotonic() - start)
            saved = monotonic()
        if not warm:  # the first sample of a run may have compiled kernels, which tells nothing of the others
            warm, warm_s = renderer.samples, monotonic()
        else:
            pace_s = (monotonic() - warm_s) / (renderer.samples - warm)
        latest = progress()
        yield latest
    if path is None:
        return
    if latest.is_done and (error is None or (latest.error is not None and latest.error <= error)):
        path.unlink(missing_ok=True)
    elif renderer.samples:
        save(path, latest.elapsed_s)


class _Octaves:
    """The error by how much the picture has changed each time the number of samples doubled.

    Scrambled Sobol' points make the second half of samples correct the first, so a doubling changes the picture by more
    than the error that is left. If it leaves the share r of the error, e, the change is e sqrt(1 / r^2 - 1), and r is
    how changes fall from one doubling to the next. The mean of two changes steadies both. Between two doublings the
    error is taken to fall with the square root of the number of samples.

    changes: relative, of the last doublings. luminance: of the picture at the last of them.
    """

    def __init__(self) -> None:
        self.changes: list[float] = []
        self.luminance = np.zeros((0, 0))

    def look(self, renderer: Renderer) -> None:
        """Count the samples that the renderer has now, one more than before."""
        if renderer.samples & (renderer.samples - 1):
            return
        now = renderer.image.astype(np.float64) @ np.array(LUMINANCE)
        if len(self.luminance):
            mean = float(now.mean())
            change = float(((now - self.luminance) ** 2).mean()) ** 0.5
            self.changes = [*self.changes, change / mean if mean > 0.0 else 0.0][-_DOUBLINGS:]
        self.luminance = now

    def error(self, samples: int) -> float | None:
        """Relative, of all samples; None before there are two."""
        if not self.changes:
            return None
        *earlier, first, last = [0.0, 0.0, 0.0, *self.changes][-_DOUBLINGS:]
        squared = MOST_LEFT
        if earlier[0] > 0.0 and earlier[1] > 0.0:
            squared = min(max((first * last / (earlier[0] * earlier[1])) ** 0.5, LEAST_LEFT), MOST_LEFT)
        change = (first * last) ** 0.5 * squared**0.25 if first > 0.0 else last
        doubled = 1 << (samples.bit_length() - 1)
        return change * (squared / (1.0 - squared) * doubled / samples) ** 0.5

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        return {"octave_light": self.luminance, "changes": np.array(self.changes)}

    def restore(self, state: Any) -> None:
        self.luminance, self.changes = state["octave_light"], state["changes"].tolist()
