"""Point: what is measured, complete, as plain and typed values; crosses to the worker and makes a record's identity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from atra.geometry.camera import Camera, Vector
from experiments.harness.environment import memory_budget_bytes
from experiments.harness.options import plain, plain_options
from experiments.methods.method import Tracing

_TYPED = ("options", "workload_options")


@dataclass(frozen=True)
class Point:
    """One point to measure: the worker needs nothing else, and the record's identity is a hash of it.

    `triangles` and `mesh_sha256` describe the mesh as traced. process: which of the processes that measure the same.
    memory_budget_gib: None = a share of what is free when it is traced, which is no part of the point.
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
    method: str
    options: Any
    workload: str
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

    def configuration(self) -> dict[str, Any]:
        """All fields as plain values; options by name of their section, `method_options` and `workload_options`."""
        fields = {name: plain(getattr(self, name)) for name in self.__dataclass_fields__ if name not in _TYPED}
        return fields | {
            "method_options": plain_options(self.options),
            "workload_options": plain_options(self.workload_options),
        }

    @property
    def camera(self) -> Camera:
        """The view; of several frames, the one that they are made of."""
        return Camera(self.eye, self.target, self.up, self.fov_y_degrees, self.width, self.height)

    @property
    def tracing(self) -> Tracing:
        """What holds for everything traced at the point, in this process and now: the budget may follow the machine."""
        return Tracing(self.threads, self.build_quality, self.ties, memory_budget_bytes(self.memory_budget_gib))

    @property
    def row(self) -> dict[str, Any]:
        """Its fields and options side by side, as in a row of the table."""
        values = self.configuration()
        return {**values.pop("method_options"), **values.pop("workload_options"), **values}
