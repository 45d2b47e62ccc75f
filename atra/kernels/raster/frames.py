"""A frame: vertices projected, triangles listed, bands drawn; and the memory that frames share."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.view import View
from atra.kernels.raster.drawing import drawing_kernel
from atra.kernels.raster.exact import SUMMANDS
from atra.kernels.raster.image import Image, ViewOfMesh, Workspace, band_stride
from atra.kernels.raster.listing import CHUNK, fill_bands, list_triangles, place_bands, project
from atra.kernels.raster.spans import ROWS
from atra.parallel import WorkerPool

_BAND_PIXELS, _BAND_ROWS = 1 << 16, (16, 64)
"""Pixels of a band, half a megabyte of image; and its least and most rows."""

_CACHE_LINE = 8
"""Float64 numbers in one."""

_LEAST_DEPTH = 1e-25
"""Depth that a corner has at least, of the mesh's distance from the eye: its inverse has to be a float32."""


@dataclass(frozen=True, eq=False)
class Scratch:
    """Memory of the frames of one mesh. points: (V, 4) float64. listed: (F,) uint32, bands: (F, 2) int32."""

    points: NDArray[np.float64]
    listed: NDArray[np.uint32]
    bands: NDArray[np.int32]
    entries: list[NDArray[np.uint32]] = field(default_factory=list)
    workspaces: list[NDArray[np.float64]] = field(default_factory=list)

    @classmethod
    def of(cls, mesh: Mesh) -> Scratch:
        triangles = mesh.triangle_count
        return cls(
            np.empty((len(mesh.vertices), 4)), np.empty(triangles, np.uint32), np.empty((triangles, 2), np.int32)
        )

    def room_for(self, count: int) -> NDArray[np.uint32]:
        """At least `count` entries of bands."""
        if not self.entries or len(self.entries[0]) < count:
            self.entries[:] = [np.empty(count + count // 4, np.uint32)]
        return self.entries[0]

    def workspaces_for(self, threads: int, width: int, band_rows: int) -> list[Workspace]:
        """One for each thread."""
        parts = band_rows * band_stride(width), SUMMANDS, band_rows + ROWS, band_rows + ROWS
        wanted = sum(parts) + _CACHE_LINE
        if len(self.workspaces) != threads or len(self.workspaces[0]) != wanted:
            self.workspaces[:] = [np.empty(wanted) for _ in range(threads)]
        starts = 8 * np.cumsum([0, *parts[:-1]])
        return [
            Workspace(*(starts + memory.ctypes.data + -memory.ctypes.data % (8 * _CACHE_LINE)).tolist())
            for memory in self.workspaces
        ]


def draw_frame(
    mesh: Mesh,
    camera: View,
    offset: tuple[float, float],
    lanes: int,
    scratch: Scratch,
    pool: WorkerPool,
    out: tuple[NDArray[np.float32], NDArray[np.uint32]],
) -> None:
    """Write depth and prim_id of all pixels to `out`, two arrays (H, W)."""
    depth, prim_id = out
    width, height, parallel = camera.width, camera.height, camera.is_parallel
    to_pixels = camera.to_pixels.copy()
    to_pixels[:2] -= np.outer(offset, to_pixels[2])
    eye = np.array(camera.eye)
    least_depth = 0.0 if parallel else _LEAST_DEPTH * float(np.abs(mesh.bounds - eye).max())
    points, faces = scratch.points, mesh.faces
    least_rows, most_rows = _BAND_ROWS
    band_rows = min(max(1 << (_BAND_PIXELS // width).bit_length() >> 1, least_rows), most_rows)  # a power of two
    counts = np.empty((-(-len(faces) // CHUNK), -(-height // band_rows) + 1), np.int64)
    starts = np.empty(counts.shape[1], np.int64)
    view = ViewOfMesh(mesh.vertices, eye, to_pixels)
    image = Image(depth.ctypes.data, prim_id.ctypes.data, width, height)
    draw_bands: Any = drawing_kernel(lanes, parallel)

    pool.run(lambda _, counter: project(counter, mesh.vertices, eye, to_pixels, camera.axes[2], least_depth, points))
    pool.run(
        lambda _, counter: list_triangles(
            counter, points, faces, parallel, width, height, band_rows, scratch.listed, scratch.bands, counts
        )
    )
    place_bands(counts, starts)
    entries = scratch.room_for(int(starts[-1]))
    pool.run(lambda _, counter: fill_bands(counter, scratch.listed, scratch.bands, counts, entries))
    workspaces = scratch.workspaces_for(pool.threads, width, band_rows)

    def draw(worker: int, counter: int) -> None:
        draw_bands(counter, view, points, faces, starts, entries, band_rows, image, workspaces[worker])

    pool.run(draw)


@cache
def compile_kernels(lanes: int, parallel: bool) -> None:
    """Have everything that `draw_frame` calls compiled: draw one triangle."""
    mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32))
    kind = OrthographicCamera if parallel else Camera
    camera = kind((0, 0, 1), (0, 0, 0), width=1, height=1)
    out = np.empty((1, 1), np.float32), np.empty((1, 1), np.uint32)
    pool = WorkerPool(1)
    draw_frame(mesh, camera, (0.5, 0.5), lanes, Scratch.of(mesh), pool, out)
    pool.close()
