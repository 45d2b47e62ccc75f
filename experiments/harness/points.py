"""Configuration -> points: everything looked up and checked, before any work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from atra.errors import AtraError, InputError, MemoryBudgetError, printable
from atra.geometry.mesh import Mesh
from atra.tracers import PixelTracer
from experiments.harness.configuration import (
    Configuration,
    Geometry,
    MeasureConfiguration,
    Method,
    Quantity,
    SceneConfiguration,
    SceneSource,
)
from experiments.harness.point import Point
from experiments.harness.scene_loading import load_scene
from experiments.harness.views import view_fields
from experiments.workloads.multiframe.frame_tracing import check_frames, make_own_tracer
from scenes.scene import Scene

_LARGEST_DEFAULT_SPLIT = 128


@dataclass(frozen=True)
class PlannedPoint:
    """A point and, if it cannot be measured at all, why."""

    point: Point
    problem: AtraError | None


def plan_points(configurations: Sequence[Configuration]) -> list[PlannedPoint]:
    """Resolve and check every configuration; loads each scene once and measures nothing.

    Raises InputError at once for what no other point can make good: an unknown scene, an unusable file, camera,
    packet width or thread count. A split that does not suit its image, or copies that exceed the memory budget,
    concern that point alone and become its `problem`; if no split suits, the first such error is raised.
    """
    scenes: dict[tuple[SceneSource, str | None, str | None], Scene] = {}
    checked: set[tuple[Any, ...]] = set()
    planned = []
    for configuration in configurations:
        key = (configuration.scene.source, configuration.scene.name, configuration.scene.path)
        if key not in scenes:
            scenes[key] = load_scene(*key)
        point = _resolve(configuration, scenes[key])
        camera_of_point = point.camera
        tracer_key = (key, camera_of_point, point.packet_width, point.threads, point.build_quality)
        if tracer_key not in checked:
            PixelTracer(
                scenes[key].mesh,
                camera_of_point,
                packet_width=point.packet_width,
                threads=point.threads,
                build_quality=point.build_quality,
            ).close()  # the constructor has checked everything; nothing is built
            checked.add(tracer_key)
        planned.append(PlannedPoint(point, _problem(point, scenes[key].mesh)))
    if planned and all(isinstance(one.problem, InputError) for one in planned):
        raise InputError(str(planned[0].problem))
    return planned


def _resolve(configuration: Configuration, scene: Scene) -> Point:
    given, measure = configuration.scene, configuration.measure
    method = configuration.method
    geometry = configuration.geometry if method is Method.aligned else Geometry.copied
    split_x = configuration.split_x
    if split_x is None:
        split_x = default_split_x(configuration.width) if method.has_cells else 1
    path = None if given.path is None else str(Path(given.path).expanduser().resolve())
    return Point(
        scene=given.name or printable(Path(given.path or "scene").stem),
        scene_source=given.source.value,
        scene_path=path,
        mesh_sha256=scene.mesh_sha256,
        triangles=int(scene.mesh.triangle_count),
        view=given.view,
        **_camera_fields(given, view_fields(scene.mesh, scene.camera, given.view)),
        width=configuration.width,
        height=configuration.height,
        method=method.value,
        geometry=geometry.value,
        split_x=split_x,
        split_y=configuration.split_y,
        culling=_culls(configuration),
        packet_width=configuration.packet_width,
        packet_rows=configuration.packet_rows,
        threads=configuration.threads,
        build_quality=configuration.build_quality.value,
        ties=configuration.ties.value,
        quantity=measure.quantity.value,
        rounds=measure.rounds,
        warmup=measure.warmup,
        frame_budget_s=measure.frame_budget_s,
        time_limit_s=measure.time_limit_s,
        memory_budget_gib=measure.memory_budget_gib,
        **_compared_rays(measure),
        frames=configuration.frames,
        motion=configuration.motion.value if configuration.motion else None,
    )


def _compared_rays(measure: MeasureConfiguration) -> dict[str, Any]:
    """What only a point of agreement is about; any other keeps the fields' defaults, and with them its identity."""
    if measure.quantity is not Quantity.agreement:
        return {}
    offsets = tuple((float(x), float(y)) for x, y in measure.offsets)
    return {"offsets": offsets, "sample_rays": measure.sample_rays}


def _camera_fields(given: SceneConfiguration, scene_camera: dict[str, Any]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name in ("eye", "target", "up"):
        value = getattr(given, name)
        x, y, z = scene_camera[name] if value is None else value
        fields[name] = (float(x), float(y), float(z))
    fov = given.fov_y_degrees
    fields["fov_y_degrees"] = float(scene_camera["fov_y_degrees"] if fov is None else fov)
    return fields


def default_split_x(width: int) -> int:
    """The largest power of two, at most 128, that divides `width`."""
    return min(_LARGEST_DEFAULT_SPLIT, width & -width)


def _culls(configuration: Configuration) -> bool:
    """Whether the copies are culled: asked for, or part of the method."""
    if configuration.method is Method.aligned:
        return configuration.culling and configuration.geometry is Geometry.copied
    return configuration.method.has_cells


def _problem(point: Point, mesh: Mesh) -> AtraError | None:
    if not Method(point.method).has_cells and (point.split_x, point.split_y) != (1, 1):
        split = f"split ({point.split_x}, {point.split_y})"
        return InputError(f"{split} with method={point.method}, which has no cells; use method=aligned or a split of 1")
    try:
        check_frames(point)
        make_own_tracer(point, mesh, point.camera).close()  # the constructor checks everything; nothing is built
    except (InputError, MemoryBudgetError) as error:
        return error
    return None
