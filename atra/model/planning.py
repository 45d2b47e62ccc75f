"""A plan: what every choice is predicted to cost, the cheapest first."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.model.choice import Choice, candidates
from atra.model.constants import Machine, machine
from atra.model.formulas import NANO, build_terms, family, frame_terms
from atra.model.looking import Look, look_at
from atra.model.making import tracer_of
from atra.model.memory import array_bytes, byte_terms
from atra.tracing.options import check_ties
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number

WANTS = ("nearest", "count", "thickness", "transmittance", "layers")
"""What is wanted of each pixel: the nearest hit, or one of `atra.all_hits.reductions`, which cost about the same."""

MOST = 1 << 53
"""Largest number of frames; up to there floats count without gaps."""

UNSURE = 0.3
"""A margin below this is within the model's error in one of ten cases or more (docs/model.md)."""


@dataclass(frozen=True)
class Forecast:
    """What a choice is predicted to cost on one thread.

    build_s: plan and build. frame_time_s: each frame. bytes: memory of what is built.
    """

    choice: Choice
    build_s: float
    frame_time_s: float
    bytes: float

    def total_s(self, frames: int) -> float:
        """Seconds from nothing to the last of so many frames."""
        return self.build_s + frames * self.frame_time_s


@dataclass(frozen=True, repr=False)
class Plan:
    """The cheapest choice for a view, and all others.

    frames, want: planned for. threads: of the tracer; predictions are for one thread. width, height: pixels.
    considered: all forecasts, the cheapest first. is_calibrated: whether constants are this machine's. ties: as for the
    tracers.
    """

    frames: int
    want: str
    threads: int
    width: int
    height: int
    considered: tuple[Forecast, ...]
    is_calibrated: bool
    ties: str = "lowest"

    @property
    def choice(self) -> Choice:
        return self.considered[0].choice

    @property
    def method(self) -> str:
        return self.choice.method

    @property
    def split(self) -> tuple[int, int]:
        return self.choice.split

    @property
    def predicted_time_s(self) -> float:
        """Plan, build and all frames on one thread."""
        return self.considered[0].total_s(self.frames)

    @property
    def runner_up(self) -> Forecast | None:
        """The cheapest forecast of another method; None if there is none."""
        return next((one for one in self.considered[1:] if one.choice.method != self.method), None)

    @property
    def margin(self) -> float:
        """How much longer the runner-up takes, as a share of what the choice takes; infinite without one."""
        other = self.runner_up
        return np.inf if other is None else other.total_s(self.frames) / self.predicted_time_s - 1.0

    @property
    def is_unsure(self) -> bool:
        """Whether the runner-up may well be faster than the choice."""
        return self.margin < UNSURE

    def tracer(
        self, mesh: Mesh, camera: View, ties: str | None = None, memory_budget_bytes: int | None = None
    ) -> Tracer:
        """The tracer, neither planned nor built. ties: None takes those planned for.

        Raises InputError for an image of another size than planned for, and as the tracer's constructor does.
        """
        if (camera.width, camera.height) != (self.width, self.height):
            raise InputError(
                f"the plan is for {self.width} x {self.height} pixels, the camera has {camera.width} x "
                f"{camera.height}; plan again for this camera"
            )
        ties = self.ties if ties is None else ties
        return tracer_of(
            self.choice, mesh, camera, threads=self.threads, ties=ties, memory_budget_bytes=memory_budget_bytes
        )

    def __repr__(self) -> str:
        unsure = ", unsure" if self.is_unsure else ""
        return f"Plan({self.choice}; {self.predicted_time_s:.3g} s for {self.frames} frames, {self.want}{unsure})"

    def __str__(self) -> str:
        """A table of all choices, and how sure the first is."""
        lines = [f"{'':46}{'build':>10}{'a frame':>12}{'in all':>12}{'memory':>12}"]
        for one in self.considered:
            lines.append(
                f"{one.choice!s:46}{one.build_s * 1e3:7.1f} ms{one.frame_time_s * 1e3:9.2f} ms"
                f"{one.total_s(self.frames) * 1e3:9.1f} ms{one.bytes / 2**20:8.1f} MiB"
            )
        other = self.runner_up
        if other is not None:
            unsure = "; too close to be sure" if self.is_unsure else ""
            lines.append(f"{self.choice}: {other.choice} takes {self.margin:.0%} longer{unsure}")
        lines.append(
            "constants of this machine"
            if self.is_calibrated
            else "constants of another machine, as none were measured on this one: run `atra calibrate`"
        )
        return "\n".join(lines)


def plan(
    mesh: Mesh,
    camera: View,
    frames: int = 64,
    want: str = "nearest",
    threads: int | None = None,
    ties: str = "lowest",
    choices: Iterable[Choice] | None = None,
) -> Plan:
    """Predict what each method costs for so many frames of a view; nothing but two raster frames is built or traced.

    want: "nearest", or "count", "thickness", "transmittance", "layers", for all hits. threads, ties: of the plan's
    tracer. choices: what to choose from; None = all of `atra.model.choice.candidates`.

    Raises InputError for a camera with a lens, frames below 1 or above 2^53, an unknown want or ties, threads below 1,
    no choices, and what the tracers refuse. Source: docs/model.md.
    """
    if not is_whole_number(frames) or not 1 <= frames <= MOST:
        raise InputError(f"frames is {frames!r}, expected a whole number of at least 1 and at most 2^53")
    if want not in WANTS:
        raise InputError(f"want is {want!r}, expected one of {', '.join(WANTS)}")
    check_ties(ties)
    resolved = resolve_threads(threads)
    look = look_at(mesh, camera)
    asked = candidates(camera, want) if choices is None else tuple(choices)
    if not asked:
        raise InputError("choices are none, expected at least one to choose from")
    known = machine()
    forecasts = [forecast(look, choice, want, known) for choice in asked]
    forecasts.sort(key=lambda one: one.total_s(int(frames)))
    return Plan(int(frames), want, resolved, camera.width, camera.height, tuple(forecasts), known.is_calibrated, ties)


def forecast(look: Look, choice: Choice, want: str, known: Machine) -> Forecast:
    """What a choice costs on a view that was looked at."""
    constants = known.constants

    def of(name: str, terms: np.ndarray) -> float:
        return float(np.dot(terms, constants[name]))

    return Forecast(
        choice,
        of(f"{choice.method}|build", build_terms(look, choice)) * NANO,
        max(of(family(choice, want), frame_terms(look, choice, want)) * NANO, NANO),
        array_bytes(look, choice) + of(f"{choice.method}|bytes", byte_terms(look, choice)),
    )
