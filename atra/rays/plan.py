"""How a batch of rays is traced: in packets or one by one, together or not, and in which order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.geometry.mesh import Mesh
from atra.rays.order import Numbers
from atra.rays.rays_kernels import ALWAYS, NEVER, WHERE_ALIKE, RaysInMemory, places_alike

FEWEST_RAYS, FEWEST_TRIANGLES = 1 << 14, 1 << 17
"""Smallest batch and smallest mesh whose rays are put in order; smaller ones fit the cache anyway."""

NEAR_BY = 1 / 64
"""Rays whose origins lie nearer than this share of the mesh's size may be traced together."""

_PLACES, _NEIGHBOURS = 64, 16
"""Places in a batch, and rays at each, that show whether neighbours are alike."""


class Plan(NamedTuple):
    """How a batch is traced.

    width: rays of a packet. together: `NEVER`, `ALWAYS` or `WHERE_ALIKE`. in_order: whether the rays are put in an
    order first. near_by: the distance up to which origins of rays are near each other, in scene units.
    """

    width: int
    together: int
    in_order: bool
    near_by: np.float32

    def placed(self, rays: Numbers) -> RaysInMemory:
        """The rays as kernels read them; they must stay alive meanwhile."""
        origins, directions, tnear, tfar = rays
        starts = origins.ctypes.data, directions.ctypes.data, origins.strides[0]
        return RaysInMemory(*starts, tnear.ctypes.data, tfar.ctypes.data, tnear.strides[0], self.together, self.near_by)


FEWEST_TRIANGLES_EXACT = 1 << 15
"""As `FEWEST_TRIANGLES`, for our own tree, whose nodes and triangles take more memory than Embree's."""


class ExactPlan(NamedTuple):
    """near_by: how far apart rays start at most that are traced together, below 0: none are. in_order: as in `Plan`."""

    near_by: float
    in_order: bool


def exact_plan_of(rays: Numbers, mesh: Mesh, coherent: bool | None) -> ExactPlan:
    """As `plan_of`, for our own tree."""
    if coherent is not None:
        return ExactPlan(np.inf if coherent else -1.0, False)
    count, near_by = len(rays[0]), NEAR_BY * float((mesh.bounds[1] - mesh.bounds[0]).max())
    if count > _NEIGHBOURS:
        starts = (count - _NEIGHBOURS) * np.arange(_PLACES) // (_PLACES - 1)
        numbers = (starts[:, None] + np.arange(_NEIGHBOURS)).reshape(-1)
        sample = tuple(array[numbers].astype(np.float32) for array in rays)
        plan = Plan(1, WHERE_ALIKE, False, np.float32(near_by))
        if places_alike(plan.placed(sample), len(numbers), _PLACES, _NEIGHBOURS) <= _PLACES / 2:
            return ExactPlan(-1.0, count >= FEWEST_RAYS and mesh.triangle_count >= FEWEST_TRIANGLES_EXACT)
    return ExactPlan(near_by, False)


def plan_of(rays: Numbers, mesh: Mesh, coherent: bool | None, width: int, width_unlike: int) -> Plan:
    """The plan for a batch. width: of packets of rays that are alike; width_unlike: of others.

    A sample of the batch tells which it is, unless `coherent` does, or the answer would change nothing.
    """
    near_by = np.float32(NEAR_BY * float((mesh.bounds[1] - mesh.bounds[0]).max()))
    if coherent is not None:
        return Plan(width, ALWAYS, False, near_by) if coherent else Plan(width_unlike, NEVER, False, near_by)
    plan = Plan(width, WHERE_ALIKE, False, near_by)
    count = len(rays[0])
    is_large = count >= FEWEST_RAYS and mesh.triangle_count >= FEWEST_TRIANGLES
    if count == 0 or (width == width_unlike and not is_large):
        return plan
    if places_alike(plan.placed(rays), count, _PLACES, min(_NEIGHBOURS, count)) > _PLACES / 2:
        return plan
    return plan._replace(width=width_unlike, in_order=is_large)
