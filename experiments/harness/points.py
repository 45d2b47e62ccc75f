"""Configuration -> points, everything looked up and checked before any work -> records."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from atra.compiled.instruction_sets import instruction_sets_here
from atra.embree.scene import resolve_packet_width
from atra.errors import AtraError, InputError, MemoryBudgetError, printable
from atra.geometry.mesh import Mesh
from experiments.harness.configuration import Configuration
from experiments.harness.entry_points import FORECASTS_GROUP, offers
from experiments.harness.identity import code_of_worker, current_environment, identity
from experiments.harness.options import plain_options
from experiments.harness.point import Point
from experiments.harness.processes.launching import run_worker
from experiments.harness.processes.worker import MAY_CHANGE, skipped
from experiments.harness.progress import say
from experiments.harness.records import Record
from scenes.loading import load_scene, replace_missing_scenes
from scenes.scene import Scene
from scenes.views import view_fields

_LAST = ("packet_width", "culling", "frames", "split_y", "split_x")
"""Settings by which the rows of a method are ordered last, as numbers."""

Runner = Callable[[Point], Record]


@dataclass(frozen=True)
class PlannedPoint:
    """A point and, if it cannot be measured at all, why. Of a sweep: the grids it is part of, and what composes it."""

    point: Point
    problem: AtraError | None
    grids: tuple[str, ...] = ()
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class GridPoint:
    """configuration: one point of the grid called `grid`. overrides: what composes it, as on the command line. asked:
    the fields among these that the user set."""

    grid: str
    configuration: Configuration
    overrides: tuple[str, ...] = ()
    asked: frozenset[str] = frozenset()


def plan_points(configurations: Sequence[Configuration]) -> list[PlannedPoint]:
    """Resolve and check every configuration; loads each scene once, one at a time, and measures nothing.

    Raises InputError at once for what no other point can make good: an unknown scene, or an unusable file. What makes
    its method unusable, such as a split that does not suit the image or copies that exceed the memory budget, concerns
    that point alone and becomes its `problem`; if all have such an InputError, the first is raised.
    """
    places: dict[tuple[Any, ...], list[int]] = {}
    for place, configuration in enumerate(configurations):
        scene = configuration.scene
        key = (scene.source, scene.name, scene.path, scene.subdivided, scene.copies)
        places.setdefault(key, []).append(place)
    planned: dict[int, PlannedPoint] = {}
    for key, of_scene in places.items():
        loaded = load_scene(*key)
        for place in of_scene:
            point = _resolve(configurations[place], loaded)
            planned[place] = PlannedPoint(point, _problem(point, loaded.mesh))
        limit = configurations[of_scene[0]].sweep.skip_slower
        if limit is not None:
            possible = {place: planned[place].point for place in of_scene if planned[place].problem is None}
            slow = _forecast()(possible, loaded.mesh, limit)
            planned |= {place: PlannedPoint(possible[place], problem) for place, problem in slow.items()}
    if planned and all(isinstance(planned_point.problem, InputError) for planned_point in planned.values()):
        raise InputError(str(planned[0].problem))
    return [planned[place] for place in range(len(configurations))]


def _forecast() -> Callable[[dict[int, Point], Mesh, float], dict[int, AtraError]]:
    """What predicts slow points; loaded only where a sweep asks for it. Raises InputError where no package does."""
    offer = next(offers(FORECASTS_GROUP), None)
    if offer is None or offer.value is None:
        problem = "no package offers a forecast" if offer is None else offer.problem
        raise InputError(f"sweep.skip_slower needs a forecast: {problem}; expected sweep.skip_slower=null")
    forecast: Callable[[dict[int, Point], Mesh, float], dict[int, AtraError]] = offer.value
    return forecast


_OF_SWEEPS = ("processes", "idle_limit_s")
"""Fields of `MeasureConfiguration` that concern a sweep and no point of it."""

_CAMERA = ("eye", "target", "up", "fov_y_degrees")
"""Fields of a scene's configuration that stand in place of those of its view."""

_OF_ALL = ("width", "height", "threads", "build_quality", "ties")
"""Fields of a configuration that a point has, too."""


def _resolve(configuration: Configuration, scene: Scene) -> Point:
    """Raises InputError for an unknown view."""
    given, method, workload = configuration.scene, configuration.method.kind, configuration.workload
    path = None if given.path is None else str(Path(given.path).expanduser().resolve())
    view = view_fields(scene.mesh, scene.camera, given.view)
    view |= {name: getattr(given, name) for name in _CAMERA if getattr(given, name) is not None}
    camera: dict[str, Any] = {name: tuple(map(float, view[name])) for name in ("eye", "target", "up")}
    return Point(
        scene=given.name or printable(Path(given.path or "scene").stem),
        scene_source=given.source.value,
        scene_path=path,
        mesh_sha256=scene.mesh_sha256,
        subdivided=given.subdivided,
        copies=given.copies,
        triangles=int(scene.mesh.triangle_count),
        view=given.view,
        **camera,
        fov_y_degrees=float(view["fov_y_degrees"]),
        **{name: getattr(configuration, name) for name in _OF_ALL},
        method=method,
        options=method.resolve(configuration.method.options, configuration.width),
        workload=workload.kind,
        workload_options=workload.options,
        **{name: value for name, value in vars(configuration.measure).items() if name not in _OF_SWEEPS},
    )


def _problem(point: Point, mesh: Mesh) -> AtraError | None:
    problem = point.workload.problem(point)
    if problem is not None:
        return InputError(problem)
    if point.instruction_set not in (None, *instruction_sets_here()):
        here = ", ".join(instruction_sets_here()) or "none here"
        return InputError(f"measure.instruction_set is {point.instruction_set!r}, expected one of {here}, or null")
    try:
        point.workload.make(point, mesh).close()  # the constructor checks everything; nothing is built
    except (InputError, MemoryBudgetError) as error:
        return error
    return None


def plan_sweep(grid_points: Sequence[GridPoint], console: Console) -> dict[str, PlannedPoint]:
    """Points by identity, each process of each once.

    Raises InputError as `plan_points`, and for a field that the user set where no point can be measured with it.
    """
    configurations = [grid_point.configuration for grid_point in grid_points]
    if configurations[0].sweep.stand_ins:
        for note in replace_missing_scenes([configuration.scene for configuration in configurations]):
            say(console, note)
    environment = current_environment()
    points: dict[str, PlannedPoint] = {}
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
            point = replace(planned.point, process=process)
            overrides = (*grid_point.overrides, *(() if process == 0 else (f"measure.process={process}",)))
            points[identity(point, environment)] = PlannedPoint(point, planned.problem, grids, overrides)
    return points


def in_order(points: dict[str, PlannedPoint], done: Collection[str]) -> list[str]:
    """Identities of the points done: scenes in the order given, each by what was measured, with rising settings."""
    scenes = list(dict.fromkeys(point.point.scene for point in points.values()))
    workloads = list(dict.fromkeys(point.point.workload.name for point in points.values()))

    def rank(name: str) -> tuple[Any, ...]:
        point = points[name].point
        options = {**plain_options(point.workload_options), **plain_options(point.options)}
        # Splits rise last; what is left open comes before any value.
        others = sorted((key, (value is not None, str(value))) for key, value in options.items() if key not in _LAST)
        splits = [options.get(key) or 0 for key in _LAST]
        return scenes.index(point.scene), workloads.index(point.workload.name), point.method.name, others, splits

    return sorted((name for name in points if name in done), key=rank)


def measure(planned: PlannedPoint, run: Runner = run_worker) -> Record:
    """Measure a point in a fresh process; one with a problem is skipped, and its record says why."""
    environment = current_environment()
    record = skipped(planned.problem) if planned.problem is not None else run(planned.point)
    files = record.files if isinstance(record.files, dict) else {}
    return replace(
        record,
        point_id=identity(planned.point, environment),
        configuration=planned.point.configuration(),
        environment=environment | {"code_sha256": code_of_worker(files)},
        results=_packets(planned.point) | record.results,
        files=sorted(files),
    )


def _packets(point: Point) -> dict[str, int]:
    """The width of its packets, which a point that comes to nothing does not tell; a peer chooses its own."""
    if not point.method.has_packets:
        return {}
    return {"packet_width": resolve_packet_width(point.options.packet_width)}
