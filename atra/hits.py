"""Hits: what a traced image holds; frames: what several of them hold that are traced at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.exact.surface_kernels import ROWS, PixelGrid, Triangles, orient_hits, place_hits, weigh_corners
from atra.files.saving import save_layers
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS


@dataclass(frozen=True, eq=False)
class VisibleTriangles:
    """The triangles that an image shows. prim_id: (N,) uint32, ascending. pixels: (N,) int64, how many show each."""

    prim_id: NDArray[np.uint32]
    pixels: NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class Hits:
    """The nearest hit of every pixel; row 0 is the top of the image.

    depth: (H, W) float32, distance along the view axis in scene units, inf = miss.
    prim_id: (H, W) uint32 in the mesh's own numbering, `MISS` (0xFFFFFFFF) = miss.
    offset: the sub-pixel position of the rays.
    mesh, camera: what was traced, by a camera of either kind; what the properties below say is computed from them, in
    float64, when first asked for. It is NaN for a miss, and apart from `normals` also where the ray lies in the plane
    of the triangle that it hits. Raises InputError, then, for a bad offset and a `prim_id` that the mesh does not have.
    threads: those of that computation; None = every core.
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh
    camera: View
    threads: int | None = None

    @property
    def images(self) -> tuple[Hits]:
        """The images, of which there is one: as `Frames.images`, so that callers need not tell one from several."""
        return (self,)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(H, W) bool, True where the ray hits."""
        return self.prim_id != MISS

    @property
    def u(self) -> NDArray[np.float32]:
        """(H, W) float32 barycentric weight of the triangle's second vertex."""
        return self._barycentric[0]

    @property
    def v(self) -> NDArray[np.float32]:
        """(H, W) float32 barycentric weight of the triangle's third vertex."""
        return self._barycentric[1]

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, where the rays meet the planes of their triangles, world space, scene units."""
        return self._computed(place_hits, (*self.prim_id.shape, 3))

    @cached_property
    def normals(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, unit normals of the triangles, world space. They point to the side from which the corners
        a, b, c run anticlockwise, along (b - a) x (c - a), wherever the camera is."""
        return self._computed(orient_hits, (*self.prim_id.shape, 3))

    def visible_triangles(self) -> VisibleTriangles:
        """The triangles that are hit, and by how many pixels."""
        pixels = np.bincount(self.prim_id[self.hit])
        seen = np.flatnonzero(pixels)
        return VisibleTriangles(seen.astype(np.uint32), pixels[seen])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the image, so that a reader sees all of it or none, in the format that the suffix names.

        ".npz": depth, prim_id, u, v, points and normals, as here, for `np.load`. ".exr": channels Z (depth), prim_id,
        N.X, N.Y and N.Z; needs the package OpenEXR. ".png": the depth as grey, for the eye alone: white is the nearest
        hit, dark grey the farthest, black a miss; needs Pillow. ".ply": a point cloud with normals, of the hits alone.
        Raises InputError for another suffix, a missing package and a point cloud without points, StorageError where the
        file cannot be written.
        """
        save_layers(path, partial(getattr, self))

    def __repr__(self) -> str:
        height, width = self.depth.shape
        hit = np.isfinite(self.depth)
        range_ = f", depth {self.depth[hit].min():.4g} to {self.depth[hit].max():.4g}" if hit.any() else ""
        return (
            f"Hits({width} x {height} pixels of {self.mesh.name!r}, {hit.mean():.1%} hit{range_}, offset {self.offset})"
        )

    @cached_property
    def _barycentric(self) -> NDArray[np.float32]:
        return self._computed(weigh_corners, (2, *self.prim_id.shape))

    def _computed(self, kernel: Callable[..., Any], shape: tuple[int, ...]) -> NDArray[np.float32]:
        prim_id, found = read_only(np.ascontiguousarray(self.prim_id, np.uint32)), np.empty(shape, np.float32)
        triangles, pixels = Triangles(self.mesh.vertices, self.mesh.faces), self._pixels
        absent = np.full(1, MISS, np.uint32)
        pool = WorkerPool(min(resolve_threads(self.threads), -(-len(prim_id) // ROWS)))
        try:
            pool.run(lambda _, counter: kernel(counter, triangles, pixels, prim_id, absent, found))
        finally:
            pool.close()
        if absent[0] != MISS:
            self.mesh.triangles(absent)  # raises, naming it
        return found

    @property
    def _pixels(self) -> PixelGrid:
        camera, (height, width) = self.camera, self.prim_id.shape
        on_plane = 0 if camera.is_parallel else 1  # origins lie on the image plane, or directions end there
        columns = camera.rays(np.arange(width), np.zeros(width, int), self.offset)[on_plane][:, 0]
        rows = camera.rays(np.zeros(height, int), np.arange(height), self.offset)[on_plane][:, 1]
        axes = tuple(tuple(axis) for axis in camera.axes.tolist())
        return PixelGrid(camera.eye, axes, read_only(columns.copy()), read_only(rows.copy()), camera.is_parallel)


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view that cannot be written to: Numba compiles anew for one that can."""
    view = array.view()
    view.setflags(write=False)
    return view


@dataclass(frozen=True, eq=False)
class Frames:
    """The nearest hits of K images of one size, in order; `frames[k]` is frame k as `Hits`.

    depth: (K, H, W) float32, along each frame's own view axis, inf = miss. prim_id: (K, H, W) uint32 in the numbering
    of the frame's mesh, `MISS` = miss. offset: the sub-pixel position of the rays. meshes, cameras: of each frame.
    threads: as of `Hits`.
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    offset: tuple[float, float]
    meshes: tuple[Mesh, ...] = field(repr=False)
    cameras: tuple[View, ...] = field(repr=False)
    threads: int | None = field(default=None, repr=False)

    @property
    def images(self) -> tuple[Hits, ...]:
        """All frames, in order."""
        return tuple(self)

    def __len__(self) -> int:
        return len(self.cameras)

    def __getitem__(self, frame: int) -> Hits:
        mesh, camera = self.meshes[frame], self.cameras[frame]
        return Hits(self.depth[frame], self.prim_id[frame], self.offset, mesh, camera, self.threads)

    def __iter__(self) -> Iterator[Hits]:
        return (self[frame] for frame in range(len(self)))
