"""All hits by Embree: a filter takes them, except undecided ones near edges, which are decided exactly beforehand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.layers_kernels import finish_image
from atra.all_hits.reductions import Reduction
from atra.all_hits.taking_kernels import LAYERS, THICKNESS
from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import PixelTiles, RayGrid
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import Workspace
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.packets.filters_kernels import hit_filter
from atra.packets.loop import Packets, trace_packets
from atra.packets.loop_kernels import FILTERED
from atra.tracing.gathering import check_rays_without_lens, target_of
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.rays import longest_ray

if TYPE_CHECKING:  # loaded by the first `gather`, which nearest hits do without
    from atra.raster.all_hits.undecided import UndecidedHits


class RayBatch(NamedTuple):
    """Rays to trace through a geometry for all of their hits.

    cells: as for `hit_filter`. rays: makes the rays of an offset. size: width and height of their grid, pixels.
    is_alone: packets overlap others' pixels, so one thread traces them all.
    """

    geometry: AlignedGeometry
    cells: str
    packet_shape: tuple[int, int]
    rays: Callable[[tuple[float, float]], RayGrid]
    tiles: PixelTiles
    size: tuple[int, int]
    is_alone: bool = False


def check_gathering(camera: View, build_quality: str) -> None:
    """Raise InputError for a camera with a lens, and for build quality "high", with which Embree finds some triangles
    twice."""
    check_rays_without_lens(camera)
    if build_quality == "high":
        raise InputError(
            "build_quality is 'high', which cuts triangles in two and would count them twice; gather with 'medium'"
        )


class EmbreeAllHits:
    """All hits of the rays of an image, from BVHs of their own, which the first call builds. The undecided hits are
    found once per offset, and those of the last offset are kept.

    batches: makes the rays and what they are traced through. row: pixels from one row of gathered images to the next.
    settings: of `AlignedGeometry.build`. shift: how far copies are shifted at most, per unit of depth; of parallel rays
    in all.
    """

    def __init__(
        self,
        mesh: Mesh,
        camera: View,
        batches: Callable[[], Iterable[RayBatch]],
        row: int,
        pool: WorkerPool,
        settings: Mapping[str, Any],
        shift: float = 0.0,
    ) -> None:
        self._mesh, self._camera, self._row, self._pool = mesh, camera, row, pool
        self._make_batches, self._settings, self._shift = batches, settings, shift
        self._undecided: tuple[tuple[float, float], UndecidedHits] | None = None
        self._batches: list[tuple[RayBatch, EmbreeScene]] = []

    def gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        workspaces: Sequence[Workspace],
    ) -> None:
        """See `Gathering.gather`."""
        from atra.raster.all_hits.undecided_kernels import settling_kernel

        if not self._batches:
            settings = {"threads": self._pool.threads, "filter_in_arguments": True, **self._settings}
            self._batches = [(batch, batch.geometry.build(**settings)) for batch in self._make_batches()]
        for name, plane in what.planes().items():
            if not plane.before:  # layers are filled at the end
                images[name].fill(plane.start)
        undecided, kind = self._find_undecided(offset), what.kind
        target = target_of(images, undecided.faces if kind == THICKNESS else weights, undecided.lists)
        block = target.block()
        settle, camera = settling_kernel(kind), self._camera
        settle(undecided.keys, undecided.facings, undecided.depths, camera.width, block.ctypes.data)
        for batch, scene in self._batches:
            self._shoot(batch, scene, kind, offset, block, workspaces)
        if kind == LAYERS:
            size, address = (camera.height, camera.width), block.ctypes.data
            self._pool.run(lambda _, counter: finish_image(counter, *size, address))

    def _find_undecided(self, offset: tuple[float, float]) -> UndecidedHits:
        if self._undecided is None or self._undecided[0] != offset:
            from atra.raster.all_hits.undecided import decide_hits
            from atra.raster.all_hits.undecided_kernels import Precision

            camera, (direction, origin) = self._camera, longest_ray(self._camera)
            moved = (1.0, origin + self._shift) if camera.is_parallel else (1.0 + self._shift, origin)
            precision = Precision(camera.pixel_pitch, direction, *moved, self._settings["robust"])
            self._undecided = offset, decide_hits(self._mesh, camera, offset, precision, self._row, self._pool)
        return self._undecided[1]

    def _shoot(
        self,
        batch: RayBatch,
        scene: EmbreeScene,
        kind: int,
        offset: tuple[float, float],
        block: NDArray,
        workspaces: Sequence[Workspace],
    ) -> None:
        packets = Packets(
            scene.address, batch.packet_shape, self._camera, batch.rays(offset), batch.tiles, batch.size,
            FILTERED, self._row, is_alone=batch.is_alone,
        )  # fmt: skip
        filter_address = hit_filter(kind, *batch.packet_shape, batch.cells)
        for workspace in workspaces:
            workspace.gather_with(filter_address, block.ctypes.data)
        try:
            trace_packets(packets, workspaces, self._pool)
        finally:
            for workspace in workspaces:
                workspace.gather_with(0, 0)

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for all BVHs."""
        return sum(scene.embree_bytes for _, scene in self._batches)

    def close(self) -> None:
        """Release the BVHs."""
        for _, scene in self._batches:
            scene.close()
        self._batches = []
