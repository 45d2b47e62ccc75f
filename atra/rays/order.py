"""Whether a batch of rays is worth putting in order, and what counts as near."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.rays.rays import Rays
from atra.rays.rays_kernels import (
    ALIKE_DIRECTIONS,
    BUCKETS,
    CELLS,
    RECORD,
    SORTED_CHUNK,
    number_rays,
    order_rays,
    put_back,
)

Numbers = tuple[NDArray[np.float32], ...]
"""The arrays of a batch of rays: origins, directions, tnear, tfar."""

FEWEST_RAYS, FEWEST_TRIANGLES = 1 << 14, 1 << 17
"""Smallest batch and smallest mesh whose rays are put in order; smaller ones fit the cache anyway."""

NEAR_BY = 1 / 64
"""Rays whose origins lie nearer than this share of the mesh's size may be traced together."""

_SAMPLES, _NEIGHBOURS = 64, 16
"""Places in a batch, and rays at each, that show whether neighbours are alike."""

_BOX_SAMPLES = 1024


def near_by_of(mesh: Mesh) -> np.float32:
    """The distance up to which origins of rays are near each other, in scene units."""
    return np.float32(NEAR_BY * float((mesh.bounds[1] - mesh.bounds[0]).max()))


def is_large(rays: Rays, mesh: Mesh) -> bool:
    """Whether putting the rays in order can pay."""
    return len(rays) >= FEWEST_RAYS and mesh.triangle_count >= FEWEST_TRIANGLES


def are_alike(rays: Rays, near_by: np.float32) -> bool:
    """Whether neighbours start and head alike at most places of a batch; an empty one counts as alike."""
    if len(rays) == 0:
        return True
    neighbours = min(_NEIGHBOURS, len(rays))
    places = np.linspace(0, len(rays) - neighbours, _SAMPLES).astype(int)[:, None] + np.arange(neighbours)
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


class RayOrder:
    """Puts rays in an order in which those that start near each other and head the same way follow each other."""

    def __init__(self, pool: WorkerPool) -> None:
        self._pool = pool
        self._memory: tuple[NDArray[np.float32], NDArray[np.uint32]] | None = None

    def ordered(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], *ends: NDArray[np.float32]
    ) -> tuple[Numbers, NDArray[np.uint32], NDArray[np.uint32]]:
        """The same rays in an order in which those that start near each other and head the same way follow each other;
        the place of each in it; and room for two answers of each, (2, >= N). All of it until the next are ordered."""
        count = len(origins)
        low, high = box_of(origins)
        with np.errstate(divide="ignore", over="ignore"):
            inverse = np.where(high > low, CELLS / (high - low), 0.0).astype(np.float32)
        keys, counts = np.empty(count, np.uint16), np.zeros((-(-count // SORTED_CHUNK), BUCKETS), np.int32)
        self._pool.run(lambda _, counter: number_rays(counter, origins, directions, low, inverse, keys, counts))
        bounds = np.cumsum(counts.T).reshape(BUCKETS, -1).T  # bucket by bucket, in each chunk by chunk
        starts = np.ascontiguousarray(bounds - counts, np.int32)
        if self._memory is None or len(self._memory[0]) < count:  # kept: fresh pages cost more than to write to them
            self._memory = aligned_empty((count, RECORD), np.float32), np.empty((3, count), np.uint32)
        records, places, room = self._memory[0][:count], self._memory[1][0, :count], self._memory[1][1:]
        given = keys, starts, origins, directions, *ends
        self._pool.run(lambda _, counter: order_rays(counter, *given, records, places))
        return (records[:, :3], records[:, 4:7], records[:, 3], records[:, 7]), places, room

    def put_back(self, places: NDArray[np.uint32], answers: NDArray[Any], output: NDArray[Any]) -> None:
        """output = answers[places], (N,) each."""
        bits = np.dtype(f"u{output.itemsize}")  # one kernel for all that have as many
        given = places, answers.view(bits), output.view(bits)
        self._pool.run(lambda _, counter: put_back(counter, *given))

    def forget(self) -> None:
        """Release the memory."""
        self._memory = None
