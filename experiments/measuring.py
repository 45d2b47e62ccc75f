"""One planned point -> its record."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from atra.embree.library import embree_version
from atra.measure.environment import Environment, read_environment
from atra.planner.estimate import MODEL_FILE
from atra.records import Record, point_id
from experiments import launch, planner, quantities, tracing, worker
from experiments.launch import run_worker
from experiments.point import Point
from experiments.points import PlannedPoint
from experiments.worker import Outcome

Runner = Callable[[Point], Outcome]


def current_environment() -> Environment:
    """This machine now, with the version Embree reports; raises EmbreeError if there is no usable Embree."""
    return read_environment(embree_version())


def identity(point: Point, environment: Environment) -> str:
    """The point's identity: its configuration, the machine, and the code that measures it."""
    return point_id({**point.configuration(), "measuring_code_sha256": _measuring_code_sha256()}, environment.stable())


@cache
def _measuring_code_sha256() -> str:
    """The library's own source is part of the environment; this is what runs it in the worker."""
    digest = hashlib.sha256()
    for path in (launch.__file__, quantities.__file__, tracing.__file__, worker.__file__, planner.__file__, MODEL_FILE):
        digest.update(Path(str(path)).read_bytes())
    return digest.hexdigest()


def measure(planned: PlannedPoint, run: Runner = run_worker) -> Record:
    """Measure a point in a fresh process; one with a problem is skipped, and its record says why."""
    environment = current_environment()
    if planned.problem is not None:
        outcome = Outcome("skipped", str(planned.problem), on_purpose=True)
    else:
        outcome = run(planned.point)
    return Record(
        point_id=identity(planned.point, environment),
        status=outcome.status,
        error=outcome.error,
        configuration=planned.point.configuration(),
        environment=_plain(asdict(environment)),
        warmup_samples=outcome.warmup_samples,
        samples=outcome.samples,
        results={**outcome.results, "on_purpose": outcome.on_purpose},
    )


def _plain(fields: dict[str, Any]) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in fields.items()}
