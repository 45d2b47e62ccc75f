"""The protocol of a tracer: what harness and comparison know of every method."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Protocol, Self, TypeVar

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits


class Images(Protocol):
    """What one call of `trace` returns: one image, or several."""

    @property
    def images(self) -> tuple[Hits, ...]: ...


Traced = TypeVar("Traced", bound=Images)
"""`Hits` of a tracer of one image, `Frames` of a tracer of several at once."""


class Tracer(Protocol[Traced]):
    """What every method of tracing offers.

    A tracer is made from mesh, camera and options. The first `trace` builds; `with` and `build` do so earlier. `look`
    changes the camera, `update` takes other vertices of the same faces. Several threads may call in any order
    (`atra.tracing.lifetime`).
    mesh, camera: those of the rays, of the first image where there are several. views: what each image shows, and its
    camera, in the order of `images` of what `trace` returns. packet_width: rays of a packet.
    plan_time_s, build_time_s: seconds each took. embree_bytes: what Embree holds by its own account, bytes.
    triangle_count: triangles in the Embree scene, copies included.

    counters: what the method counts, plain numbers by name, of what was planned and built and of the last frame.
    triangles_traced: `triangle_count`. embree_bytes: as above, only where it is known. Methods may tell more:
    triangles_left_out: over all images, traced pixel by pixel because float32 cannot show sheared copies of them
    exactly enough. packets_verified: that the second pass of the last frame had to trace. probe_time_s: seconds of
    plan_time_s that the probe took. scratch_bytes: memory that the frames of the rasteriser share.
    """

    mesh: Mesh
    camera: View
    packet_width: int
    threads: int
    plan_time_s: float
    build_time_s: float

    @property
    def views(self) -> tuple[tuple[Mesh, View], ...]: ...

    @property
    def triangle_count(self) -> int: ...

    @property
    def embree_bytes(self) -> int: ...

    @property
    def counters(self) -> Mapping[str, float]: ...

    def build(self) -> None: ...

    def look(self, camera: View) -> None: ...

    def update(self, mesh: Mesh) -> None: ...

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Traced | None = None) -> Traced: ...

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
