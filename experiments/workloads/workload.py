"""Workload: one thing to measure at a point, as a value the harness can run, tabulate and report."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.render import PanoramaSky, RenderScene
from atra.tracers.tracer import Tracer
from experiments.harness.column import Column
from experiments.harness.point import Point
from experiments.harness.records import Record
from experiments.methods import find_method
from experiments.methods.method import option


@dataclass(frozen=True)
class NoOptions:
    """Of a workload that leaves nothing to choose."""


@dataclass(frozen=True)
class UnderSky:
    """Options of a workload whose scene a file may light.

    sky_sha256 is found, not given: a changed file makes another point. Raises InputError for a file that cannot be
    read, and for one that is not what it was when the run began.
    """

    sky: str | None = option(None, "an EXR or Radiance HDR all around, in place of the scene's own sky", "own")
    sky_sha256: str | None = option(None, "hash of that file, which is found and not set", "own")
    robust_rays: bool = option(True, "no ray of light slips through between two triangles; off: Embree's fast setting")

    def __post_init__(self) -> None:
        if self.sky is None:
            if self.sky_sha256 is not None:
                raise InputError(f"workload.sky_sha256 is {self.sky_sha256!r} without a workload.sky, expected null")
            return
        path = Path(self.sky).expanduser().resolve()
        try:
            found = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"workload.sky is {str(path)!r}, which cannot be read: {error.strerror}") from None
        if self.sky_sha256 not in (None, found):
            raise InputError(f"the sky {str(path)!r} changed since this run began; start it again")
        object.__setattr__(self, "sky", str(path))
        object.__setattr__(self, "sky_sha256", found)

    def under_sky(self, scene: RenderScene) -> RenderScene:
        """The scene with that sky, if there is one. Raises InputError for a file that holds none."""
        return scene if self.sky is None else replace(scene, sky=PanoramaSky.load(self.sky))


def no_samples(point: Point) -> frozenset[str]:
    """Nothing is timed round by round."""
    return frozenset()


def make_own(point: Point, mesh: Mesh, view: View | None = None) -> Tracer:
    """The point's own method. view: in place of the point's. Raises InputError and MemoryBudgetError as the tracers
    do."""
    return find_method(point.method).make(mesh, view or point.camera, point.options, point.tracing)


def no_canary(record: Record) -> float | None:
    """Nothing is measured that every method leaves alike."""
    return None


def no_problem(point: Point) -> str | None:
    """Every point can be measured."""
    return None


@dataclass(frozen=True)
class Workload:
    """A workload.

    name: as configured. options: its own typed settings, with defaults. columns: of the table, each read from a record.
    headline: a measured record -> its line on the terminal. room: the package with what is imported only where it is
    needed: `measure` (in the worker), and if there is any `figures`, `terminal`, `results` (files of a sweep) and
    `files` (of a single point).
    samples: which series a record of a point must hold. optional: series that it may hold beside these, at least one.
    judged: the series whose spread makes a point doubtful. needs: results that a measured record holds at least.
    canary: what a measured record says of the machine alone (`experiments.results.canary`).
    problem: why a point cannot be measured.
    """

    name: str
    options: type
    columns: tuple[Column, ...]
    headline: Callable[[Record], str]
    room: str
    samples: Callable[[Point], frozenset[str]] | None = no_samples
    optional: frozenset[str] = frozenset()
    judged: str | None = None
    needs: tuple[str, ...] = ()
    canary: Callable[[Record], float | None] = no_canary
    problem: Callable[[Point], str | None] = no_problem

    @property
    def is_timed(self) -> bool:
        """Whether several processes measure it; where nothing is timed they would all find the same."""
        return self.judged is not None

    def part(self, name: str) -> ModuleType | None:
        """The module `name` of the workload's room, imported now; None if it has none."""
        module = f"{self.room}.{name}"
        return import_module(module) if find_spec(module) else None

    def make(self, point: Point, mesh: Mesh) -> Any:
        """The tracer that is measured at a point, neither planned nor built: what `make` of the room's `measure` makes,
        or the point's own method. Raises InputError and MemoryBudgetError as the tracers do."""
        make = getattr(self.part("measure"), "make", make_own)
        return make(point, mesh)


@dataclass(frozen=True)
class Measured:
    """What came of a point; the fields are those of `experiments.harness.records.Record`."""

    results: dict[str, Any]
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
