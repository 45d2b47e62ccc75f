"""Results of gathering all hits of every pixel's ray.

Their arrays are read-only, so a tracer that overwrites an earlier result knows what is there and can skip it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View


@dataclass(frozen=True, eq=False)
class CountResult:
    """The number of triangles the ray of every pixel crosses; row 0 is the top of the image.

    Attributes
    ----------
    count : (H, W) uint32
        Even for a closed mesh seen from outside.
    offset : (float, float)
        The sub-pixel position of the rays.
    mesh, camera :
        What was traced, and by which rays.
    """

    count: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)


@dataclass(frozen=True, eq=False)
class ThicknessResult:
    """The length of every ray inside closed meshes; overlapping meshes count separately.

    Attributes
    ----------
    thickness : (H, W) float32
        Scene units along the view axis, like depth: the depths at which the ray leaves minus those at which it enters.
        As a difference it is as precise as depths are, about 1e-6 of the farthest.
    offset, mesh, camera :
        As in `CountResult`.
    """

    thickness: NDArray[np.float32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)

    @cached_property
    def ray_lengths(self) -> NDArray[np.float32]:
        """(H, W) float32, length of each ray per unit of depth; 1 for parallel rays."""
        directions = self.camera.rays(
            np.arange(self.camera.width), np.arange(self.camera.height)[:, None], self.offset
        )[1]
        lengths = np.linalg.norm(directions, axis=-1).astype(np.float32)
        return np.broadcast_to(lengths, self.thickness.shape)

    @property
    def along_rays(self) -> NDArray[np.float32]:
        """(H, W) float32, thickness along the ray: `thickness` times `ray_lengths`."""
        return self.thickness * self.ray_lengths


@dataclass(frozen=True, eq=False)
class TransmittanceResult:
    """The light that passes all triangles a ray crosses.

    Attributes
    ----------
    transmittance : (H, W) float32
        The product of their factors; 1 where nothing is hit.
    offset, mesh, camera :
        As in `CountResult`.
    """

    transmittance: NDArray[np.float32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)


@dataclass(frozen=True, eq=False)
class LayersResult:
    """The nearest k hits of every pixel, sorted by depth and then prim_id.

    Attributes
    ----------
    depth : (k, H, W) float32
        Along the view axis, scene units; inf = no such layer.
    prim_id : (k, H, W) uint32
        `MISS` = none.
    count : (H, W) uint32
        All hits, which may be more than k.
    offset, mesh, camera :
        As in `CountResult`.
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    count: NDArray[np.uint32]
    offset: tuple[float, float]
    mesh: Mesh = field(repr=False)
    camera: View = field(repr=False)
