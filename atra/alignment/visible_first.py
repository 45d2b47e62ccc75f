"""Visible-first tracing: align what is probably visible, then check what was left out, only where it could matter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions, ReferencePass, check_aligned
from atra.alignment.second_pass import SecondPass
from atra.alignment.visibility import PROBE_STEP, plan_visible_geometry, probed_depth, tiles_of
from atra.compiled.threads import WorkerPool
from atra.embree.callbacks_kernels import memory_monitor, nearest_hit_filter
from atra.embree.packets_kernels import Image, RayGrid
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.hits import Hits
from atra.packets.pixel_kernels import pixel_kernel
from atra.prim_ids import MISS
from atra.tracing.embree import build_scene
from atra.tracing.geometry import plan_plain_geometry
from atra.tracing.images import new_images
from atra.tracing.rays import SQUAREST_SHAPE, check_pinhole, pixel_tiles, ray_grid
from atra.tracing.tracer import Tracer

WHOLE_BUILD_QUALITY = "low"
"""Build quality of the whole mesh's BVH, which is also compact. Only the probe and a few packets use it, so build time
and size matter more than tracing speed."""


@dataclass(frozen=True, eq=False)
class VisibleFirst:
    """Visible-first tracing as a method. split, probe: see `VisibleFirstTracer`; options: its others."""

    split: tuple[int, int]
    probe: Hits | NDArray[np.int64] | None = None
    options: CellOptions = field(default_factory=CellOptions)

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return self.options.rays_per_packet

    def alignment(self, camera: View) -> Alignment:
        """The cells of a camera's image. Raises InputError for a split that does not divide it."""
        return Alignment.of_cells(camera, Split.of_image(self.split, camera))

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        check_pinhole(camera, "VisibleFirstTracer")
        check_aligned((mesh,), self.alignment(camera), self.options)
        if isinstance(self.probe, Hits) and self.probe.depth.shape != (camera.height, camera.width):
            raise InputError(
                f"the probe is an image of {self.probe.depth.shape}, "
                f"expected {(camera.height, camera.width)} (height, width)"
            )

    def check_gathering(self, camera: View) -> None:
        """Raise InputError: hidden triangles are left out."""
        raise InputError(
            "VisibleFirstTracer leaves out what is hidden, so it cannot gather all hits; use RasterTracer, PixelTracer "
            "or AlignedTracer"
        )

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedVisibleFirst:
        """Probe, cull, shear and build."""
        return PreparedVisibleFirst(self, mesh, camera, pool)


class PreparedVisibleFirst:
    """A BVH of sheared copies of what is probably visible, and a second pass through the whole mesh."""

    def __init__(self, method: VisibleFirst, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self._mesh, self._camera, self._pool, self._options = mesh, camera, pool, method.options
        alignment = method.alignment(camera)
        self._pass = ReferencePass(alignment, method.options, pool)
        self.packet_shape, self.row_stride = self._pass.packet_shape, self._pass.row_stride
        self._tiles = tiles_of(alignment.split)
        filter_address = nearest_hit_filter(*self.packet_shape)
        memory_monitor()  # compiled, like the filter, before the clock starts
        start = perf_counter()
        plain = plan_plain_geometry(mesh, camera)
        self.plan_time_s = perf_counter() - start

        start = perf_counter()
        robust = method.options.robust
        self.whole = build_scene(plain, pool.threads, build_quality=WHOLE_BUILD_QUALITY, robust=robust, compact=True)
        self.build_time_s = perf_counter() - start

        start = perf_counter()
        probed = self._probe(method.probe)
        self._probe_time_s = perf_counter() - start
        plan = plan_visible_geometry(
            mesh, alignment, self._tiles, probed, method.options, row_stride=self.row_stride, pool=pool
        )
        self.second_pass = SecondPass(
            self.whole, camera, self._tiles, plan.nearest_hidden, method.rays_per_packet, pool
        )
        self.plan_time_s += perf_counter() - start

        start = perf_counter()
        quality = method.options.build_quality
        self._scene = build_scene(
            plan.geometry, pool.threads, build_quality=quality, robust=robust, filter_address=filter_address
        )
        self.build_time_s += perf_counter() - start
        self.geometry = plan.geometry

    def _probe(self, probe: Hits | NDArray[np.int64] | None) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        """Triangles to copy in any case, and the visible depth of each tile, as `plan_visible_geometry` takes them."""
        seen = np.zeros(self._mesh.triangle_count, np.uint8)
        if probe is None:
            return seen, self._trace_probe()
        if isinstance(probe, Hits):
            return seen, self._farthest_in_tiles(probe.depth)
        seen[probe] = 1
        return seen, np.zeros(self._tiles.shape)

    def _trace_probe(self) -> NDArray[np.float64]:
        """Trace the default probe: the visible depth of each tile, from rays on its border.

        Neighbouring tiles share rays, and an outline that crosses a tile probably separates two of its corners.
        """
        camera, scene, workspaces = self._camera, self.whole.address, self._pass.workspaces
        shape = SQUAREST_SHAPE[self._options.rays_per_packet]
        tile_rows, tile_columns = self._tiles.shape
        width = tile_columns * (self._tiles.tile_width // PROBE_STEP) + 1
        height = tile_rows * (self._tiles.tile_height // PROBE_STEP) + 1

        def positions(count: int, packet: int, pixels: int) -> NDArray[np.integer]:
            return np.minimum(np.arange(count + -count % packet) * PROBE_STEP, pixels)

        columns = camera.plane.columns(positions(width, shape[0], camera.width))
        rows = camera.plane.rows(positions(height, shape[1], camera.height))
        rays, image = RayGrid(*ray_grid(camera, columns, rows)), Image(*new_images(height, width, width))
        kernel, tiles = pixel_kernel(*shape), pixel_tiles(width, height)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, workspaces[worker].packet, rays, tiles, image)

        self._pool.run(work)
        return probed_depth(image.depth, self._tiles)

    def _farthest_in_tiles(self, depth: NDArray[np.float32]) -> NDArray[np.float64]:
        """The farthest depth in each tile of an image."""
        rows, columns = self._tiles.shape
        farthest = np.maximum.reduceat(depth, np.arange(rows) * self._tiles.tile_height, axis=0)
        farthest = np.maximum.reduceat(farthest, np.arange(columns) * self._tiles.tile_width, axis=1)
        return farthest.astype(np.float64)

    def still_serves(self, camera: View) -> bool:
        """Never: copies hang on the camera."""
        return False

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`."""
        self._pass.trace(self._scene, offset, depth, prim_id)
        self.second_pass.trace(self._pass.workspaces, offset, depth, prim_id)

    @property
    def triangle_count(self) -> int:
        """Triangles in both Embree scenes, copies included."""
        return self.geometry.copy_count + self._mesh.triangle_count

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for both scenes."""
        return self._scene.embree_bytes + self.whole.embree_bytes

    @property
    def counters(self) -> Mapping[str, float]:
        """Embree's memory, packets_verified and probe_time_s: see `Tracer.counters`."""
        return {
            "embree_bytes": self.embree_bytes,
            "packets_verified": self.second_pass.packets_traced,
            "probe_time_s": self._probe_time_s,
        }

    def close(self) -> None:
        """Release the BVHs."""
        self._scene.close()
        self.whole.close()


def VisibleFirstTracer(
    mesh: Mesh,
    camera: View,
    split: tuple[int, int],
    probe: Hits | ArrayLike | None = None,
    *,
    threads: int | None = None,
    ties: str = "lowest",
    packet_width: int | None = None,
    packet_rows: int | None = None,
    build_quality: str = "medium",
    robust: bool = True,
    memory_budget_bytes: int | None = None,
) -> Tracer:
    """Align what a probe takes for visible, and check the rest per pixel: alignment without overdraw.

    Pass 1 traces aligned copies of the triangles that the probe deems visible and float32 shows as precisely as a ray
    of the mesh itself (`atra.alignment.rounding`). Pass 2 goes over the image in packets of pixels. It skips a packet
    whose hits are nearer than anything left out in its tile can be; other packets are traced through the whole mesh, up
    to the depth found. The image is exact for any probe; a bad one costs time. This lifts the limit of paper §5.

    Parameters
    ----------
    mesh, camera :
        What is traced, and by which rays: pinhole.
    split : (int, int)
        Columns and rows of cells; they must divide the image's width and height.
    probe : optional
        None traces a few rays when planning; `Hits` of an image of the same size, such as an earlier frame or a nearby
        camera; or an integer array of prim_ids for pass 1, which may be empty.
    threads, ties, packet_width, packet_rows, build_quality, robust, memory_budget_bytes :
        As for `AlignedTracer`; the build quality is that of pass 1.

    Returns
    -------
    Tracer
        Its plan_time_s includes the probe (`counters["probe_time_s"]`), its build_time_s both BVHs.

    Raises
    ------
    InputError
        For a split that does not divide the image, a probe of another size, an unknown prim_id, and parallel rays.
    """
    check_pinhole(camera, "VisibleFirstTracer")
    checked = probe if probe is None or isinstance(probe, Hits) else _checked_prim_ids(mesh, probe)
    options = CellOptions(
        packet_width=packet_width, packet_rows=packet_rows, build_quality=build_quality, robust=robust,
        memory_budget_bytes=memory_budget_bytes,
    )  # fmt: skip
    return Tracer(mesh, camera, VisibleFirst(split, checked, options), threads=threads, ties=ties)


def _checked_prim_ids(mesh: Mesh, probe: Any) -> NDArray[np.int64]:
    """The triangles a probe names, as int64 without misses."""
    prim_ids = np.asarray(probe)
    if prim_ids.size and prim_ids.dtype.kind not in "iu":
        raise InputError(f"the probe has dtype {prim_ids.dtype}, expected whole numbers: prim_ids of triangles seen")
    prim_ids = prim_ids[prim_ids != MISS].astype(np.int64)
    absent = prim_ids[(prim_ids < 0) | (prim_ids >= mesh.triangle_count)]
    if len(absent):
        raise InputError(
            f"the probe names prim_id {absent.min()}, but {mesh.name!r} has {mesh.triangle_count} triangles"
        )
    is_seen = np.zeros(mesh.triangle_count, np.bool_)  # much faster than `np.unique`
    is_seen[prim_ids] = True
    return np.flatnonzero(is_seen)
