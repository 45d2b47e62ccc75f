"""One planned point -> its record; and what makes the record out: configuration, machine, and the code that made it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from atra.compiled.instruction_sets import chosen_instruction_set
from atra.embree.library import embree_version
from atra.embree.scene import resolve_packet_width
from experiments.harness.environment import Environment, read_environment, stable_fields
from experiments.harness.point import Point
from experiments.harness.points import PlannedPoint
from experiments.harness.processes.launching import run_worker
from experiments.harness.processes.outcome import Outcome, skipped
from experiments.harness.records import Record, point_id
from experiments.harness.sources import Code, Source

_ROOT = Path(__file__).resolve().parents[2]
_OURS = ("atra", "experiments", "scenes")
"""Packages whose code is followed. The versions of others are part of the machine, or of the method that uses them."""

Runner = Callable[[Point], Outcome]


def current_environment() -> Environment:
    """This machine now, with the version Embree reports.

    Raises EmbreeError if there is no usable Embree, and InputError for an instruction set that this machine lacks.
    """
    return read_environment(embree_version(), chosen_instruction_set())


def identity(point: Point, environment: Environment) -> str:
    """The point's identity: its configuration, the machine, and the code that measures it."""
    return _identity(point, asdict(environment))


def identity_of(record: Record, point: Point) -> str:
    """The identity that `record` has if this very code has measured `point`, wherever that was."""
    return _identity(point, record.environment)


def _identity(point: Point, environment: Mapping[str, Any]) -> str:
    measured_by = {"code_sha256": code_sha256(point), "version": point.method.version()}
    return point_id(point.configuration() | measured_by, stable_fields(environment))


def code_sha256(point: Point) -> str:
    """Hash of the code that measures the point: that of its method, of its workload and of the harness."""
    return _sha256(code_roots(point))


def code_roots(point: Point) -> tuple[tuple[str, str | None], ...]:
    """Where that code begins, as `Code.parts` takes it: the module of the method; what measures the workload, and its
    options; what starts a worker, and with it what runs there."""
    workload = point.workload
    return (
        (point.method.module, None),
        workload.code,
        (workload.options.__module__, workload.options.__name__),
        (run_worker.__module__, None),
    )


@cache
def _sha256(roots: tuple[tuple[str, str | None], ...]) -> str:
    """The sources are read once: what is changed while a sweep runs has no part in what that sweep has loaded."""
    return _code(frozenset([*_OURS, *(module.partition(".")[0] for module, _ in roots)])).sha256(roots)


@cache
def _code(packages: frozenset[str]) -> Code:
    """The code of these packages."""
    return Code(lambda module: read_source(module) if module.partition(".")[0] in packages else None)


def read_source(module: str) -> Source | None:
    """The source of a module of this project, or of a package that can be imported; None if there is none."""
    package, *below = module.split(".")
    place = _place(package).joinpath(*below)
    for path in (place.with_suffix(".py"), place / "__init__.pyi", place / "__init__.py"):  # a stub names lazy imports
        if path.is_file():
            return Source(module, path.read_text(encoding="utf-8"), path.stem == "__init__")
    return None


@cache
def _place(package: str) -> Path:
    """The folder of a package, or the file of a module without one, less its suffix."""
    if package in _OURS:
        return _ROOT / package
    spec = find_spec(package)
    origin = Path(package if spec is None or spec.origin is None else spec.origin)
    return origin.parent if origin.name == "__init__.py" else origin.with_suffix("")


def measure(planned: PlannedPoint, run: Runner = run_worker) -> Record:
    """Measure a point in a fresh process; one with a problem is skipped, and its record says why."""
    environment = current_environment()
    outcome = skipped(planned.problem) if planned.problem is not None else run(planned.point)
    return Record(
        point_id=identity(planned.point, environment),
        status=outcome.status,
        error=outcome.error,
        configuration=planned.point.configuration(),
        environment=asdict(environment) | {"code_sha256": code_sha256(planned.point)},
        warmup_samples=outcome.warmup_samples,
        samples=outcome.samples,
        results={**_packets(planned.point), **outcome.results, "on_purpose": outcome.on_purpose},
    )


def _packets(point: Point) -> dict[str, int]:
    """The width of its packets, which a point that comes to nothing does not tell; a peer chooses its own."""
    if not point.method.has_packets:
        return {}
    return {"packet_width": resolve_packet_width(point.options.packet_width)}
