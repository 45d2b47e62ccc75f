"""Rays that are coherent, side by side in rows of memory, and what boxes need of them."""

from __future__ import annotations

import numpy as np

from atra.compiled import vectors
from atra.compiled.intrinsics import float_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import float_part, njit
from atra.compiled.vectors import (
    bits_of,
    folded,
    fused,
    larger,
    mask_of,
    rounded,
    signed_like,
    smaller,
    splat,
    where,
)
from atra.exact.lines_kernels import major_axis
from atra.exact.sums_kernels import UNIT
from atra.rays.rays_kernels import COHERENT_DIRECTIONS, direction_of, interval_of, origin_of, scale_of
from atra.rays.tree.boxes_kernels import BOX_MARGIN, FAR_MARGIN, PADDING, SMALLEST_COMPONENT, query_of, slabs_of
from atra.rays.tree.crossings_kernels import ROUNDINGS
from atra.rays.tree.memory import RAY_LANES
from atra.trees.layout import BLOCK
from atra.trees.wide import CHILDREN, HIGH

ZERO, ZERO_64 = np.float32(0.0), np.float64(0.0)
_ROW = 4 * CHILDREN
LINE = 4 * BLOCK
WIDE = 8 * RAY_LANES
"""Bytes of a row of memory: a float64 of each ray; a row of float32 takes half of it."""

ORIGIN, DIRECTION, NEAR, FAR = 0, 3 * WIDE, 6 * WIDE, 7 * WIDE
CROSSED, CROSSED_ERROR, NEAREST, NEAREST_ERROR, START = 8 * WIDE, 9 * WIDE, 10 * WIDE, 11 * WIDE, 12 * WIDE
_PLACE, _INVERSE, AHEAD = 13 * WIDE, 16 * WIDE, 19 * WIDE
"""Where rows lie: float64 up to `START`, then float32."""


@njit(forceinline=True)
def spread(x):  # type: ignore[no-untyped-def]
    return splat(np.float64(x), RAY_LANES)


@njit(forceinline=True)
def row_at(at):  # type: ignore[no-untyped-def]
    return load(at, ZERO_64, RAY_LANES)


@njit(forceinline=True)
def three_rows(at):  # type: ignore[no-untyped-def]
    return row_at(at), row_at(at + WIDE), row_at(at + 2 * WIDE)


@njit(forceinline=True)
def _three_narrow(at):  # type: ignore[no-untyped-def]
    return load(at, ZERO, RAY_LANES), load(at + WIDE, ZERO, RAY_LANES), load(at + 2 * WIDE, ZERO, RAY_LANES)


@njit(forceinline=True)
def largest_size(a, b, c):  # type: ignore[no-untyped-def]
    return larger(larger(abs(a), abs(b)), abs(c))


@njit(forceinline=True)
def lowest_of(row):  # type: ignore[no-untyped-def]
    """The least number of a row."""
    if RAY_LANES == 16:
        return vectors.lane(folded(folded(folded(folded(row)))), 0)
    return vectors.lane(folded(folded(folded(row))), 0)


@njit(forceinline=True)
def highest_of(row, zero):  # type: ignore[no-untyped-def]
    """The largest number of a row; zero: of its type."""
    return -lowest_of(splat(zero, RAY_LANES) - row)


@njit(forceinline=True)
def _are_all(mask):  # type: ignore[no-untyped-def]
    return bits_of(mask) == (1 << RAY_LANES) - 1


@float_part
def load_rays(rays, first, last, near_by, memory):  # type: ignore[no-untyped-def]
    """(whether rays are coherent, bits of those that are open, octant, major axis, scale) of rays from `first`
    up to `last`. Writes their numbers to memory; lanes beyond the last ray get its numbers.

    Directions are multiplied by one `scale`, a power of two, which makes the largest component 0.75 to 2.25 in size.
    """
    at = doubles_at(memory)
    u, v, w = direction_of(rays, first)
    scale, length = scale_of(u, v, w)
    for lane in range(RAY_LANES):
        ray = min(first + lane, last - 1)
        x, y, z = origin_of(rays, ray)
        at[lane], at[RAY_LANES + lane], at[2 * RAY_LANES + lane] = x, y, z
        x, y, z = direction_of(rays, ray)
        at[3 * RAY_LANES + lane] = x * scale + 0.0  # -0.0 counts as 0.0
        at[4 * RAY_LANES + lane] = y * scale + 0.0
        at[5 * RAY_LANES + lane] = z * scale + 0.0
        near, far = interval_of(rays, ray)
        at[6 * RAY_LANES + lane], at[7 * RAY_LANES + lane] = near * length, far * length
    (ox, oy, oz), (dx, dy, dz) = three_rows(memory + ORIGIN), three_rows(memory + DIRECTION)
    u, v, w = at[3 * RAY_LANES], at[4 * RAY_LANES], at[5 * RAY_LANES]
    major = major_axis(u, v, w)
    way = abs(row_at(memory + DIRECTION + major * WIDE))
    moved = largest_size(ox - spread(at[0]), oy - spread(at[RAY_LANES]), oz - spread(at[2 * RAY_LANES]))
    turned = largest_size(dx - spread(u), dy - spread(v), dz - spread(w))
    is_coherent = (
        (moved <= spread(near_by)) & (turned <= spread(COHERENT_DIRECTIONS)) & (largest_size(dx, dy, dz) <= way)
    )
    zero, every = spread(0.0), (1 << RAY_LANES) - 1
    x, y, z = bits_of(zero > dx), bits_of(zero > dy), bits_of(zero > dz)
    octant = (x & 1) | (y & 1) << 1 | (z & 1) << 2
    is_one = (x == 0 or x == every) and (y == 0 or y == every) and (z == 0 or z == every)
    bits = bits_of(row_at(memory + FAR) > row_at(memory + NEAR)) & ((1 << (last - first)) - 1)
    return is_one and _are_all(is_coherent), bits, octant, major, scale


@float_part
def _begin_rays(memory, sphere, farthest, margin):  # type: ignore[no-untyped-def]
    """Bits of the rays that come near the mesh. Writes what box tests need of each, as `start_of` and `box_ray` do of
    one; rays start again a little earlier than there, as lengths of directions count as their least."""
    cx, cy, cz, radius = sphere
    (ox, oy, oz), (dx, dy, dz) = three_rows(memory + ORIGIN), three_rows(memory + DIRECTION)
    tnear, tfar = row_at(memory + NEAR), row_at(memory + FAR)
    x, y, z = spread(cx) - ox, spread(cy) - oy, spread(cz) - oz
    middle = fused(x, dx, fused(y, dy, z * dz)) / fused(dx, dx, fused(dy, dy, dz * dz))
    padded = 1.4 * (PADDING * radius + 192.0 * UNIT * farthest)
    s = larger(tnear, middle - spread(padded))
    px, py, pz = fused(s, dx, ox), fused(s, dy, oy), fused(s, dz, oz)
    way = largest_size(spread(cx) - px, spread(cy) - py, spread(cz) - pz)
    is_near = (s <= middle + spread(padded)) & (way <= spread(6.0 * padded)) & (s <= tfar)
    store(rounded(px), memory + _PLACE)
    store(rounded(py), memory + _PLACE + WIDE)
    store(rounded(pz), memory + _PLACE + 2 * WIDE)
    one, small = spread(1.0), spread(SMALLEST_COMPONENT)
    store(rounded(signed_like(one / larger(abs(dx), small), dx)), memory + _INVERSE)
    store(rounded(signed_like(one / larger(abs(dy), small), dy)), memory + _INVERSE + WIDE)
    store(rounded(signed_like(one / larger(abs(dz), small), dz)), memory + _INVERSE + 2 * WIDE)
    store(rounded(fused(tfar - s, spread(1.0 + BOX_MARGIN), spread(margin))), memory + AHEAD)
    store(s, memory + START)
    store(tfar, memory + NEAREST)
    store(spread(0.0), memory + NEAREST_ERROR)
    return bits_of(is_near)


@njit(forceinline=True)
def range_of(at, bits):  # type: ignore[no-untyped-def]
    """The least and the largest float32 of a row, of some rays."""
    row = load(at, ZERO, RAY_LANES)
    if bits != (1 << RAY_LANES) - 1:
        row = where(mask_of(bits, RAY_LANES), row, splat(float_at(at + 4 * first_bit(bits)), RAY_LANES))
    return lowest_of(row), highest_of(row, ZERO)


@njit(forceinline=True)
def _axis(memory, axis, bits, octant, margin):  # type: ignore[no-untyped-def]
    """`slabs_of` some of the rays."""
    low, high = range_of(memory + _PLACE + axis * WIDE, bits)
    one, other = range_of(memory + _INVERSE + axis * WIDE, bits)
    return slabs_of(low, high, one, other, octant >> axis & 1, margin, axis)


@float_part
def begin_together(tree, memory, left, octant, near_by):  # type: ignore[no-untyped-def]
    """(bits of the rays among some that may meet the mesh, their query, where they end, the margin of boxes, the error
    of a corner laid along a ray) of rays that `load_rays` has loaded."""
    at, (cx, cy, cz, radius) = doubles_at(memory), tree.sphere
    farthest = max(abs(at[0] - cx), abs(at[RAY_LANES] - cy), abs(at[2 * RAY_LANES] - cz)) + near_by
    if near_by == np.inf:
        ox, oy, oz = three_rows(memory + ORIGIN)
        farthest = highest_of(largest_size(ox - spread(cx), oy - spread(cy), oz - spread(cz)), ZERO_64)
    margin = (max(abs(cx), abs(cy), abs(cz)) + 16.0 * radius) * BOX_MARGIN + farthest * FAR_MARGIN
    left &= _begin_rays(memory, tree.sphere, farthest, margin)
    some, margin_32 = left if left else np.int64(1), np.float32(margin)
    _, ahead = range_of(memory + AHEAD, some)
    x, y = _axis(memory, 0, some, octant, margin_32), _axis(memory, 1, some, octant, margin_32)
    query = query_of(x, y, _axis(memory, 2, some, octant, margin_32), ahead, margin_32)
    return left, query, ahead, margin, ROUNDINGS * UNIT * (farthest + radius)


@njit(forceinline=True)
def _side(at, margin):  # type: ignore[no-untyped-def]
    return splat(np.float32(float_at(at) + margin), RAY_LANES)


@njit(forceinline=True)
def entering(at, memory, octant, margin):  # type: ignore[no-untyped-def]
    """Bits of the rays that may meet the box of one child of a node; at: of its lowest x."""
    (px, py, pz), (ix, iy, iz) = _three_narrow(memory + _PLACE), _three_narrow(memory + _INVERSE)
    dx, dy, dz = octant & 1, octant >> 1 & 1, octant >> 2 & 1
    near, far = at, at + HIGH
    near_x, far_x = (_side(far, margin), _side(near, -margin)) if dx else (_side(near, -margin), _side(far, margin))
    near += _ROW
    far += _ROW
    near_y, far_y = (_side(far, margin), _side(near, -margin)) if dy else (_side(near, -margin), _side(far, margin))
    near += _ROW
    far += _ROW
    near_z, far_z = (_side(far, margin), _side(near, -margin)) if dz else (_side(near, -margin), _side(far, margin))
    start, end = splat(np.float32(-margin), RAY_LANES), load(memory + AHEAD, ZERO, RAY_LANES)
    first = larger(start, larger((near_z - pz) * iz, larger((near_y - py) * iy, (near_x - px) * ix)))
    last = smaller(end, smaller((far_z - pz) * iz, smaller((far_y - py) * iy, (far_x - px) * ix)))
    return bits_of(first <= last)
