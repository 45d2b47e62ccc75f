"""Configuration -> points: everything looked up and checked, before any work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from atra.camera import Camera, Vector
from atra.errors import AtraError, InputError, MemoryBudgetError
from atra.mesh import Mesh
from atra.tracers import AlignedTracer, PixelTracer
from experiments.configuration import Configuration, Geometry, Method, Quantity, SceneConfiguration, SceneSource
from experiments.scene_loading import load_scene, mesh_sha256

_LARGEST_DEFAULT_SPLIT = 128


@dataclass(frozen=True)
class Point:
    """One point to measure, complete: the worker needs nothing else, and the record's identity is a hash of it.

    Plain JSON values only. `triangles` and `mesh_sha256` describe the mesh as loaded.
    """

    scene: str
    scene_source: str
    scene_path: str | None
    mesh_sha256: str
    triangles: int
    eye: Vector
    target: Vector
    up: Vector
    fov_y_degrees: float
    width: int
    height: int
    method: str
    geometry: str
    split_x: int
    split_y: int
    culling: bool
    packet_width: int | None
    threads: int | None
    build_quality: str
    quantity: str
    rounds: int
    warmup: int
    frame_budget_s: float
    time_limit_s: float
    memory_budget_gib: float

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Point:
        """The reverse of `configuration` (JSON turns tuples into lists)."""
        vectors = {name: tuple(fields[name]) for name in ("eye", "target", "up")}
        return cls(**{**fields, **vectors})

    def configuration(self) -> dict[str, Any]:
        """All fields as plain values."""
        fields = asdict(self)
        return {name: list(value) if isinstance(value, tuple) else value for name, value in fields.items()}

    @property
    def camera(self) -> Camera:
        return Camera(self.eye, self.target, self.up, self.fov_y_degrees, self.width, self.height)

    @property
    def memory_budget_bytes(self) -> int:
        return int(self.memory_budget_gib * 2**30)

    def label(self) -> str:
        """Short text for progress and messages."""
        width = self.packet_width or "native width"
        details = [self.scene, "single rays" if width == 1 else f"packets of {width}"]
        if self.method == Method.aligned.value:
            kind = "instanced" if self.geometry == Geometry.instanced.value else f"culling {_on_off(self.culling)}"
            details += [f"split {self.split_x}x{self.split_y}", kind]
        else:
            details.append("one ray per pixel")
        if self.quantity != Quantity.time.value:
            details.append(self.quantity)
        return ", ".join(details)


def _on_off(value: bool) -> str:
    return "on" if value else "off"


@dataclass(frozen=True)
class PlannedPoint:
    """A point and, if it cannot be measured at all, why."""

    point: Point
    problem: AtraError | None


@dataclass(frozen=True)
class _Scene:
    mesh: Mesh
    sha256: str
    camera: dict[str, Any]


def plan_points(configurations: Sequence[Configuration]) -> list[PlannedPoint]:
    """Resolve and check every configuration; loads each scene once and measures nothing.

    Raises InputError at once for what no other point can make good: an unknown scene, an unusable file, camera,
    packet width or thread count. A split that does not suit its image, or copies that exceed the memory budget,
    concern that point alone and become its `problem`; if no split suits, the first such error is raised.
    """
    scenes: dict[tuple[SceneSource, str | None, str | None], _Scene] = {}
    checked: set[tuple[Any, ...]] = set()
    planned = []
    for configuration in configurations:
        key = (configuration.scene.source, configuration.scene.name, configuration.scene.path)
        if key not in scenes:
            mesh, camera = load_scene(*key)
            scenes[key] = _Scene(mesh, mesh_sha256(mesh), camera)
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


def _resolve(configuration: Configuration, scene: _Scene) -> Point:
    given, measure = configuration.scene, configuration.measure
    aligned = configuration.method is Method.aligned
    split_x = configuration.split_x
    if split_x is None:
        split_x = default_split_x(configuration.width) if aligned else 1
    path = None if given.path is None else str(Path(given.path).resolve())
    return Point(
        scene=given.name or Path(given.path or "scene").stem,
        scene_source=given.source.value,
        scene_path=path,
        mesh_sha256=scene.sha256,
        triangles=int(scene.mesh.triangle_count),
        **_camera_fields(given, scene.camera),
        width=configuration.width,
        height=configuration.height,
        method=configuration.method.value,
        geometry=configuration.geometry.value if aligned else Geometry.copied.value,
        split_x=split_x,
        split_y=configuration.split_y,
        culling=configuration.culling and aligned and configuration.geometry is Geometry.copied,
        packet_width=configuration.packet_width,
        threads=configuration.threads,
        build_quality=configuration.build_quality.value,
        quantity=measure.quantity.value,
        rounds=measure.rounds,
        warmup=measure.warmup,
        frame_budget_s=measure.frame_budget_s,
        time_limit_s=measure.time_limit_s,
        memory_budget_gib=measure.memory_budget_gib,
    )


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


def _problem(point: Point, mesh: Mesh) -> AtraError | None:
    if point.method == Method.pixel.value:
        if (point.split_x, point.split_y) == (1, 1):
            return None
        split = f"split ({point.split_x}, {point.split_y})"
        return InputError(f"{split} with method=pixel, which has no cells; use method=aligned or a split of 1")
    try:
        AlignedTracer(
            mesh,
            point.camera,
            split=(point.split_x, point.split_y),
            culling=point.culling,
            geometry=point.geometry,
            packet_width=point.packet_width,
            threads=point.threads,
            build_quality=point.build_quality,
            memory_budget_bytes=point.memory_budget_bytes,
        ).close()
    except (InputError, MemoryBudgetError) as error:
        return error
    return None
