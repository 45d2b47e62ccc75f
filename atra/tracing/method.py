"""The protocol of a method: a value that prepares a mesh for a camera, and then draws images.

    @dataclass(frozen=True)
    class Mine(atra.Method):
        rows: int = 64  # an option

        def prepare(self, mesh, camera, pool):
            return PreparedMine(mesh, camera, self.rows)

    class PreparedMine(atra.Prepared):
        def draw(self, offset, depth, prim_id):
            ...  # the nearest hit of every pixel

    hits = atra.Tracer(mesh, camera, Mine()).trace()

`Tracer` owns everything else: the lock, building on first use, closing, memory of images, ties and results. `Method`
and `Prepared` hold what a method can do without; a class that has the same functions serves as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Reduction
from atra.compiled.threads import WorkerPool
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View


class Prepared(Protocol):
    """A mesh prepared for one camera, such as a BVH and the rays. Only `draw` must be written.

    Attributes
    ----------
    plan_time_s, build_time_s : float
        Seconds of planning (culling, shearing) and of building; 0 where nobody measures them.
    """

    plan_time_s: float = 0.0
    build_time_s: float = 0.0

    @property
    def row_stride(self) -> int:
        """Pixels from one row of an image to the next in memory, at least the camera's width; 0 = the width."""
        return 0

    @property
    def triangle_count(self) -> int:
        """Triangles that are traced or drawn, copies included; 0 = unknown."""
        return 0

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds by its own account; 0 where there is no Embree, or it is unknown."""
        return 0

    @property
    def counters(self) -> Mapping[str, float]:
        """What the method counts, plain numbers by name, of what was prepared and of the last frame."""
        return {}

    def still_serves(self, camera: View) -> bool:
        """Take another camera, if nothing has to be built for it.

        Returns
        -------
        bool
            Whether it was taken; otherwise `prepare` is called again.
        """
        return False

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """Write the nearest hit of every pixel.

        Parameters
        ----------
        offset : (float, float)
            The sub-pixel position of the rays.
        depth : (H, W) float32
            Distances along the view axis, scene units; inf where nothing is hit. Rows are `row_stride` pixels apart.
        prim_id : (H, W) uint32
            Rows of `mesh.faces`; `atra.MISS` where nothing is hit. Of several tied triangles any will do.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Release everything; called once, when no frame is in progress."""
        return


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
        """Reduce all hits along every ray.

        Parameters
        ----------
        images :
            Arrays of `atra.tracing.gathering.target_images`, with anything in them, or, if `is_known`, an earlier
            result of the same reduction.
        weights : (F,) float32, optional
            Of `what`.
        """


class Method(Protocol):
    """A way to find what the rays of a camera hit: its options, as a value. Only `prepare` must be written."""

    @property
    def rays_per_packet(self) -> int:
        """Rays that are traced together; 1 for single rays and where there are no packets, 0 = unknown."""
        return 0

    def check(self, mesh: Mesh, camera: View) -> None:
        """Raise InputError or MemoryBudgetError for a mesh or camera that the method cannot take, before any work."""
        return

    def check_gathering(self, camera: View) -> None:
        """Raise InputError where all hits cannot be gathered, with a way out."""
        raise InputError(
            f"{type(self).__name__} cannot gather all hits; use RasterTracer, PixelTracer or AlignedTracer"
        )

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> Prepared:
        """Plan and build for a mesh and a camera that `check` accepted.

        Parameters
        ----------
        mesh : Mesh
            Its `vertices`, (V, 3) float32, and `faces`, (F, 3) uint32, are read-only.
        camera : View
            Its `rays_world(offset)` are the rays of all pixels, `project(points)` pixels of points.
        pool : WorkerPool
            The threads of the tracer: `pool.threads` may run at once, and `pool.run` runs a kernel in all of them.
        """
        raise NotImplementedError
