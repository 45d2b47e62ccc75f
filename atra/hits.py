"""Hits: what a traced image holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.geometry.intersection import intersect_pixels
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS


@dataclass(frozen=True, eq=False)
class Hits:
    """The nearest hit of every pixel; row 0 is the top of the image.

    depth: (H, W) float32, distance along the view axis in scene units, inf = miss.
    prim_id: (H, W) uint32 in the mesh's own numbering, `MISS` (0xFFFFFFFF) = miss.
    offset: the sub-pixel position of the rays.
    mesh, camera: what was traced, by a camera of either kind; `u` and `v` are computed from them when first asked for.
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)

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
        """(H, W) float32 barycentric weight of the triangle's second vertex, NaN = miss."""
        return self._barycentric[0]

    @property
    def v(self) -> NDArray[np.float32]:
        """(H, W) float32 barycentric weight of the triangle's third vertex, NaN = miss."""
        return self._barycentric[1]

    @cached_property
    def _barycentric(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        u = np.full(self.depth.shape, np.nan, np.float32)
        v = np.full(self.depth.shape, np.nan, np.float32)
        y, x = np.nonzero(self.hit)
        found = intersect_pixels(self.mesh, self.camera, x, y, self.prim_id[y, x], self.offset)
        u[y, x], v[y, x] = found.u, found.v
        return u, v
