"""The loops that put a batch of rays in an order, and its answers back."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel

SORTED_CHUNK = 1 << 16
"""Rays a thread orders at a time."""

CELLS = 5
"""Along each axis, of the box that rays are ordered in: as many as leave a cache line for every bucket in the first two
caches. Finer ones gain nothing while rays are traced."""

BUCKETS = 8 * CELLS**3
"""A bucket for every cell that a ray may start in, and every octant that it may head for."""

RECORD = 8
"""Numbers of a ray that is put in an order: origin and tnear, direction and tfar."""


@kernel
def number_rays(counter_address, origins, directions, low, inverse, keys, counts):  # type: ignore[no-untyped-def]
    """The bucket of every ray, and how many rays of each chunk have it.

    origins, directions: (N, 3) float32. low, inverse: (3,) float32, cells of the box per unit of length.
    keys: (N,) uint16. counts: (chunks, BUCKETS) int32, zeroed.
    """
    while True:
        chunk = fetch_add(counter_address, 1)
        if chunk >= len(counts):
            return
        for ray in range(chunk * SORTED_CHUNK, min((chunk + 1) * SORTED_CHUNK, len(keys))):
            key = 0
            for axis in range(3):
                cell = (origins[ray, axis] - low[axis]) * inverse[axis]
                key = key * CELLS + int(min(max(cell, np.float32(0.0)), np.float32(CELLS - 1)))
            for axis in range(3):
                key = 2 * key + (1 if directions[ray, axis] < 0 else 0)
            keys[ray] = key
            counts[chunk, key] += 1


@kernel
def order_rays(counter_address, keys, starts, origins, directions, tnear, tfar, records, places):  # type: ignore[no-untyped-def]
    """Copy rays bucket by bucket, and within each as they came; starts: (chunks, BUCKETS) int32, which is used up.

    records: (N, RECORD) float32. places: (N,) uint32, which of them each ray is. Buckets are written side by side and
    read one after the other, both of which the cache likes better than rays from all over the batch.
    """
    while True:
        chunk = fetch_add(counter_address, 1)
        if chunk >= len(starts):
            return
        for ray in range(chunk * SORTED_CHUNK, min((chunk + 1) * SORTED_CHUNK, len(keys))):
            key = keys[ray]
            place = starts[chunk, key]
            starts[chunk, key] = place + 1
            for axis in range(3):
                records[place, axis] = origins[ray, axis]
                records[place, 4 + axis] = directions[ray, axis]
            records[place, 3], records[place, 7] = tnear[ray], tfar[ray]
            places[ray] = place


@kernel
def put_back(counter_address, places, answers, output):  # type: ignore[no-untyped-def]
    """output[ray] = answers[places[ray]], (N,) each: answers of rays that were put in an order."""
    while True:
        start = fetch_add(counter_address, 1) * SORTED_CHUNK
        if start >= len(places):
            return
        for ray in range(start, min(start + SORTED_CHUNK, len(places))):
            output[ray] = answers[places[ray]]
