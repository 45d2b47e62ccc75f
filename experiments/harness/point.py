"""Point: what is measured, complete, as typed values. Workload: one thing to measure at a point, as a value, too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from experiments.harness.column import Column
from experiments.harness.method import Method, Tracing
from experiments.harness.options import plain, plain_options
from experiments.harness.records import Record

# Types alone: the help of the command line imports this module and has no use for NumPy and Numba.
if TYPE_CHECKING:
    from atra.geometry.camera import Camera
    from atra.geometry.mesh import Mesh
    from atra.geometry.numbers import Vector
    from atra.geometry.view import View
    from atra.tracing.tracer import Tracer

_TYPED = ("method", "options", "workload", "workload_options")
"""Fields of a point that are no plain values."""


@dataclass(frozen=True)
class Point:
    """One point to measure: the worker needs nothing else, and the record's identity is a hash of it.

    `triangles` and `mesh_sha256` describe the mesh as traced. process: which of the processes that measure the same.
    time_limit_s, memory_budget_gib: limits, no part of the identity; None = a share of what is free when it is traced.
    instruction_set: that its process is held to, by Embree's name; None = that of the run.
    options, workload_options: of the types that the method and the workload name; all else are plain JSON values.
    """

    scene: str
    scene_source: str
    scene_path: str | None
    mesh_sha256: str
    triangles: int
    view: str
    eye: Vector
    target: Vector
    up: Vector
    fov_y_degrees: float
    width: int
    height: int
    method: Method
    options: Any
    workload: Workload
    workload_options: Any
    threads: int | None
    build_quality: str
    ties: str
    rounds: int
    warmup: int
    frame_budget_s: float
    time_limit_s: float
    memory_budget_gib: float | None
    process: int = 0
    subdivided: int = 0
    copies: int = 1
    instruction_set: str | None = None

    def configuration(self) -> dict[str, Any]:
        """All fields as plain values: method and workload by name, their options in the sections `method_options` and
        `workload_options`."""
        fields = {name: plain(getattr(self, name)) for name in self.__dataclass_fields__ if name not in _TYPED}
        return fields | {
            "method": self.method.name,
            "workload": self.workload.name,
            "method_options": plain_options(self.options),
            "workload_options": plain_options(self.workload_options),
        }

    @property
    def camera(self) -> Camera:
        """The view; of several frames, the one that they are made of."""
        from atra.geometry.camera import Camera

        return Camera(self.eye, self.target, self.up, self.fov_y_degrees, self.width, self.height)

    @property
    def tracing(self) -> Tracing:
        """What holds for everything traced at the point, in this process and now: the budget may follow the machine."""
        from experiments.harness.environment import memory_budget_bytes

        return Tracing(self.threads, self.build_quality, self.ties, memory_budget_bytes(self.memory_budget_gib))

    @property
    def row(self) -> dict[str, Any]:
        """Its fields and options side by side, as in a row of the table."""
        values = self.configuration()
        return {**values.pop("method_options"), **values.pop("workload_options"), **values}


def make_own(point: Point, mesh: Mesh, view: View | None = None) -> Tracer:
    """The point's own method. view: in place of the point's. Raises InputError and MemoryBudgetError as the tracers
    do."""
    return point.method.make(mesh, view or point.camera, point.options, point.tracing)


def no_canary(record: Record) -> float | None:
    """Nothing is measured that every method leaves alike."""
    return None


@dataclass(frozen=True)
class Workload:
    """A workload.

    name: as configured. options: its own typed settings, with defaults. columns: of the table, each read from a record.
    headline: a measured record -> its line on the terminal. package: that defines it, with its function
    `measure`, and `make` where not the method's own tracer is measured; both may stand in a module `measure` of the
    package. Two more modules may stand there, imported only where they are needed: `files` writes those of a single
    point; `shown`, for a sweep, has any of FIGURES, CLAIMS and their file CLAIMS_FILE, `sweep_lines` and
    `process_lines` for the terminal, and `write` for further files, with FILES, patterns of their names.
    samples: which series a record of a point must hold. optional: series that it may hold beside these, at least one.
    judged: the series whose spread flag a point. needs: results that a measured record holds at least.
    canary: what a measured record says of the machine alone (`experiments.results.processes`).
    problem: why a point cannot be measured. once: the name under which older tables have its rows, those with a value
    of its first option. rays: a row -> the kind of rays it traces, None = the workload's name. told: columns that the
    terminal shows of every point of a sweep, with {} those whose interval it shows, too.
    """

    name: str
    options: type
    columns: tuple[Column, ...]
    headline: Callable[[Record], str]
    package: str
    samples: Callable[[Point], frozenset[str]] | None = lambda point: frozenset()
    optional: frozenset[str] = frozenset()
    judged: str | None = None
    needs: tuple[str, ...] = ()
    canary: Callable[[Record], float | None] = no_canary
    problem: Callable[[Point], str | None] = lambda point: None
    once: str | None = None
    rays: Callable[[Mapping[str, Any]], str] | None = None
    told: tuple[str, ...] = ()

    def rays_of(self, row: Mapping[str, Any]) -> str:
        """The kind of rays that a row's point traces, in words."""
        return self.name.replace("_", " ") if self.rays is None else self.rays(row)

    @property
    def is_timed(self) -> bool:
        """Whether several processes measure it; where nothing is timed they would all find the same."""
        return self.judged is not None

    def part(self, name: str) -> ModuleType | None:
        """The module `name` of the workload's package, imported now; None if it has none, or is a module itself."""
        module = f"{self.package}.{name}"
        try:
            return import_module(module) if find_spec(module) else None
        except ModuleNotFoundError as error:
            if error.name not in (module, self.package):
                raise
            return None

    def make(self, point: Point, mesh: Mesh) -> Any:
        """The tracer that is measured at a point, neither planned nor built: what its own `make` makes, or the point's
        own method. Raises InputError and MemoryBudgetError as the tracers do."""
        make = getattr(self.part("measure") or import_module(self.package), "make", make_own)
        return make(point, mesh)

    def measure(self, point: Point) -> Measured:
        """Measure a point, in this process. Raises what its `measure` raises."""
        measured: Measured = (self.part("measure") or import_module(self.package)).measure(point)
        return measured


class Kind(NamedTuple):
    """What a group of the configuration chooses from. names: all that there are, none of which is imported. find: name
    -> the method or workload, imported alone; raises InputError for a name that is none."""

    names: Callable[[], Sequence[str]]
    find: Callable[[str], Any]


Kinds = Mapping[str, Kind]
"""By group: `method` and `workload`."""


@dataclass(frozen=True)
class Measured:
    """What came of a point; the fields are those of `experiments.harness.records.Record`."""

    results: dict[str, Any]
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
