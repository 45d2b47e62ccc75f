"""Kernels that build the lists of shafts (Algorithm 1 of Hendrich et al. 2019) and store equal lists once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add, float_at
from atra.compiled.memory import load
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import bits_of, larger, smaller, splat
from atra.embree.packets_kernels import INFINITY
from experiments.classification.bvh.batches import Memory
from experiments.classification.bvh.binary import NODE_BYTES, ROOT, Tree, first_of, kind_of
from experiments.classification.bvh.single import nearest, reciprocal
from experiments.classification.bvh.starts import EMPTY_LIST, ROOT_LIST, Grid
from experiments.classification.shafts.shape_kernels import HIGH, LOW, direction_of, heading, overlaps, set_shape

LANES = 8
"""Sampled rays tested with a box at once."""

ENDS, ROWS = 6, 7
"""The row of a bundle of sampled rays that says where they end, and the number of rows."""

_CHUNK = 16
_ZERO = np.float32(0.0)


class Building(NamedTuple):
    """What lists are built from, and how. tree: the BVH. grid: the voxels. probability: hit probability from which a
    node is opened. rays: sampled per shaft. longest: entries of a list. occlusion: whether a sampled ray ends at its
    first hit."""

    tree: Tree
    grid: Grid
    probability: float
    rays: int
    longest: int
    occlusion: bool


class Sampling(NamedTuple):
    """Memory of one thread. shape: (SHAPE,) float64. bundle: (ROWS, R) float32, sampled rays, padded with idle ones to
    whole vectors: origins, inverses of directions, and where the rays end. root: the root's list."""

    shape: NDArray[np.float64]
    bundle: NDArray[np.float32]
    root: NDArray[np.uint32]
    walk: Memory


@njit
def _random(state):  # type: ignore[no-untyped-def]
    """(next state, number in [0, 1)). Source: G. Steele et al., "Fast splittable pseudorandom number generators"."""
    state = np.uint64(state + np.uint64(0x9E3779B97F4A7C15))
    mixed = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed ^= mixed >> np.uint64(31)
    return state, np.float64(mixed >> np.uint64(11)) * 2.0**-53


@njit
def _sample(building, number, memory):  # type: ignore[no-untyped-def]
    """Sample the rays of a shaft evenly into the bundle, each up to its first hit beyond its voxel."""
    shape, bundle = memory.shape, memory.bundle
    state = np.uint64(number)
    for lane in range(bundle.shape[1]):
        if lane >= building.rays:
            bundle[ENDS, lane] = -INFINITY
            continue
        state, a = _random(state)
        state, b = _random(state)
        state, c = _random(state)
        state, u = _random(state)
        state, v = _random(state)
        x = shape[LOW] + a * (shape[HIGH] - shape[LOW])
        y = shape[LOW + 1] + b * (shape[HIGH + 1] - shape[LOW + 1])
        z = shape[LOW + 2] + c * (shape[HIGH + 2] - shape[LOW + 2])
        dx, dy, dz = direction_of(shape, u, v)
        leaves = np.inf
        for place, direction, side in ((x, dx, 0), (y, dy, 1), (z, dz, 2)):
            if direction != 0.0:
                end = shape[HIGH + side] if direction > 0.0 else shape[LOW + side]
                leaves = min(leaves, (end - place) / direction)
        origin = np.float32(x), np.float32(y), np.float32(z)
        ray = (*origin, np.float32(dx), np.float32(dy), np.float32(dz), np.float32(leaves))
        t = INFINITY
        if building.occlusion:
            walk = memory.walk
            t, _ = nearest(
                True, False, False, building.tree, ray, INFINITY, memory.root, ROOT_LIST, walk.stack, walk.nears,
                walk.counts,
            )  # fmt: skip
        bundle[0, lane], bundle[1, lane], bundle[2, lane] = origin
        bundle[3, lane], bundle[4, lane], bundle[5, lane] = reciprocal(ray[3]), reciprocal(ray[4]), reciprocal(ray[5])
        bundle[ENDS, lane] = t


@njit(forceinline=True)
def _slab(node, axis, at, row):  # type: ignore[no-untyped-def]
    """Where the rays at an address of the bundle enter and leave the box of a node along one axis."""
    place, inverse = load(at + axis * row, _ZERO, LANES), load(at + (3 + axis) * row, _ZERO, LANES)
    a = (splat(float_at(node + 4 * axis), LANES) - place) * inverse
    b = (splat(float_at(node + NODE_BYTES // 2 + 4 * axis), LANES) - place) * inverse
    return smaller(a, b), larger(a, b)


@njit
def _seen(node, memory):  # type: ignore[no-untyped-def]
    """The number of sampled rays that enter the box of the node at an address before they hit anything."""
    bundle, count, row = memory.bundle, 0, 4 * memory.bundle.shape[1]
    for first in range(0, bundle.shape[1], LANES):
        at = bundle.ctypes.data + 4 * first
        x0, x1 = _slab(node, 0, at, row)
        y0, y1 = _slab(node, 1, at, row)
        z0, z1 = _slab(node, 2, at, row)
        limit = smaller(smaller(smaller(x1, y1), z1), load(at + ENDS * row, _ZERO, LANES))
        bits = bits_of(larger(larger(larger(x0, y0), z0), splat(_ZERO, LANES)) <= limit)
        while bits:
            bits &= bits - 1
            count += 1
    return count


@njit
def _lowest(tree, shape, number):  # type: ignore[no-untyped-def]
    """The lowest node that holds all of a node's subtree that the shaft meets; -1 if it meets none of the children."""
    while True:
        node = tree.nodes + number * NODE_BYTES
        if kind_of(node) > 3:
            return number
        child = first_of(node)
        first = overlaps(shape, tree.nodes + child * NODE_BYTES)
        second = overlaps(shape, tree.nodes + (child + 1) * NODE_BYTES)
        if first and second:
            return number
        if not (first or second):
            return -1
        number = child if first else child + 1


@njit
def _collect(building, memory, probability, nodes):  # type: ignore[no-untyped-def]
    """Write the list of a shaft, far nodes first; returns its length, -1 if it is too long."""
    tree, shape, stack = building.tree, memory.shape, memory.walk.stack
    count, top = 0, 1
    stack[0] = ROOT
    while top > 0:
        top -= 1
        number = stack[top]
        node = tree.nodes + number * NODE_BYTES
        if not overlaps(shape, node):
            continue
        kind = kind_of(node)
        if kind <= 3 and _seen(node, memory) >= probability * building.rays:
            child = first_of(node)
            second = 1 if heading(shape, kind) > 0 else 0  # the farther child is popped first
            stack[top], stack[top + 1] = child + 1 - second, child + second
            top += 2
            continue
        number = _lowest(tree, shape, number)
        if number >= 0:
            if count == building.longest:
                return -1
            nodes[count] = number
            count += 1
    return count


@njit
def _fill(building, number, memory, nodes):  # type: ignore[no-untyped-def]
    """Write the list of the shaft whose shape is in memory; returns its length.

    If it is too long, the probability that opens a node is raised by 0.05, by 0.1 more, and so on, until it fits; above
    1, nothing is opened.
    """
    _sample(building, number, memory)
    probability, raised = building.probability, 0.05
    length = _collect(building, memory, probability, nodes)
    while length < 0:
        probability += raised
        raised += 0.05
        length = _collect(building, memory, probability, nodes)
    return length


@kernel
def build_lists(counter_address, building, numbers, lengths, nodes, memory):  # type: ignore[no-untyped-def]
    """Build the lists of the shafts `numbers`, (S,) int64. Threads share the counter.

    Written: lengths: (S,) int32, nodes: (S, longest) uint32.
    """
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(numbers):
            return
        for k in range(start, min(start + _CHUNK, len(numbers))):
            set_shape(building.grid, numbers[k], memory.shape)
            lengths[k] = _fill(building, numbers[k], memory, nodes[k])


@kernel
def store_lists(lengths, nodes, starts, lists, used, slots):  # type: ignore[no-untyped-def]
    """Store each new list, and where each starts; returns the used length of `lists`.

    starts: (S,) int32, written; empty lists share one. lists: uint32, with room for all. slots: int32 hash table, -1 =
    free; a power of two of them, more than lists, kept between calls.
    """
    mask = len(slots) - 1
    for k in range(len(lengths)):
        length = lengths[k]
        if length == 0:
            starts[k] = EMPTY_LIST
            continue
        digest = np.uint64(length)
        for j in range(length):
            digest = (digest ^ np.uint64(nodes[k, j])) * np.uint64(0x9E3779B97F4A7C15)
            digest ^= digest >> np.uint64(29)
        slot = np.int64(digest & np.uint64(mask))
        while True:
            start = slots[slot]
            if start < 0:
                lists[used] = length
                for j in range(length):
                    lists[used + 1 + j] = nodes[k, j]
                slots[slot] = starts[k] = used
                used += 1 + length
                break
            same = np.int64(lists[start]) == length
            for j in range(length):
                same = same and lists[start + 1 + j] == nodes[k, j]
            if same:
                starts[k] = start
                break
            slot = (slot + 1) & mask
    return used


@kernel
def mark_voxels(counter_address, blocks, grid, occupied):  # type: ignore[no-untyped-def]
    """Set occupied, (voxels,) bool, where a triangle may lie. blocks: (B, 10, 4) float32, as in a BVH."""
    low, size, voxels = grid.low, grid.size, grid.voxels
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    while True:
        start = fetch_add(counter_address, 1) * 256
        if start >= len(blocks):
            return
        for block in range(start, min(start + 256, len(blocks))):
            for k in range(blocks.shape[2]):
                if np.isnan(blocks[block, 0, k]):  # an unused entry
                    continue
                for axis in range(3):
                    one = np.float64(blocks[block, axis, k])
                    two, three = np.float64(blocks[block, 3 + axis, k]), np.float64(blocks[block, 6 + axis, k])
                    least, most = min(one, two, three) - 2.0 * grid.slack, max(one, two, three) + 2.0 * grid.slack
                    first[axis] = min(max(int((least - low[axis]) / size[axis]), 0), voxels[axis] - 1)
                    last[axis] = min(max(int((most - low[axis]) / size[axis]), 0), voxels[axis] - 1)
                for z in range(first[2], last[2] + 1):
                    for y in range(first[1], last[1] + 1):
                        for x in range(first[0], last[0] + 1):
                            occupied[(z * voxels[1] + y) * voxels[0] + x] = True
