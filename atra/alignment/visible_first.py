"""Visible-first tracing: align what is probably visible, then check what was left out, only where it could matter."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.options import ReferenceRayKeywords, ReferenceRayOptions
from atra.alignment.reference_rays import ReferenceRayTracer
from atra.alignment.second_pass import SecondPass
from atra.alignment.visibility import PROBE_STEP, plan_visible_geometry, probed_depth, tiles_of
from atra.embree.callbacks_kernels import memory_monitor, nearest_hit_filter
from atra.embree.packets_kernels import Image, RayGrid
from atra.embree.scene import EmbreeScene
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.hits import Hits
from atra.packets.pixel_kernels import pixel_kernel
from atra.tracing.base import ImageTracer
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from atra.tracing.images import new_images
from atra.tracing.lifetime import in_turn
from atra.tracing.options import lists_options
from atra.tracing.rays import SQUAREST_SHAPE, check_pinhole, pixel_tiles, ray_grid

WHOLE_BUILD_QUALITY = "low"
"""Build quality of the whole mesh's BVH, which is also compact. Only the probe and a few packets use it, so build time
and size matter more than tracing speed."""


class VisibleFirstTracer(ReferenceRayTracer[Hits], ImageTracer):
    """Alignment without overdraw: copies that a probe takes for hidden are left out, and checked per pixel.

    Pass 1 traces aligned copies of the triangles that the probe deems visible and float32 shows as precisely as a ray
    of the mesh itself (`atra.alignment.rounding`). Pass 2 goes over the image in packets of pixels. It skips a packet
    whose hits are nearer than anything left out in its tile can be; other packets are traced through the whole mesh, up
    to the depth found. The image is exact for any probe; a bad one costs time. This lifts the limit of paper §5.

    split: (nx, ny) cells; nx must divide the width, ny the height. probe: None traces a few rays when planning; `Hits`
    of an image of the same size, such as an earlier frame or a nearby camera; or an integer array of prim_ids for pass
    1, which may be empty. options: see `atra.ReferenceRayOptions`; the build quality is that of pass 1. plan_time_s
    includes the probe (`counters["probe_time_s"]`), build_time_s both BVHs. Raises InputError for a split that does not
    divide the image, a probe of another size, and an unknown prim_id.
    """

    @lists_options(ReferenceRayOptions)
    def __init__(
        self,
        mesh: Mesh,
        camera: View,
        split: tuple[int, int],
        probe: Hits | ArrayLike | None = None,
        **options: Unpack[ReferenceRayKeywords],
    ) -> None:
        check_pinhole(camera, "VisibleFirstTracer")
        self.probe = probe if probe is None or isinstance(probe, Hits) else _checked_prim_ids(mesh, probe)
        self.split = Split.of_image(split, camera)
        super().__init__(options)
        self._show(mesh, camera)
        self._probe_time_s = 0.0
        self._whole_build_time_s = 0.0
        self._whole: EmbreeScene | None = None
        self._second_pass: SecondPass | None = None

    def _show(self, mesh: Mesh, camera: View) -> None:
        check_pinhole(camera, "VisibleFirstTracer")
        if isinstance(self.probe, Hits) and self.probe.depth.shape != (camera.height, camera.width):
            raise InputError(
                f"the probe is an image of {self.probe.depth.shape}, "
                f"expected {(camera.height, camera.width)} (height, width)"
            )
        self._align((mesh,), Alignment.of_cells(camera, self.split.of(camera)))
        self.tiles = tiles_of(self.split)

    def _plan(self) -> float:
        return super()._plan() - self._whole_build_time_s

    def _build_whole(self) -> None:
        plain = plan_plain_geometry(self.mesh, self.camera)
        memory_monitor()  # compiled before the clock starts
        build_start = perf_counter()
        whole = self._scene_of(plain, WHOLE_BUILD_QUALITY, compact=True)
        self._whole_build_time_s = perf_counter() - build_start
        if self._whole is not None:
            self._whole.close()
        self._whole = whole

    def _plan_geometry(self) -> AlignedGeometry:
        self._build_whole()
        start = perf_counter()
        seen = np.zeros(self.mesh.triangle_count, np.uint8)
        if self.probe is None:
            seen_depth = self._probe_depth()
        elif isinstance(self.probe, Hits):
            seen_depth = self._farthest_in_tiles(self.probe.depth)
        else:
            seen[self.probe] = 1
            seen_depth = np.zeros(self.tiles.shape)
        self._probe_time_s = perf_counter() - start
        plan = plan_visible_geometry(
            self.mesh,
            self.alignment,
            self.tiles,
            (seen, seen_depth),
            self.options,
            row_stride=self._row_stride,
            pool=self._pool,
        )
        assert self._whole is not None
        self._second_pass = SecondPass(self._whole, self.camera, self.tiles, plan.nearest_hidden)
        return plan.geometry

    def _probe_depth(self) -> NDArray[np.float64]:
        """Trace the default probe: the visible depth of each tile, from rays on its border.

        Neighbouring tiles share rays, and an outline that crosses a tile probably separates two of its corners.
        """
        camera = self.camera
        assert self._whole is not None
        scene = self._whole.address
        shape = SQUAREST_SHAPE[self.packet_width]
        tile_rows, tile_columns = self.tiles.shape
        width = tile_columns * (self.tiles.tile_width // PROBE_STEP) + 1
        height = tile_rows * (self.tiles.tile_height // PROBE_STEP) + 1

        def positions(count: int, packet: int, pixels: int) -> NDArray[np.integer]:
            return np.minimum(np.arange(count + -count % packet) * PROBE_STEP, pixels)

        columns = camera.plane.columns(positions(width, shape[0], camera.width))
        rows = camera.plane.rows(positions(height, shape[1], camera.height))
        rays, image = RayGrid(*ray_grid(camera, columns, rows)), Image(*new_images(height, width, width))
        kernel, tiles = pixel_kernel(*shape), pixel_tiles(width, height)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, self._workspaces[worker].packet, rays, tiles, image)

        self._pool.run(work)
        return probed_depth(image.depth, self.tiles)

    def _farthest_in_tiles(self, depth: NDArray[np.float32]) -> NDArray[np.float64]:
        """The farthest depth in each tile of an image."""
        rows, columns = self.tiles.shape
        farthest = np.maximum.reduceat(depth, np.arange(rows) * self.tiles.tile_height, axis=0)
        farthest = np.maximum.reduceat(farthest, np.arange(columns) * self.tiles.tile_width, axis=1)
        return farthest.astype(np.float64)

    def _build(self) -> float:
        return super()._build() + self._whole_build_time_s

    def _filter_address(self) -> int:
        return nearest_hit_filter(*self.packet_shape)

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        self._trace_reference_rays(offset, depth, prim_id)
        assert self._second_pass is not None
        self._second_pass.trace(self._pool, self._workspaces, self.packet_width, offset, depth, prim_id)

    @property
    @in_turn
    def counters(self) -> Mapping[str, float]:
        """As `atra.Tracer` says; packets_verified and probe_time_s are known as well."""
        verified = 0 if self._second_pass is None else self._second_pass.packets_traced
        return {**super().counters, "packets_verified": verified, "probe_time_s": self._probe_time_s}

    @property
    @in_turn
    def triangle_count(self) -> int:
        """Triangles in both Embree scenes, copies included; 0 before `build`."""
        return 0 if self.geometry is None else self.geometry.copy_count + self.mesh.triangle_count

    @property
    @in_turn
    def embree_bytes(self) -> int:
        """Bytes that Embree reports for both scenes; 0 before `build`."""
        return super().embree_bytes + (0 if self._whole is None else self._whole.embree_bytes)

    def _forget(self) -> None:
        super()._forget()
        if self._whole is not None:
            self._whole.close()
        self._second_pass = None


def _checked_prim_ids(mesh: Mesh, probe: Any) -> NDArray[np.int64]:
    """The triangles a probe names, as int64 without misses (`MISS`)."""
    prim_ids = np.asarray(probe)
    if prim_ids.size and prim_ids.dtype.kind not in "iu":
        raise InputError(f"the probe has dtype {prim_ids.dtype}, expected whole numbers: prim_ids of triangles seen")
    prim_ids = prim_ids[prim_ids != 0xFFFFFFFF].astype(np.int64)
    absent = prim_ids[(prim_ids < 0) | (prim_ids >= mesh.triangle_count)]
    if len(absent):
        raise InputError(
            f"the probe names prim_id {absent.min()}, but {mesh.name!r} has {mesh.triangle_count} triangles"
        )
    is_seen = np.zeros(mesh.triangle_count, np.bool_)  # much faster than `np.unique`
    is_seen[prim_ids] = True
    return np.flatnonzero(is_seen)
