"""How a batch of rays is traced: together or one by one, and in an order in which rays near by follow each other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.rays.order_kernels import (
    BUCKETS,
    CELLS,
    RECORD,
    SORTED_CHUNK,
    number_rays,
    order_rays,
    put_back,
)
from atra.rays.rays_kernels import batch_of, coherent_places

Numbers = tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]
"""The arrays of a batch of rays, of one type: origins, directions, tnear, tfar."""

ORDERED = 1 << 20
"""Rays that are put in an order at a time, which bounds the memory that takes; more gain nothing."""

_BOX_SAMPLES = 1024


def box_of(origins: NDArray[np.floating]) -> NDArray[np.floating]:
    """(2, 3): lowest and highest corner of the box in which rays are ordered. Some origins may lie outside, as only a
    sample is looked at."""
    some = origins[:: max(1, len(origins) // _BOX_SAMPLES)]
    return np.stack([some.min(axis=0), some.max(axis=0)])


class RayOrder:
    """Puts rays in an order in which those that start near each other and head the same way follow each other."""

    def __init__(self, pool: WorkerPool) -> None:
        self._pool = pool
        self._memory: tuple[NDArray[np.floating], NDArray[np.uint32]] | None = None

    def ordered(
        self,
        origins: NDArray[np.floating],
        directions: NDArray[np.floating],
        tnear: NDArray[np.floating],
        tfar: NDArray[np.floating],
    ) -> tuple[Numbers, NDArray[np.uint32], NDArray[np.uint32]]:
        """The same rays in an order in which those that start near each other and head the same way follow each other;
        the place of each in it; and room for two answers of each, (2, >= N). All of it until the next are ordered."""
        count = len(origins)
        low, high = box_of(origins)
        with np.errstate(divide="ignore", over="ignore"):
            inverse = np.where(high > low, CELLS / (high - low), 0.0).astype(origins.dtype)
        keys, counts = np.empty(count, np.uint16), np.zeros((-(-count // SORTED_CHUNK), BUCKETS), np.int32)
        self._pool.run(lambda _, counter: number_rays(counter, origins, directions, low, inverse, keys, counts))
        bounds = np.cumsum(counts.T).reshape(BUCKETS, -1).T  # bucket by bucket, in each chunk by chunk
        starts = np.ascontiguousarray(bounds - counts, np.int32)
        memory = self._memory  # kept: fresh pages cost more than to write to them
        if memory is None or len(memory[0]) < count or memory[0].dtype != origins.dtype:
            self._memory = memory = aligned_empty((count, RECORD), origins.dtype.type), np.empty((3, count), np.uint32)
        records, places, room = memory[0][:count], memory[1][0, :count], memory[1][1:]
        given = keys, starts, origins, directions, tnear, tfar
        self._pool.run(lambda _, counter: order_rays(counter, *given, records, places))
        return (records[:, :3], records[:, 4:7], records[:, 3], records[:, 7]), places, room

    def traced(self, rays: Numbers, in_order: bool, trace: Callable[..., None], *outputs: NDArray[Any]) -> None:
        """Call trace(batch, *outputs), which writes what the rays of a `RayBatch` hit.

        in_order: rays are put in an order before, and their answers back. outputs: (N,) each, or empty.
        """
        if not in_order:
            trace(batch_of(*rays), *outputs)
            return
        for start in range(0, len(rays[0]), ORDERED):
            some = slice(start, start + ORDERED)
            ordered, places, room = self.ordered(rays[0][some], rays[1][some], rays[2][some], rays[3][some])
            answers = [
                room[k].view(output.dtype)[: len(places)] if len(output) else output for k, output in enumerate(outputs)
            ]
            trace(batch_of(*ordered), *answers)
            for answer, output in zip(answers, outputs, strict=True):
                if len(output):
                    self._put_back(places, answer, output[some])

    def _put_back(self, places: NDArray[np.uint32], answers: NDArray[Any], output: NDArray[Any]) -> None:
        """output = answers[places], (N,) each."""
        bits = np.dtype(f"u{output.itemsize}")  # one kernel for all that have as many
        given = places, answers.view(bits), output.view(bits)
        self._pool.run(lambda _, counter: put_back(counter, *given))

    def forget(self) -> None:
        """Release the memory."""
        self._memory = None


FEWEST_RAYS = 1 << 16
"""Smallest batch whose rays are put in order; in smaller ones that costs more than it saves."""

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
