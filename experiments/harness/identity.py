"""One planned point -> its record."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from atra.embree.instruction_sets import chosen_instruction_set
from atra.embree.library import embree_version
from atra.embree.scene import resolve_packet_width
from experiments.harness.environment import STABLE_FIELDS, Environment, read_environment
from experiments.harness.launching import run_worker
from experiments.harness.outcome import Outcome, skipped
from experiments.harness.point import Point
from experiments.harness.points import PlannedPoint
from experiments.harness.records import Record, point_id
from experiments.methods import METHODS, find_method
from experiments.workloads import WORKLOADS

_ROOT = Path(__file__).resolve().parents[2]
_OURS = ("experiments", "scenes")
"""Packages whose code measures; the library has a hash of its own in the environment."""

Runner = Callable[[Point], Outcome]


def current_environment() -> Environment:
    """This machine now, with the version Embree reports.

    Raises EmbreeError if there is no usable Embree, and InputError for an instruction set that this machine lacks.
    """
    return read_environment(embree_version(), chosen_instruction_set())


def identity(point: Point, environment: Environment) -> str:
    """The point's identity: its configuration, the machine, and the code that measures it."""
    return _identity(point.configuration(), environment.stable())


def identity_of(record: Record) -> str:
    """The identity `record` has if this very code has measured it, wherever that was and whatever its name says."""
    stable = {name: record.environment.get(name) for name in STABLE_FIELDS}
    return _identity(record.configuration, stable)


def _identity(configuration: dict[str, Any], stable_environment: dict[str, Any]) -> str:
    measured_by: dict[str, str | None] = {"measuring_code_sha256": _measuring_code_sha256()}
    # A record of another version may have a method that is unknown here.
    versions = [method.version() for method in METHODS if method.name == configuration.get("method")]
    if versions and versions[0] is not None:
        measured_by["version"] = versions[0]
    return point_id(configuration | measured_by, stable_environment)


@cache
def _measuring_code_sha256() -> str:
    """The library's own source is part of the environment; this is of what runs it in the worker."""
    digest = hashlib.sha256()
    for path in imported_sources("experiments.worker", *(f"{workload.room}.measure" for workload in WORKLOADS)):
        digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def imported_sources(*modules: str) -> list[Path]:
    """The sources of these modules and of all of ours outside the library that they import, directly or not, at once
    or when needed."""
    found: set[Path] = set()
    waiting, known = set(modules), set(modules)
    while waiting:
        stem = _ROOT.joinpath(*waiting.pop().split("."))
        for path in filter(Path.is_file, (stem.with_suffix(".py"), stem / "__init__.py")):
            found.add(path)
            new = {name for name in _imports(path) if name.partition(".")[0] in _OURS} - known
            waiting |= new
            known |= new
    return sorted(found)


def _imports(path: Path) -> set[str]:
    """What may be a module that the source imports, and the packages around it, which Python imports with it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return {".".join(parts[:end]) for parts in (name.split(".") for name in names) for end in range(1, len(parts) + 1)}


def measure(planned: PlannedPoint, run: Runner = run_worker) -> Record:
    """Measure a point in a fresh process; one with a problem is skipped, and its record says why."""
    environment = current_environment()
    outcome = skipped(planned.problem) if planned.problem is not None else run(planned.point)
    return Record(
        point_id=identity(planned.point, environment),
        status=outcome.status,
        error=outcome.error,
        configuration=planned.point.configuration(),
        environment=asdict(environment),
        warmup_samples=outcome.warmup_samples,
        samples=outcome.samples,
        results={**_packets(planned.point), **outcome.results, "on_purpose": outcome.on_purpose},
    )


def _packets(point: Point) -> dict[str, int]:
    """The width of its packets, which a point that comes to nothing does not tell; a peer chooses its own."""
    if not find_method(point.method).has_packets:
        return {}
    return {"packet_width": resolve_packet_width(point.options.packet_width)}
