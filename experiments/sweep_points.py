"""The points of a sweep: planned from its grids, each once, and put in the order of the table."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rich.console import Console

from atra.errors import InputError
from experiments.harness.configuration import Configuration
from experiments.harness.identity import current_environment, identity
from experiments.harness.options import plain_options
from experiments.harness.points import PlannedPoint, plan_points
from experiments.harness.processes.outcome import MAY_CHANGE
from experiments.harness.progress import say
from scenes.loading import replace_missing_scenes

_LAST = ("packet_width", "culling", "frames", "split_y", "split_x")
"""Settings by which the rows of a method are ordered last, as numbers."""


@dataclass(frozen=True)
class GridPoint:
    """configuration: one point of the grid called `grid`. overrides: what composes it, as on the command line. asked:
    the fields among these that the user set."""

    grid: str
    configuration: Configuration
    overrides: tuple[str, ...] = ()
    asked: frozenset[str] = frozenset()


@dataclass(frozen=True)
class SweepPoint:
    """A point of a sweep in one of its processes, the grids it is part of, and what composes it."""

    planned: PlannedPoint
    grids: tuple[str, ...]
    overrides: tuple[str, ...]


def plan_sweep(grid_points: Sequence[GridPoint], console: Console) -> dict[str, SweepPoint]:
    """Points by identity, each once. Raises InputError as `plan_points`, and for a field that the user set where no
    point can be measured with it."""
    configurations = [one.configuration for one in grid_points]
    if configurations[0].sweep.stand_ins:
        for note in replace_missing_scenes([configuration.scene for configuration in configurations]):
            say(console, note)
    environment = current_environment()
    points: dict[str, SweepPoint] = {}
    every = list(zip(grid_points, plan_points(configurations), strict=True))
    for name in sorted({name for grid_point in grid_points for name in grid_point.asked}):
        problems = [planned.problem for grid_point, planned in every if name in grid_point.asked]
        if all(isinstance(problem, InputError) for problem in problems):
            raise InputError(f"{name} fits no point of the sweep: {problems[0]}")
    for grid_point, planned in every:
        point_identity = identity(planned.point, environment)
        before = points[point_identity].grids if point_identity in points else ()
        grids = tuple(dict.fromkeys([*before, grid_point.grid]))
        # One that lacks memory now may have been measured when there was more, and a slow one where it was wanted.
        possible = planned.problem is None or isinstance(planned.problem, tuple(MAY_CHANGE))
        repeated = planned.point.workload.is_timed and possible
        for process in range(grid_point.configuration.measure.processes if repeated else 1):
            of_process = replace(planned, point=replace(planned.point, process=process))
            overrides = (*grid_point.overrides, *(() if process == 0 else (f"measure.process={process}",)))
            points[identity(of_process.point, environment)] = SweepPoint(of_process, grids, overrides)
    return points


def in_order(points: dict[str, SweepPoint], done: Collection[str]) -> list[str]:
    """Identities of the points done: scenes in the order given, each by what was measured, with rising settings."""
    scenes = list(dict.fromkeys(one.planned.point.scene for one in points.values()))
    workloads = list(dict.fromkeys(one.planned.point.workload.name for one in points.values()))

    def rank(name: str) -> tuple[Any, ...]:
        point = points[name].planned.point
        options = {**plain_options(point.workload_options), **plain_options(point.options)}
        # Splits rise last; what is left open comes before any value.
        others = sorted((key, (value is not None, str(value))) for key, value in options.items() if key not in _LAST)
        splits = [options.get(key) or 0 for key in _LAST]
        return scenes.index(point.scene), workloads.index(point.workload.name), point.method.name, others, splits

    return sorted((name for name in points if name in done), key=rank)
