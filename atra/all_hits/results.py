"""Results: what was gathered of all hits along the ray of every pixel.

Their arrays are read-only: a tracer that overwrites a result need not write again what is known to be there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View


@dataclass(frozen=True, eq=False)
class Counts:
    """How many triangles the ray of every pixel crosses; row 0 is the top of the image.

    count: (H, W) uint32. A ray that starts outside of a closed mesh crosses it an even number of times.
    offset: the sub-pixel position of the rays. mesh, camera: what was traced.
    """

    count: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)


@dataclass(frozen=True, eq=False)
class Thicknesses:
    """How long the way through the inside of closed meshes is.

    thickness: (H, W) float32, scene units along the view axis, as depth is: the sum of the depths at which the ray
    leaves less those at which it enters, from the eye on. Being a difference of depths, it is as exact as they are:
    to some 1e-6 of the farthest, not of itself. Where closed meshes overlap, each counts.
    offset, mesh, camera: as in `Counts`.
    """

    thickness: NDArray[np.float32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)

    @cached_property
    def ray_lengths(self) -> NDArray[np.float32]:
        """(H, W) float32, how long each ray is for a unit of depth: 1 where rays are parallel."""
        directions = self.camera.rays(
            np.arange(self.camera.width), np.arange(self.camera.height)[:, None], self.offset
        )[1]
        lengths = np.linalg.norm(directions, axis=-1).astype(np.float32)
        return np.broadcast_to(lengths, self.thickness.shape)

    @property
    def along_rays(self) -> NDArray[np.float32]:
        """(H, W) float32, scene units along the ray: `thickness` times `ray_lengths`."""
        return self.thickness * self.ray_lengths


@dataclass(frozen=True, eq=False)
class Transmittances:
    """What is left of light behind all triangles that a ray crosses.

    transmittance: (H, W) float32, the product of their factors; 1 where nothing is hit.
    offset, mesh, camera: as in `Counts`.
    """

    transmittance: NDArray[np.float32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)


@dataclass(frozen=True, eq=False)
class LayerHits:
    """The nearest k hits of every pixel, in the order of their depth.

    depth: (k, H, W) float32, along the view axis in scene units, inf = no such layer. prim_id: (k, H, W) uint32,
    `MISS` = none. Hits of equal depth are in the order of their prim_id.
    count: (H, W) uint32, all hits: where it is larger than k, those beyond are not in the layers.
    offset, mesh, camera: as in `Counts`.
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    count: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)
