"""Gathering all hits by Embree: a filter takes them, except those in doubt, which are decided exactly beforehand."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.layers_kernels import finish_image
from atra.all_hits.reductions import Reduction
from atra.all_hits.taking_kernels import LAYERS, THICKNESS
from atra.embree.packets_kernels import PixelTiles, RayGrid
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import check_widths
from atra.errors import InputError
from atra.hits import Hits
from atra.packets.filters_kernels import gathering_filter
from atra.packets.shooting_kernels import shooting_kernel
from atra.tracing.all_hits import Gathering, target_of
from atra.tracing.base import EmbreeTracer, Views
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.lifetime import in_turn

if TYPE_CHECKING:  # loaded by the first `gather`, which nearest hits do without
    from atra.raster.all_hits.doubts import Doubts
    from atra.raster.all_hits.doubts_kernels import Precision


class Shots(NamedTuple):
    """Rays to trace through a geometry for all of their hits.

    cells: as for `gathering_filter`. rays: makes the rays of an offset. size: width and height of their grid, pixels.
    is_alone: packets overlap others' pixels, so one thread traces them all.
    """

    geometry: AlignedGeometry
    cells: str
    packet_shape: tuple[int, int]
    rays: Callable[[tuple[float, float]], RayGrid]
    tiles: PixelTiles
    size: tuple[int, int]
    is_alone: bool = False


class EmbreeGathering(Gathering, EmbreeTracer[Hits]):
    """A tracer of one image that gathers all hits with Embree.

    The first `gather` builds a BVH of its own. The samples in doubt are found once per offset, and the last offset's
    are kept.
    """

    _shots: tuple[tuple[Shots, EmbreeScene], ...] = ()
    _doubts: tuple[tuple[float, float], Doubts] | None = None

    @abstractmethod
    def _planned_shots(self) -> list[Shots]: ...

    @abstractmethod
    def _precision(self) -> Precision: ...

    def _check_gathering(self) -> None:
        if self.options.build_quality == "high":
            raise InputError(
                "build_quality is 'high', which cuts triangles in two and would count them twice; gather with 'medium'"
            )

    def _gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        from atra.raster.all_hits.doubts_kernels import settling_kernel

        for name, plane in what.planes().items():
            if not plane.before:  # layers are filled at the end
                images[name].fill(plane.start)
        doubts, kind = self._found_doubts(offset), what.kind
        if not self._shots:
            self._build_shots()
        own_weights = doubts.faces if kind == THICKNESS else weights
        target = target_of(images, own_weights, doubts.lists)
        block = target.block()
        settle = settling_kernel(kind)
        settle(doubts.keys, doubts.facings, doubts.depths, self.camera.width, block.ctypes.data)
        for shots, scene in self._shots:
            self._shoot(shots, scene, kind, offset, block, target.row)
        if kind == LAYERS:
            size, address = (self.camera.height, self.camera.width), block.ctypes.data
            self._pool.run(lambda _, counter: finish_image(counter, *size, address))

    def _found_doubts(self, offset: tuple[float, float]) -> Doubts:
        if self._doubts is None or self._doubts[0] != offset:
            from atra.raster.all_hits.doubts import find_doubts

            row = self._gathering_row
            self._doubts = offset, find_doubts(self.mesh, self.camera, offset, self._precision(), row, self._pool)
        return self._doubts[1]

    def _shoot(
        self, shots: Shots, scene: EmbreeScene, kind: int, offset: tuple[float, float], block: NDArray, row: int
    ) -> None:
        rays, tiles, address = shots.rays(offset), shots.tiles, scene.address
        kernel = shooting_kernel(*shots.packet_shape, self.camera.is_parallel)
        filter_address = gathering_filter(kind, *shots.packet_shape, shots.cells)
        for workspace in self._workspaces:
            workspace.gather_with(filter_address, block.ctypes.data)

        def work(worker: int, counter: int) -> None:
            if worker == 0 or not shots.is_alone:
                kernel(counter, address, self._workspaces[worker].packet, rays, tiles, *shots.size, row)

        try:
            self._pool.run(work)
        finally:
            for workspace in self._workspaces:
                workspace.gather_with(0, 0)
        check_widths(self._workspaces)

    def _build_shots(self) -> None:
        self._shots = tuple((shots, self._gathering_scene(shots.geometry)) for shots in self._planned_shots())

    def _gathering_scene(self, geometry: AlignedGeometry) -> EmbreeScene:
        return self._scene_of(geometry, self.options.build_quality, filter_in_arguments=True)

    def _forget_shots(self) -> None:
        for _, scene in self._shots:
            scene.close()
        self._shots = ()
        self._doubts = None

    def _build(self) -> float:
        self._forget_shots()
        return super()._build()

    def _show_views(self, views: Views) -> None:
        super()._show_views(views)
        self._forget_shots()  # their rays are those of the camera

    def _forget(self) -> None:
        super()._forget()
        self._forget_shots()

    @property
    @in_turn
    def embree_bytes(self) -> int:
        """Bytes that Embree reports for this tracer; 0 before `build`."""
        return super().embree_bytes + sum(scene.embree_bytes for _, scene in self._shots)
