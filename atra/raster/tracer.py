"""Rasterisation: what the rays through the pixels see, found without shooting any; no BVH, and no Embree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Reduction
from atra.all_hits.target_kernels import band_stride
from atra.choices import check_choice
from atra.compiled.instruction_sets import LANE_COUNTS, native_lanes
from atra.compiled.threads import WorkerPool
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range
from atra.geometry.view import View
from atra.raster.all_hits.frames import gather_frame
from atra.raster.frames import FrameMemory, draw_frame
from atra.raster.lenses.frames import LensDrawing
from atra.tracing.gathering import check_rays_without_lens, target_of
from atra.tracing.method import Prepared
from atra.tracing.tracer import Tracer


@dataclass(frozen=True)
class Raster:
    """The rasteriser as a method. lanes: see `RasterTracer`."""

    lanes: int | None = None

    rays_per_packet: ClassVar[int] = 1

    def __post_init__(self) -> None:
        check_choice("lanes", self.lanes, LANE_COUNTS, or_none=True)

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        check_range(mesh, camera, takes_lenses=True)

    def check_gathering(self, camera: View) -> None:
        """Raise InputError for a lens."""
        check_rays_without_lens(camera)

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedRaster:
        """Make clusters of the mesh."""
        return PreparedRaster(mesh, camera, self.lanes or native_lanes(), pool)


class PreparedRaster(Prepared):
    """A mesh in clusters, which serve every camera, and memory that frames share: `memory`."""

    def __init__(self, mesh: Mesh, camera: View, lanes: int, pool: WorkerPool) -> None:
        self._mesh, self._camera, self._lanes, self._pool = mesh, camera, lanes, pool
        start = perf_counter()
        self.memory = FrameMemory.of(mesh, pool)
        self.build_time_s = perf_counter() - start
        self.lens_drawing = LensDrawing()

    def still_serves(self, camera: View) -> bool:
        """Always: clusters depend on the mesh alone."""
        self._camera = camera
        return True

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`."""
        camera, rest = self._camera, (offset, self._lanes, self.memory, self._pool, (depth, prim_id))
        if isinstance(camera, LensView):
            self.lens_drawing.draw(self._mesh, camera, *rest)
        else:
            draw_frame(self._mesh, camera, *rest)

    @property
    def gathering_stride(self) -> int:
        """Pixels from one row of gathered images to the next."""
        return int(band_stride.py_func(self._camera.width))

    def gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        """See `Gathering.gather`."""
        target = target_of(images, weights, None, is_known)
        gather_frame(self._mesh, self._camera, offset, self._lanes, self.memory, self._pool, what.kind, target)

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh, hidden ones included."""
        return self._mesh.triangle_count

    @property
    def counters(self) -> Mapping[str, float]:
        """scratch_bytes: memory that frames share."""
        return {"scratch_bytes": self.memory.bytes + self.lens_drawing.bytes}


def RasterTracer(
    mesh: Mesh, camera: View, *, threads: int | None = None, ties: str = "lowest", lanes: int | None = None
) -> Tracer:
    """Draw every triangle onto the image, exactly where the rays of its pixels meet it, nearest in front.

    Clusters of triangles, all that is built, depend on the mesh alone, so `look` is free.

    Parameters
    ----------
    mesh, camera :
        What is drawn, and by which rays: pinhole, orthographic or with a lens.
    threads : int, optional
        Threads of a frame; None takes every core that the process may use.
    ties : {"lowest", "any"}
        As for `Tracer`.
    lanes : {4, 8, 16}, optional
        SIMD width in pixels (default: the machine's widest). Does not change the image.

    Returns
    -------
    Tracer

    Raises
    ------
    InputError
        For a mesh smaller than 1e-9 or farther than 1e11 from the eye, and for an option's value.
    MemoryBudgetError
        For an image that the free memory cannot hold.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> with atra.RasterTracer(mesh, camera, threads=1) as tracer:
    ...     first = tracer.trace()
    ...     second = tracer.trace((0.25, 0.75))  # other places in the pixels
    >>> first.hit.shape
    (48, 64)
    """
    return Tracer(mesh, camera, Raster(lanes), threads=threads, ties=ties)
