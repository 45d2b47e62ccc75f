"""Several images from one set of rays: two eyes, or frames of a moving camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import final

from atra.alignment.aligned import prepare_aligned
from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions, check_aligned
from atra.alignment.prepared import PreparedCells
from atra.choices import check_choice
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.errors import InputError
from atra.exact.ties import TieTiles, coplanar_overlaps, tie_tiles
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.hits import Frames
from atra.tracing.budgets import check_image_memory
from atra.tracing.images import images_of, outputs
from atra.tracing.lifetime import Lifetime, synchronized
from atra.tracing.tracer import TIES, settle_ties


@final
class FramesTracer(Lifetime):
    """Several images from one set of rays: two eyes, or frames of a moving camera, each with its own cells.

    Parameters
    ----------
    meshes :
        One for all frames, or one per frame, so geometry may move; instances need one for all.
    alignment :
        `Alignment.of_eyes` or `Alignment.of_frames`.
    threads, ties, packet_width, packet_rows, build_quality, robust, memory_budget_bytes, geometry, culling :
        As for `AlignedTracer`.

    Raises
    ------
    InputError
        Unless there is one mesh or one per frame, and as `AlignedTracer` does.

    Notes
    -----
    Source: paper §6, Fig. 8.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> left, right = atra.orbit(mesh, views=2, width=64, height=48)
    >>> eyes = atra.Alignment.of_frames([left, right], atra.Split.of_image((4, 1), left))
    >>> with atra.FramesTracer(mesh, eyes) as tracer:
    ...     frames = tracer.trace()
    >>> frames.depth.shape
    (2, 48, 64)
    """

    def __init__(
        self,
        meshes: Mesh | Sequence[Mesh],
        alignment: Alignment,
        *,
        threads: int | None = None,
        ties: str = "lowest",
        packet_width: int | None = None,
        packet_rows: int | None = None,
        build_quality: str = "medium",
        robust: bool = True,
        memory_budget_bytes: int | None = None,
        geometry: str = "copied",
        culling: bool = True,
    ) -> None:
        super().__init__()
        check_choice("ties", ties, TIES)
        self.options = CellOptions(
            packet_width=packet_width, packet_rows=packet_rows, build_quality=build_quality, robust=robust,
            memory_budget_bytes=memory_budget_bytes, geometry=geometry, culling=culling,
        )  # fmt: skip
        self.threads, self.ties = resolve_threads(threads), ties
        self.packet_width = self.options.rays_per_packet
        self.prepared: PreparedCells | None = None
        self._tie_tiles: list[TieTiles] = []
        self.meshes = (meshes,) * len(alignment.cameras) if isinstance(meshes, Mesh) else tuple(meshes)
        if len(self.meshes) != len(alignment.cameras):
            raise InputError(
                f"{len(self.meshes)} meshes for {len(alignment.cameras)} frames; expected one for each, or one for all"
            )
        if self.options.is_instanced and any(mesh is not self.meshes[0] for mesh in self.meshes):
            raise InputError(
                "geometry is 'instanced' and the frames have meshes of their own, but instances show one mesh; "
                "use geometry='copied'"
            )
        check_image_memory(alignment.split.height * len(self.meshes), alignment.split.width)
        check_aligned(self.meshes, alignment, self.options)
        self.alignment, self.mesh, self.camera = alignment, self.meshes[0], alignment.camera
        self._pool = WorkerPool(self.threads)

    @property
    def views(self) -> tuple[tuple[Mesh, View], ...]:
        """What each image shows, and its camera."""
        return tuple(zip(self.meshes, self.alignment.cameras, strict=True))

    def _build(self) -> tuple[float, float]:
        self._forget()  # before anything is built: both together may not fit
        prepared = self.prepared = prepare_aligned(self.meshes, self.alignment, self.options, self._pool)
        if self.ties == "any":
            return prepared.plan_time_s, prepared.build_time_s
        for mesh in self.meshes:
            coplanar_overlaps(mesh)  # found once per mesh, like reading it, and so outside the clock
        start = perf_counter()
        self._tie_tiles = [tie_tiles(mesh, camera) for mesh, camera in self.views]
        return prepared.plan_time_s + perf_counter() - start, prepared.build_time_s

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Frames | None = None) -> Frames:
        """Trace all frames; arguments and errors as for `Tracer.trace`."""
        check_offset(offset)
        with self._in_use():
            prepared, cameras = self.prepared, self.alignment.cameras
            assert prepared is not None
            frames, height, width = len(cameras), self.camera.height, self.camera.width
            depth, prim_id = outputs((frames, height, width), prepared.row_stride, images_of(out))
            prepared.draw(offset, depth.reshape(frames * height, width), prim_id.reshape(frames * height, width))
            for image, tiles in enumerate(self._tie_tiles):
                settle_ties(*self.views[image], tiles, offset, prim_id[image], self._pool)
            return Frames(depth, prim_id, offset, self.meshes, cameras, self.threads)

    @property
    @synchronized
    def triangle_count(self) -> int:
        """Copies of all frames; 0 before `build`."""
        return 0 if self.prepared is None else self.prepared.triangle_count

    @property
    @synchronized
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for this tracer by its own account; 0 before `build`."""
        return 0 if self.prepared is None else self.prepared.embree_bytes

    @property
    @synchronized
    def counters(self) -> Mapping[str, float]:
        """As `Tracer.counters`."""
        own = {} if self.prepared is None else self.prepared.counters
        return {"triangles_traced": self.triangle_count, **own}

    def _forget(self) -> None:
        if self.prepared is not None:
            self.prepared.close()
            self.prepared = None

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        self._forget()
