"""Clusters: triangles that lie together, in groups with a box each; made once per mesh.

Triangles are sorted by the power of 4 of their size, and then along a Morton curve through their centres; each
CLUSTER of them that follow each other are one group. Each cluster stores its own vertices, so drawing it reads one
contiguous block.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh

CLUSTER = 128
"""Triangles of one."""

POINT_BYTES = 32
"""From one projected vertex to the next."""

VERTICES = 8
"""Vertices, and triangles, that are read at once, the last of a cluster together with what follows them."""

_CELLS_BITS = 9
"""Bits of a centre's place along each axis."""

_SIZES_BITS = 3
"""Bits of the size."""

_DIGIT_BITS = (3 * _CELLS_BITS + _SIZES_BITS) // 3
"""Bits by which triangles are sorted at a time."""

_INDEX_BITS = 32
"""Below the bits of a key are those of the triangle."""

_PLACE_BITS = 10
"""Bits of a vertex's place in its cluster; 3 CLUSTER vertices fit."""

_SPREAD = np.array([int(f"{cell:b}", 8) for cell in range(1 << _CELLS_BITS)], np.uint32)
"""Each cell's bits, each followed by two of 0: what in base 2 it is, in base 8."""

_MANY = 1 << 19
"""Triangles from which on the lowest digit counts; the others alone are some 60 cells along an axis."""

_CHUNK = 8192
"""Triangles a thread takes at a time."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """C clusters of F triangles; cluster c has the places c CLUSTER ... (c + 1) CLUSTER - 1, as far as there are any.

    prim_ids: (F,) uint32, of the triangle in each place. corners: (F,) uint64, VERTICES more behind them, 16 bits
    each: where its cluster's vertices lie that are its corners, in bytes of projected points, and above them its place
    in the cluster.
    vertices: (3 N + VERTICES,) float32: of each cluster all x, then all y, then all z. firsts: (C + 1,) int64, how many
    vertices come before each cluster's. boxes: (C, 6) float32, lowest x, y, z, highest x, y, z.
    """

    prim_ids: NDArray[np.uint32]
    corners: NDArray[np.uint64]
    vertices: NDArray[np.float32]
    firsts: NDArray[np.int64]
    boxes: NDArray[np.float32]
    mesh: Mesh

    @cached_property
    def addresses(self) -> ClusterAddresses:
        """Where the arrays lie."""
        arrays = self.prim_ids, self.corners, self.vertices, self.firsts, self.mesh.vertices, self.mesh.faces
        return ClusterAddresses(len(self.prim_ids), *(array.ctypes.data for array in arrays))

    @property
    def count(self) -> int:
        """C."""
        return len(self.boxes)

    @property
    def bytes(self) -> int:
        """Memory of all arrays."""
        arrays = self.prim_ids, self.corners, self.vertices, self.firsts, self.boxes
        return sum(array.nbytes for array in arrays)


class ClusterAddresses(NamedTuple):
    """Arrays of `Clusters` and of its mesh by their addresses, and how many triangles there are."""

    triangles: int
    prim_ids: int
    corners: int
    vertices: int
    firsts: int
    mesh_vertices: int
    mesh_faces: int


def clusters_of(mesh: Mesh, pool: WorkerPool) -> Clusters:
    """The clusters of a mesh, around its own origin."""
    mesh = mesh.local
    triangles = mesh.triangle_count
    keys = np.empty(triangles, np.uint64)
    if triangles > CLUSTER:
        low, high = mesh.bounds
        scale = ((1 << _CELLS_BITS) - 1) / max(float((high - low).max()), 1e-30)
        pool.run(lambda _, counter: number_triangles(counter, mesh.vertices, mesh.faces, low, scale, keys))
        keys = _sorted(keys, pool)
    else:
        keys[:] = np.arange(triangles)
    count = -(-triangles // CLUSTER)
    prim_ids, corners = np.empty(triangles, np.uint32), np.zeros(triangles + VERTICES, np.uint64)[:triangles]
    used, numbers = np.empty(3 * triangles, np.uint32), np.zeros(count + 1, np.int64)
    places = [np.zeros(len(mesh.vertices), np.uint32) for _ in range(pool.threads)]
    pool.run(
        lambda worker, counter: gather_corners(
            counter, mesh.faces, keys, prim_ids, corners, used, numbers, places[worker]
        )
    )
    firsts = np.cumsum(numbers)
    vertices, boxes = np.zeros(3 * int(firsts[-1]) + VERTICES, np.float32), np.empty((count, 6), np.float32)
    pool.run(lambda _, counter: gather_vertices(counter, mesh.vertices, used, firsts, vertices, boxes))
    return Clusters(prim_ids, corners, vertices, firsts, boxes, mesh)


def _sorted(keys: NDArray[np.uint64], pool: WorkerPool) -> NDArray[np.uint64]:
    """Sorted by the bits above those of the triangle; what is equal stays in its order."""
    chunk = max(-(-len(keys) // pool.threads), _CHUNK)
    counts = np.empty((-(-len(keys) // chunk), 1 << _DIGIT_BITS), np.int64)
    other = np.empty_like(keys)

    def count(_: int, counter: int) -> None:
        count_digits(counter, keys, chunk, shift, counts)

    def move(_: int, counter: int) -> None:
        move_by_digit(counter, keys, chunk, shift, counts, other)

    for digit in range(len(keys) < _MANY, 3):
        shift = _INDEX_BITS + digit * _DIGIT_BITS
        pool.run(count)
        place_digits(counts)
        pool.run(move)
        keys, other = other, keys
    return keys


@njit(forceinline=True)
def _exponent(number):  # type: ignore[no-untyped-def]
    """The power of 2 of a float32 that is not negative, up to a constant."""
    return np.int64(np.float32(number).view(np.int32) >> 23)


@kernel
def number_triangles(counter_address, vertices, faces, low, scale, keys):  # type: ignore[no-untyped-def]
    """keys (F,) uint64: a triangle's size and place, and below them its number. scale: cells per unit of length."""
    cells, index_bits = np.float32((1 << _CELLS_BITS) - 1), np.uint64(_INDEX_BITS)
    per_length, per_sum, largest = np.float32(scale), np.float32(0.5 * scale), _exponent(cells)
    x, y, z = np.float32(2.0 * low[0]), np.float32(2.0 * low[1]), np.float32(2.0 * low[2])
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + _CHUNK, len(faces))):
            v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
            longest, key = np.float32(0.0), np.uint64(0)
            for axis, twice_low in ((0, x), (1, y), (2, z)):
                a, b, c = vertices[v0, axis], vertices[v1, axis], vertices[v2, axis]
                lowest, highest = min(a, b, c), max(a, b, c)
                longest = max(longest, highest - lowest)
                cell = min(max((lowest + highest - twice_low) * per_sum, np.float32(0.0)), cells)
                key |= np.uint64(_SPREAD[np.uint64(cell)]) << np.uint64(axis)
            size = min(max((largest - _exponent(longest * per_length) + 1) >> 1, 0), (1 << _SIZES_BITS) - 1)
            key |= np.uint64(size) << np.uint64(3 * _CELLS_BITS)
            keys[triangle] = (key << index_bits) | np.uint64(triangle)


@kernel
def count_digits(counter_address, keys, chunk, shift, counts):  # type: ignore[no-untyped-def]
    """counts (chunks, digits): how often each chunk has each digit."""
    right, mask = np.uint64(shift), np.uint64(counts.shape[1] - 1)
    while True:
        number = fetch_add(counter_address, 1)
        if number >= len(counts):
            return
        counts[number] = 0
        for k in range(number * chunk, min((number + 1) * chunk, len(keys))):
            counts[number, np.int64((keys[k] >> right) & mask)] += 1


@kernel
def place_digits(counts):  # type: ignore[no-untyped-def]
    """Counts become places: where each chunk's keys with a digit begin."""
    place = 0
    for digit in range(counts.shape[1]):
        for chunk in range(counts.shape[0]):
            count = counts[chunk, digit]
            counts[chunk, digit] = place
            place += count


@kernel
def move_by_digit(counter_address, keys, chunk, shift, places, moved):  # type: ignore[no-untyped-def]
    """Each key into its place."""
    right, mask = np.uint64(shift), np.uint64(places.shape[1] - 1)
    while True:
        number = fetch_add(counter_address, 1)
        if number >= len(places):
            return
        for k in range(number * chunk, min((number + 1) * chunk, len(keys))):
            digit = np.int64((keys[k] >> right) & mask)
            moved[places[number, digit]] = keys[k]
            places[number, digit] += 1


@kernel
def gather_corners(counter_address, faces, keys, prim_ids, corners, used, numbers, places):  # type: ignore[no-untyped-def]
    """prim_ids and corners of `Clusters`; used (3 F,) uint32: each cluster's vertices, from 3 times its first place on;
    numbers (C + 1,) int64: how many those are, at c + 1.

    places: (V,) uint32, of one thread, zero at first: a vertex's last cluster and place there.
    """
    while True:
        cluster = fetch_add(counter_address, 1)
        start = cluster * CLUSTER
        if start >= len(keys):
            return
        stop = min(start + CLUSTER, len(keys))
        for k in range(start, stop):  # by itself, so that reads of triangles far apart need not wait for each other
            triangle = np.int64(keys[k] & np.uint64((1 << _INDEX_BITS) - 1))
            prim_ids[k] = triangle
            for corner in range(3):
                used[3 * k + corner] = faces[triangle, corner]
        count, tag = 0, (cluster + 1) << _PLACE_BITS
        for k in range(start, stop):
            packed = (k - start) << 48
            for corner in range(3):
                vertex = used[3 * k + corner]
                found = np.int64(places[vertex]) - tag
                is_new = not 0 <= found < 1 << _PLACE_BITS
                found = count if is_new else found  # written either way: a branch would be mispredicted half the time
                places[vertex] = tag + found
                used[3 * start + count] = vertex
                count += is_new
                packed |= (found * POINT_BYTES) << (16 * corner)
            corners[k] = packed
        numbers[cluster + 1] = count


@kernel
def gather_vertices(counter_address, vertices, used, firsts, gathered, boxes):  # type: ignore[no-untyped-def]
    """vertices and boxes of `Clusters`."""
    while True:
        cluster = fetch_add(counter_address, 1)
        if cluster >= len(boxes):
            return
        source, count = cluster * 3 * CLUSTER, firsts[cluster + 1] - firsts[cluster]
        for axis in range(3):
            first = 3 * firsts[cluster] + axis * count
            lowest, highest = np.float32(np.inf), np.float32(-np.inf)
            for k in range(count):
                value = vertices[used[source + k], axis]
                gathered[first + k] = value
                lowest, highest = min(lowest, value), max(highest, value)
            boxes[cluster, axis], boxes[cluster, axis + 3] = lowest, highest
