"""The protocol of a method: a value that prepares a mesh for a camera, and then draws images.

Adding a method means writing a class with these functions and handing it to `atra.Tracer`, which owns everything else:
the lock, building on first use, closing, memory of images, ties and results.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Reduction
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View


class Prepared(Protocol):
    """A mesh prepared for one camera, such as a BVH and the rays.

    plan_time_s, build_time_s: seconds of planning (culling, shearing) and of building.
    row_stride: pixels from one row of an image to the next in memory, at least the camera's width.
    triangle_count: triangles that are traced or drawn, copies included. embree_bytes: bytes that Embree holds by its
    own account, 0 where there is no Embree.
    counters: what the method counts, plain numbers by name, of what was prepared and of the last frame.
    """

    plan_time_s: float
    build_time_s: float

    @property
    def row_stride(self) -> int: ...

    @property
    def triangle_count(self) -> int: ...

    @property
    def embree_bytes(self) -> int: ...

    @property
    def counters(self) -> Mapping[str, float]: ...

    def still_serves(self, camera: View) -> bool:
        """Take another camera, if nothing has to be built for it; returns whether it was taken."""

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """Write the nearest hit of every pixel, (H, W) each, rows `row_stride` pixels apart; inf and MISS for none.

        offset: the sub-pixel position of the rays. Which of several tied triangles is stored does not matter.
        """

    def close(self) -> None:
        """Release everything; called once, when no frame is in progress."""


@runtime_checkable
class Gathering(Prepared, Protocol):
    """A prepared mesh that finds all hits, too."""

    @property
    def gathering_stride(self) -> int:
        """Pixels from one row of gathered images to the next."""

    def gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        """Reduce all hits along every ray. images: of `atra.tracing.gathering.target_images`, with anything in them,
        or, if `is_known`, an earlier result of the same reduction. weights: of `what`."""


class Method(Protocol):
    """A way to find what the rays of a camera hit: its options, as a value.

    rays_per_packet: rays that are traced together, 1 for single rays and where there are no packets, 0 = unknown.
    """

    @property
    def rays_per_packet(self) -> int: ...

    def check(self, mesh: Mesh, camera: View) -> None:
        """Raise InputError or MemoryBudgetError for a mesh or camera that the method cannot take, before any work."""

    def check_gathering(self, camera: View) -> None:
        """Raise InputError where all hits cannot be gathered, with a way out."""

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> Prepared:
        """Plan and build for a mesh and a camera that `check` accepted."""
