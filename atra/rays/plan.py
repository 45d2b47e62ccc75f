"""How a batch of rays is traced: together or one by one, and in which order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.geometry.mesh import Mesh
from atra.rays.order import Numbers
from atra.rays.rays_kernels import batch_of, coherent_places

FEWEST_RAYS = 1 << 14
"""Smallest batch whose rays are put in order; smaller ones fit the cache anyway."""

NEAR_BY = 1 / 64
"""Coherent rays start nearer to each other than this share of the mesh's size."""

_PLACES, _NEIGHBOURS = 64, 16
"""Places in a batch, and rays at each, that show whether neighbours are coherent."""


class Plan(NamedTuple):
    """How a batch is traced.

    is_coherent: whether most neighbours are coherent. near_by: how far apart rays start at most that are traced
    together, scene units; inf: all are, below 0: none. in_order: whether the rays are put in an order first.
    """

    is_coherent: bool
    near_by: float
    in_order: bool


def plan_of(rays: Numbers, mesh: Mesh, coherent: bool | None, fewest_triangles: int) -> Plan:
    """The plan for a batch: a sample of it tells, unless `coherent` does.

    fewest_triangles: of the smallest mesh whose rays are put in order.
    """
    if coherent is not None:
        return Plan(bool(coherent), np.inf if coherent else -1.0, False)
    count, near_by = len(rays[0]), NEAR_BY * float((mesh.bounds[1] - mesh.bounds[0]).max())
    neighbours = min(_NEIGHBOURS, count)
    if count == 0 or coherent_places(batch_of(*rays), count, _PLACES, neighbours, near_by) > _PLACES / 2:
        return Plan(True, near_by, False)
    return Plan(False, near_by, count >= FEWEST_RAYS and mesh.triangle_count >= fewest_triangles)
