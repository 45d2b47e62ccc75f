"""Whether a batch of rays is worth putting in order, and what counts as near."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.rays.rays import Rays
from atra.rays.rays_kernels import ALIKE_DIRECTIONS

FEWEST_RAYS, FEWEST_TRIANGLES = 1 << 14, 1 << 17
"""Smallest batch and smallest mesh whose rays are put in order; smaller ones fit the cache anyway."""

NEAR_BY = 1 / 64
"""Rays whose origins lie nearer than this share of the mesh's size may be traced together."""

_SAMPLES, _NEIGHBOURS = 64, 16
"""Places in a batch, and rays at each, that show whether it has an order already."""

_BOX_SAMPLES = 1024


def near_by_of(mesh: Mesh) -> np.float32:
    """The distance up to which origins of rays are near each other, in scene units."""
    return np.float32(NEAR_BY * float((mesh.bounds[1] - mesh.bounds[0]).max()))


def is_large(rays: Rays, mesh: Mesh) -> bool:
    """Whether putting the rays in order can pay."""
    return len(rays) >= FEWEST_RAYS and mesh.triangle_count >= FEWEST_TRIANGLES


def has_order_already(rays: Rays, near_by: np.float32) -> bool:
    """Whether neighbours start and head alike at most places of a batch."""
    places = np.linspace(0, len(rays) - _NEIGHBOURS, _SAMPLES).astype(int)[:, None] + np.arange(_NEIGHBOURS)
    starts, ways = rays.origins[places], rays.directions[places]
    sizes = np.abs(ways[:, :1]).max(axis=2, keepdims=True)
    moved, turned = np.abs(starts - starts[:, :1]), np.abs(ways - ways[:, :1])
    alike = (moved <= near_by) & (turned <= ALIKE_DIRECTIONS * sizes)
    return bool(alike.all(axis=(1, 2)).mean() > 0.5)


def box_of(origins: NDArray[np.float32]) -> NDArray[np.float32]:
    """(2, 3): lowest and highest corner of the box in which rays are ordered. Some origins may lie outside, as only a
    sample is looked at."""
    some = origins[:: max(1, len(origins) // _BOX_SAMPLES)]
    return np.stack([some.min(axis=0), some.max(axis=0)])
