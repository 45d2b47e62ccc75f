"""The geometry that Embree is given: triangles, a record for each, and what is left out of an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree.filters_kernels import memory_monitor
from atra.embree.scene import EmbreeScene
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space, padded_vertices, to_ray_space, unseen_from
from atra.geometry.view import View

LEFT_OUT_BY_EMBREE = np.float32(3e38)
"""A coordinate with which a triangle does not get into the BVH; Embree's limit is 1.8e18."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Triangles of one image that are left out of its copies.

    prim_ids: (N,) int64, ascending. depth_error: (N,) float64, how far off a ray of the mesh itself may be, relative.
    points_pixels: (V, 3) float64, the mesh in the homogeneous pixels of the image.
    """

    prim_ids: NDArray[np.int64]
    depth_error: NDArray[np.float64]
    points_pixels: NDArray[np.float64]

    @classmethod
    def of(
        cls, is_left_out: NDArray[np.bool_], depth_error: NDArray[np.float64], points_pixels: NDArray[np.float64]
    ) -> LeftOut | None:
        """Those where `is_left_out`, (F,) bool, or None if there are none. depth_error: (F,), of every triangle."""
        prim_ids = np.flatnonzero(is_left_out)
        return cls(prim_ids, depth_error[prim_ids], points_pixels) if len(prim_ids) else None


@dataclass(frozen=True, eq=False)
class AlignedGeometry:
    """Sheared copies of a mesh's triangles, or the mesh and a shear per cell, ready for Embree.

    vertices: (3 N, 3) float32, three of its own per copy. faces: (N, 3) uint32.
    records: (N,) int64, what the filter needs of a copy: its prim_id in the mesh (low 32 bits) and the distance in
    pixels from the reference cell's pixel to its cell's (high 32 bits, rows `row_stride` pixels apart, image below
    image); empty where no filter reads them.
    transforms: (I, 3, 4) float32, a row-major shear per instance, or None. With them the triangles are the mesh's own
    (`vertices` (V, 3), `faces` (F, 3)), and `records` is (I,); only its high halves are read.
    left_out: of each image what no copy may show (`atra.alignment.rounding`), to be traced pixel by pixel; None where
    nothing is.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    records: NDArray[np.int64]
    transforms: NDArray[np.float32] | None = None
    left_out: tuple[LeftOut | None, ...] = ()

    @property
    def copy_count(self) -> int:
        """Triangles that Embree is given."""
        return len(self.faces)

    def build(self, threads: int, *, build_quality: str, robust: bool, **settings: Any) -> EmbreeScene:
        """Build the BVH. settings: of `EmbreeScene`. Raises EmbreeError."""
        return EmbreeScene(
            self.vertices,
            self.faces,
            build_quality=build_quality,
            threads=threads,
            robust=robust,
            user_data=self.records,
            monitor_address=memory_monitor(),
            transforms=self.transforms,
            **settings,
        )


def plan_plain_geometry(mesh: Mesh, camera: View, is_left_out: NDArray[np.bool_] | None = None) -> AlignedGeometry:
    """The mesh itself in ray space, `prim_id` for `prim_id`, without records; is_left_out: (F,) bool, without those.

    Triangles that no ray hits (`unseen_from`) get corners so far away that Embree leaves them out: its triangle test,
    fused multiplications in float32, may show them beside where they are.
    """
    mesh, camera = own_space(mesh, camera)
    vertices = padded_vertices(len(mesh.vertices) + 1)
    vertices[:-1] = to_ray_space(camera, mesh.vertices)
    vertices[-1] = LEFT_OUT_BY_EMBREE
    faces = mesh.traced_faces
    unseen = unseen_from(camera, mesh)
    if len(unseen) or is_left_out is not None:
        faces = faces.copy()
        faces[unseen] = len(mesh.vertices)
        faces[is_left_out if is_left_out is not None else slice(0)] = len(mesh.vertices)
    return AlignedGeometry(vertices, faces, np.empty(0, np.int64))
