"""One ray per pixel: the paper's baseline with single rays, and the stronger one with packets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Reduction
from atra.all_hits.target_kernels import band_stride
from atra.choices import check_choice, check_flags
from atra.compiled.threads import WorkerPool
from atra.embree.filters_kernels import memory_monitor
from atra.embree.packets_kernels import PixelTiles, RayGrid, TracedImage
from atra.embree.scene import BUILD_QUALITIES, resolve_packet_width
from atra.embree.workspace import Workspace
from atra.errors import InputError
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, from_eye_space
from atra.geometry.view import View
from atra.packets.all_hits import EmbreeAllHits, RayBatch, check_gathering
from atra.packets.loop import Packets, trace_packets
from atra.packets.loop_kernels import NEAREST, NEAREST_OF_TABLE
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from atra.tracing.lens_rays import LensRays
from atra.tracing.method import Prepared
from atra.tracing.rays import SQUAREST_SHAPE, TILE_ORDERS, image_ray_grid, pixel_tiles
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number


@dataclass(frozen=True)
class Pixel:
    """One ray per pixel as a method. Fields: see `PixelTracer`."""

    packet_width: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    packet_rows: int | None = None
    coherent: bool = True
    compact: bool = False
    tile_order: str = "blocks"

    def __post_init__(self) -> None:
        width, rows = resolve_packet_width(self.packet_width), self.packet_rows
        check_choice("build_quality", self.build_quality, BUILD_QUALITIES)
        check_choice("tile_order", self.tile_order, TILE_ORDERS)
        check_flags(robust=self.robust, coherent=self.coherent, compact=self.compact)
        if rows is not None and not (is_whole_number(rows) and rows >= 1 and width % rows == 0):
            possible = ", ".join(str(1 << k) for k in range(width.bit_length()))
            raise InputError(f"packet_rows is {rows!r}, expected one of {possible} for packets of {width}, or None")

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return resolve_packet_width(self.packet_width)

    @property
    def packet_shape(self) -> tuple[int, int]:
        """Columns and rows of pixels in a packet."""
        width, rows = self.rays_per_packet, self.packet_rows
        return SQUAREST_SHAPE[width] if rows is None else (width // rows, rows)

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        check_range(mesh, camera, takes_lenses=True)

    def check_gathering(self, camera: View) -> None:
        """See `Method.check_gathering`."""
        check_gathering(camera, self.build_quality)

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedPixel:
        """Build a BVH of the mesh around the eye."""
        return PreparedPixel(self, mesh, camera, pool)


class PreparedPixel(Prepared):
    """A BVH of the mesh in the ray space of a camera, in which all rays start at the origin or are parallel.

    geometry: what Embree is given. scene: the BVH. tiles: the image's, in the order of tracing. workspaces: memory of
    each thread's packets.
    """

    def __init__(self, method: Pixel, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self.method, self._mesh, self.pool = method, mesh, pool
        self._lens_rays = LensRays()
        start = perf_counter()
        self.geometry = plan_plain_geometry(mesh, camera)
        self.plan_time_s = perf_counter() - start
        self._take_camera(camera)
        memory_monitor()  # compiled before the clock starts
        start = perf_counter()
        self.scene = self.geometry.build(pool.threads, **self._settings)
        self.build_time_s = perf_counter() - start

    def _take_camera(self, camera: View) -> None:
        """Make the rays those of a camera with the same ray space."""
        self.camera = camera
        self.tiles = pixel_tiles(camera.width, camera.height, self.method.tile_order)
        width, coherent = self.method.rays_per_packet, self.method.coherent
        self.workspaces = [Workspace(width, coherent=coherent) for _ in range(self.pool.threads)]
        batch = image_rays(self.geometry, camera, self.method.packet_shape, self.tiles)
        stride, settings = self.gathering_stride, self._settings
        self._all_hits = EmbreeAllHits(self._mesh, camera, lambda: [batch], stride, self.pool, settings)

    @property
    def _settings(self) -> dict[str, Any]:
        method = self.method
        return {"build_quality": method.build_quality, "robust": method.robust, "compact": method.compact}

    def still_serves(self, camera: View) -> bool:
        """While the eye stays in place, as ray space does: turning and zooming are free."""
        before = self.camera
        if camera.eye != before.eye or not np.array_equal(from_eye_space(camera), from_eye_space(before)):
            return False
        self._all_hits.close()  # their rays are those of the camera
        self._take_camera(camera)
        return True

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`."""
        camera, shape = self.camera, self.method.packet_shape
        rays: RayGrid | NDArray[np.float32]
        if isinstance(camera, LensView):
            rays, kind = self._lens_rays.table(camera, offset, self.pool), NEAREST_OF_TABLE
        else:
            rays, kind = image_ray_grid(camera, offset, shape), NEAREST
        size = camera.width, camera.height
        packets = Packets(self.scene.address, shape, camera, rays, self.tiles, size, kind)
        trace_packets(packets, self.workspaces, self.pool, TracedImage(depth, prim_id))

    @property
    def gathering_stride(self) -> int:
        """Pixels from one row of gathered images to the next."""
        return int(band_stride.py_func(self.camera.width))

    def gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        """See `Gathering.gather`. The first call builds a BVH with a filter."""
        self._all_hits.gather(what, offset, images, weights, self.workspaces)

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh."""
        return self.geometry.copy_count

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for all BVHs."""
        return self.scene.embree_bytes + self._all_hits.embree_bytes

    @property
    def counters(self) -> Mapping[str, float]:
        """Embree's memory."""
        return {"embree_bytes": self.embree_bytes}

    def close(self) -> None:
        """Release the BVHs."""
        self._all_hits.close()
        self.scene.close()


def image_rays(
    geometry: AlignedGeometry, camera: View, packet_shape: tuple[int, int], tiles: PixelTiles, is_alone: bool = False
) -> RayBatch:
    """One ray per pixel of an image, through the mesh in the camera's ray space."""

    def rays(offset: tuple[float, float]) -> RayGrid:
        return image_ray_grid(camera, offset, packet_shape)

    return RayBatch(geometry, "none", packet_shape, rays, tiles, (camera.width, camera.height), is_alone)


def PixelTracer(
    mesh: Mesh,
    camera: View,
    *,
    threads: int | None = None,
    ties: str = "lowest",
    packet_width: int | None = None,
    build_quality: str = "medium",
    robust: bool = True,
    packet_rows: int | None = None,
    coherent: bool = True,
    compact: bool = False,
    tile_order: str = "blocks",
) -> Tracer:
    """Trace one ray per pixel with Embree: `rtcIntersect1` (`packet_width=1`, the paper's baseline) or packets.

    `look` keeps the BVH while the eye stays in place: turning and zooming are free. Rays start at the origin of
    Embree's space, so another eye needs another BVH (docs/methods.md says why). Options other than `robust` and `ties`
    change times, not images.

    Parameters
    ----------
    mesh, camera :
        What is traced, and by which rays: pinhole, orthographic or with a lens.
    threads, ties :
        As for `Tracer`.
    packet_width : {1, 4, 8, 16}, optional
        Rays in a packet; 1 = single rays (default: the widest native packets).
    build_quality : {"low", "medium", "high"}
        Embree's, for its BVH.
    robust : bool
        No ray slips through between two triangles; False takes Embree's fast arithmetic, as in the paper.
    packet_rows : int, optional
        Rows of pixels in a packet (default: the squarest packet, and of two the wider).
    coherent : bool
        Embree takes the rays of a packet through its tree together.
    compact : bool
        A BVH that saves memory.
    tile_order : {"blocks", "rows", "morton"}
        Which pixels follow each other: blocks of 32 x 16 row by row, rows as wide as the image, or blocks of 16 x 16
        along a Morton curve.

    Returns
    -------
    Tracer

    Raises
    ------
    InputError
        For a mesh smaller than 1e-9 or farther than 1e11 from the eye, where float32 would lose triangles, and for an
        option's value.
    MemoryBudgetError
        While setting up, for more overlaps than can be kept.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> with atra.PixelTracer(mesh, camera, packet_width=1) as tracer:
    ...     hits = tracer.trace()
    >>> print(atra.compare(hits, atra.trace(mesh, camera)))
    3072 of 3072 pixels equal, 0 tied, 0 edge, 0 wrong
    """
    method = Pixel(packet_width, build_quality, robust, packet_rows, coherent, compact, tile_order)
    return Tracer(mesh, camera, method, threads=threads, ties=ties)
