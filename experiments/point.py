"""One point to measure, as plain values: what crosses to the worker, and what a record's identity is made of."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from atra.camera import Camera, Vector
from experiments.configuration import Geometry, Method, Quantity


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
        if self.method == Method.pixel.value:
            details.append("one ray per pixel")
        elif self.method != Method.aligned.value:
            details += [self.method, f"split {self.split_x}x{self.split_y}"]
        else:
            kind = "instanced" if self.geometry == Geometry.instanced.value else f"culling {_on_off(self.culling)}"
            details += [f"split {self.split_x}x{self.split_y}", kind]
        if self.quantity != Quantity.time.value:
            details.append(self.quantity)
        return ", ".join(details)


def _on_off(value: bool) -> str:
    return "on" if value else "off"
