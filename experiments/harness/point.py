"""One point to measure, as plain values: what crosses to the worker, and what a record's identity is made of."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from atra.geometry.camera import Camera, Vector
from experiments.harness.configuration import Geometry, Method, Quantity, Ties

Offset = tuple[float, float]

PIXEL_CENTRE: Offset = (0.5, 0.5)


@dataclass(frozen=True)
class Point:
    """One point to measure, complete: the worker needs nothing else, and the record's identity is a hash of it.

    Plain JSON values only. `triangles` and `mesh_sha256` describe the mesh as loaded. Of several frames, eye, target,
    up and fov_y_degrees are the view that `motion` makes them of.
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
    packet_rows: int | None
    threads: int | None
    build_quality: str
    ties: str
    quantity: str
    rounds: int
    warmup: int
    frame_budget_s: float
    time_limit_s: float
    memory_budget_gib: float
    offsets: tuple[Offset, ...] = (PIXEL_CENTRE,)
    sample_rays: int = 0
    frames: int = 1
    motion: str | None = None
    view: str = "own"

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Point:
        """The reverse of `configuration` (JSON turns tuples into lists)."""
        return cls(**{name: _frozen(value) for name, value in fields.items()})

    def configuration(self) -> dict[str, Any]:
        """All fields as plain values."""
        return {name: _plain(value) for name, value in asdict(self).items()}

    @property
    def camera(self) -> Camera:
        return Camera(self.eye, self.target, self.up, self.fov_y_degrees, self.width, self.height)

    @property
    def memory_budget_bytes(self) -> int:
        return int(self.memory_budget_gib * 2**30)

    def label(self) -> str:
        """Short text for progress and messages."""
        method = Method(self.method)
        details = [self.scene]
        if self.view != "own":
            details.append(f"view {self.view}")
        if method in (Method.pixel, Method.aligned, Method.visible_first, Method.tiles):
            width = self.packet_width or "native width"
            details.append("single rays" if width == 1 else f"packets of {width}")
        if method is Method.pixel:
            details.append("one ray per pixel")
        elif method is not Method.aligned:
            details.append(self.method)
        if method.has_cells:
            details.append(f"split {self.split_x}x{self.split_y}")
        if method is Method.aligned:
            instanced = self.geometry == Geometry.instanced.value
            details.append("instanced" if instanced else f"culling {'on' if self.culling else 'off'}")
        if self.frames > 1:
            details.append(f"{self.frames} frames, {self.motion}")
        if self.threads != 1:
            details.append("every core" if self.threads is None else f"{self.threads} threads")
        if self.ties != Ties.lowest.value:
            details.append(f"ties {self.ties}")
        if self.quantity != Quantity.time.value:
            details.append(self.quantity)
        return ", ".join(details)


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    return list(map(_plain, value)) if isinstance(value, tuple) else value
