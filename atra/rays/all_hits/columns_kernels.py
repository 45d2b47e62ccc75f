"""The loop over points for the triangles above or below them: a ray along one of the world's axes from each."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import load
from atra.compiled.store import float_kernel, njit
from atra.compiled.vectors import bits_of, splat
from atra.rays.all_hits.boxes_kernels import child_node, first_block
from atra.rays.all_hits.crossings_kernels import candidates, crossing_of, line_of
from atra.rays.all_hits.memory import CHUNK, LEAF
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS, CHILDREN, HIGH

_ZERO = np.float32(0.0)
_ROW = 4 * CHILDREN
_UP, _DOWN = np.float32(1.0 + 2.0**-22), np.float32(1.0 - 2.0**-22)
_LEAST = np.float32(1e-37)


@njit(forceinline=True)
def _around(x):  # type: ignore[no-untyped-def]
    """Two float32, one below and one above a float64."""
    near = np.float32(x)
    low, high = (near * _DOWN, near * _UP) if near >= _ZERO else (near * _UP, near * _DOWN)
    return splat(low - _LEAST, CHILDREN), splat(high + _LEAST, CHILDREN)


@njit(forceinline=True)
def _entered(node, column, one, other, along, upward):  # type: ignore[no-untyped-def]
    """Bits of the children that hold a point of the ray. column: two float32 around each coordinate."""
    (low_x, high_x), (low_y, high_y), (low_z, high_z) = column
    inside = (load(node + one, _ZERO, CHILDREN) <= high_x) & (load(node + HIGH + one, _ZERO, CHILDREN) >= low_x)
    inside = inside & (load(node + other, _ZERO, CHILDREN) <= high_y)
    inside = inside & (load(node + HIGH + other, _ZERO, CHILDREN) >= low_y)
    if upward:
        return bits_of(inside & (load(node + HIGH + along, _ZERO, CHILDREN) >= low_z))
    return bits_of(inside & (load(node + along, _ZERO, CHILDREN) <= high_z))


@float_kernel
def cross_columns(counter_address, tree, points, axis, low, high, middle, found, counts, turns):  # type: ignore[no-untyped-def]
    """Write how many triangles the ray of each point crosses, and the sum of their signs.

    points: (N, 3) float64. axis: of the world, along which rays go. low, high: (3,) float64, the mesh's box; a point
    outside of it crosses nothing. middle: twice that of the box along the axis; the ray heads for the nearer end.
    counts, turns: (N,) int32; a sign is 1 where the ray leaves a closed mesh.
    """
    one, other, along = ((axis + 1) % 3) * _ROW, ((axis + 2) % 3) * _ROW, axis * _ROW
    exact, areas = found.exact.ctypes.data, found.areas.ctypes.data
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(points):
            return
        for number in range(start, min(start + CHUNK, len(points))):
            x, y, z = points[number, 0], points[number, 1], points[number, 2]
            count, turn = 0, 0
            top = 0
            if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
                found.stack[0] = tree.nodes
                top = 1
            o = x, y, z
            upward = 2.0 * o[axis] >= middle
            way = 1.0 if upward else -1.0
            d = way if axis == 0 else 0.0, way if axis == 1 else 0.0, way if axis == 2 else 0.0
            column = _around(o[(axis + 1) % 3]), _around(o[(axis + 2) % 3]), _around(o[axis])
            line = line_of(o, d, tree.sphere)
            while top > 0:
                top -= 1
                node = found.stack[top]
                if node & LEAF:
                    maybe, sure = candidates(node - LEAF, line, areas)
                    while maybe:
                        k = first_bit(maybe)
                        maybe &= maybe - 1
                        is_sure, ends = sure >> k & 1, (0.0, np.inf)
                        sign = crossing_of(node - LEAF, k, is_sure, line, areas, (o, d), ends, exact, False)[0]
                        count += abs(sign)
                        turn += sign
                    continue
                bits = _entered(node, column, one, other, along, upward)
                while bits:
                    child = 4 * first_bit(bits)
                    bits &= bits - 1
                    blocks = int32_at(node + BLOCK_COUNTS + child)
                    if blocks == 0:
                        found.stack[top] = child_node(tree, node, child)
                        top += 1
                        continue
                    to = first_block(tree, node, child) + LEAF
                    for _ in range(blocks):
                        found.stack[top] = to
                        to += BLOCK_BYTES
                        top += 1
            counts[number], turns[number] = count, turn
