"""Hits: the result of tracing an image. Frames: the result of tracing several images at once."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.exact.surface import place_hits, place_through_lens
from atra.exact.surface import read_only as read_only
from atra.exact.surface_kernels import NORMALS, POINTS, WEIGHTS
from atra.files.saving import SOURCES, save_layers, write_planes
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS

if TYPE_CHECKING:  # reading files, which images need only where their planes name parts of one
    from atra.files.meshes.loading import FaceSources


@dataclass(frozen=True, eq=False)
class VisibleTriangles:
    """The triangles that an image shows.

    Attributes
    ----------
    prim_id : (N,) uint32
        Ascending.
    pixels : (N,) int64
        Number of pixels that show each.
    """

    prim_id: NDArray[np.uint32]
    pixels: NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class Hits:
    """The nearest hit of every pixel; row 0 is the top of the image.

    Attributes
    ----------
    depth : (H, W) float32
        Distance along the view axis, scene units, inf = miss; along the ray for lenses that see sideways
        (`View.depth_is_along_ray`).
    prim_id : (H, W) uint32
        Row of `mesh.faces`; `MISS` (0xFFFFFFFF) = miss.
    offset : (float, float)
        The sub-pixel position of the rays.
    mesh : Mesh
        What was traced.
    camera : View
        Pinhole, orthographic or with a lens.
    threads : int, optional
        Threads that compute the properties; None takes every core.

    Notes
    -----
    The properties `u`, `v`, `points` and `normals` are computed in float64 at first use. They are NaN for a miss, and,
    except `normals`, for a ray that lies in its triangle's plane. They raise InputError for a bad offset and a
    `prim_id` that the mesh does not have.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> hits = atra.trace(mesh, camera)
    >>> hits.depth.dtype, hits.prim_id.shape
    (dtype('float32'), (48, 64))
    >>> hits.points[hits.hit].shape[1]
    3
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh
    camera: View
    threads: int | None = None

    @property
    def images(self) -> tuple[Hits]:
        """This image alone, as a tuple like `Frames.images`."""
        return (self,)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(H, W) bool, whether the ray hits anything."""
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
    def points(self) -> NDArray[np.floating]:
        """(H, W, 3) float32, positions of the hits, world space, scene units; float64 for a mesh with an origin."""
        if self.camera.lens is not None:
            local = self._through_lens[1]
        else:
            local = self._computed(POINTS, (*self.prim_id.shape, 3))
        return local + self.mesh.origin if self.mesh.has_origin else local

    @cached_property
    def normals(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, unit normals of the triangles a, b, c, world space, along (b - a) x (c - a): to the side
        from which the corners run anticlockwise."""
        return self._computed(NORMALS, (*self.prim_id.shape, 3))

    def visible_triangles(self) -> VisibleTriangles:
        """The triangles that are hit, and the number of pixels of each."""
        pixels = np.bincount(self.prim_id[self.hit])
        seen = np.flatnonzero(pixels)
        return VisibleTriangles(seen.astype(np.uint32), pixels[seen])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the image, whole or not at all, in the format that the suffix names.

        Parameters
        ----------
        path : path-like
            ".npz": depth, prim_id, u, v, points and normals, for `np.load`. ".exr": channels Z (depth), prim_id, N.X,
            N.Y, N.Z; needs the package OpenEXR. ".png": depth as grey from white (nearest hit) to dark grey, black =
            miss. ".ply": the hits as a point cloud with normals.

        Raises
        ------
        InputError
            For other suffixes, a missing package, and a point cloud without points.
        StorageError
            If the file cannot be written.
        """
        save_layers(path, partial(getattr, self))

    def save_planes(
        self,
        stem: str | os.PathLike[str],
        planes: Sequence[str],
        format: str = "npz",
        *,
        depth_along: str | None = None,
        depth_scale: float = 1000.0,
        saturate: bool = False,
        sources: FaceSources | None = None,
    ) -> list[Path]:
        """Write planes of the image, each file whole or not at all; only planes asked for are computed.

        Parameters
        ----------
        stem : path-like
            Path of the files without suffix.
        planes : sequence of str
            Of depth, prim_id, normals, points, u, v, mask (what is hit), instance and material (numbers of the file's
            nodes and materials + 1, 0 = none), preview (depth as grey values), preview_ids and preview_normals (as
            colours).
        format : {"npz", "exr", "npy", "png", "tiff"}
            npz and exr: one file of all planes; others: a file each. PNGs are of 16 bits, masks and previews of 8:
            depth times `depth_scale`, 0 = miss; prim_id + 1, 0 = miss; normals from -1 to 1 as 0 to 65,535.
        depth_along : {"axis", "ray"}, optional
            As for `depth_along`; None: what `depth` is.
        depth_scale : float
            Steps of a PNG per scene unit; 1000 makes millimetres of metres.
        saturate : bool
            Depths that do not fit become 0 or 65,535.
        sources : FaceSources, optional
            Of `load_face_sources` for the mesh, for instances and materials.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        InputError
            For unknown names, a missing package, instances or materials without sources of this mesh, and values that
            do not fit, which it counts.
        StorageError
            If a file cannot be written.
        """

        def plane(name: str) -> NDArray[Any]:
            if name == "depth" and depth_along is not None:
                return self.depth_along(depth_along)
            if name in SOURCES:
                return self._sourced(name, sources)
            return np.asarray(self.hit if name == "mask" else getattr(self, name))

        return write_planes(Path(stem), planes, format, plane, depth_scale, saturate)

    def _sourced(self, name: str, sources: FaceSources | None) -> NDArray[np.uint32]:
        """(H, W): numbers of instances or materials from 1, 0 = none."""
        numbers = None if sources is None else getattr(sources, SOURCES[name])
        if numbers is None or len(numbers) != self.mesh.triangle_count:
            count = "none" if numbers is None else f"those of {len(numbers):,}"
            raise InputError(
                f"the plane {name} needs face sources of the mesh's {self.mesh.triangle_count:,} triangles, {count} "
                "were given; atra.load_face_sources(path) reads them"
            )
        found = np.zeros(self.prim_id.shape, np.uint32)
        found[self.hit] = numbers[self.prim_id[self.hit]] + 1
        return found

    def __repr__(self) -> str:
        height, width = self.depth.shape
        hit = np.isfinite(self.depth)
        range_ = f", depth {self.depth[hit].min():.4g} to {self.depth[hit].max():.4g}" if hit.any() else ""
        share = f"{hit.mean():.1%} hit{range_}"
        return f"Hits({width} x {height} pixels of {self.mesh.name!r}, {share}, offset {self.offset})"

    @cached_property
    def _barycentric(self) -> NDArray[np.float32]:
        if self.camera.lens is not None:
            return self._through_lens[0]
        return self._computed(WEIGHTS, (2, *self.prim_id.shape))

    @property
    def _through_lens(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return place_through_lens(self.mesh, self.camera, self.prim_id, self.offset)

    def _computed(self, kind: int, shape: tuple[int, ...]) -> NDArray[np.float32]:
        return place_hits(kind, shape, self.mesh, self.camera, self.prim_id, self.offset, self.threads)

    def depth_along(self, way: str) -> NDArray[np.float32]:
        """Depths along the view axis or the rays; `depth` is one of them.

        Parameters
        ----------
        way : {"axis", "ray"}
            Along the view axis, negative behind the eye, or from where rays start.

        Returns
        -------
        (H, W) ndarray of float32
            Scene units, inf = miss.

        Raises
        ------
        InputError
            For another word.
        """
        if way not in ("axis", "ray"):
            raise InputError(f"depth is asked for along {way!r}, expected axis or ray")
        if self.camera.is_parallel or (way == "ray") == self.camera.depth_is_along_ray:
            return self.depth
        y, x = np.mgrid[0 : self.depth.shape[0], 0 : self.depth.shape[1]]
        directions = self.camera.rays(x, y, self.offset)[1]
        factor = directions[..., 2] if way == "axis" else np.linalg.norm(directions, axis=-1)
        return np.where(self.hit, self.depth * factor, np.inf).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Frames:
    """The nearest hits of K images of one size; `frames[k]` is frame k as `Hits`.

    Attributes
    ----------
    depth : (K, H, W) float32
        Along each frame's own view axis, scene units, inf = miss.
    prim_id : (K, H, W) uint32
        In the numbering of the frame's mesh, `MISS` = miss.
    offset : (float, float)
        The sub-pixel position of the rays.
    meshes, cameras : tuple
        The mesh and the camera of each frame.
    threads : int, optional
        As for `Hits`.
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
