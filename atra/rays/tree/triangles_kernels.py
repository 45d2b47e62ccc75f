"""Triangles and rays that are coherent, all tested at once in float64, with bounds of the error."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import address_at, float_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, larger, mask_of, rounded, smaller, splat, where
from atra.compiled.vectors import lane as lane_of
from atra.exact.lines_kernels import major_axis
from atra.exact.sums_kernels import UNIT, out_of_line
from atra.rays.tree.boxes_kernels import BOX_MARGIN
from atra.rays.tree.crossings_kernels import PRECISE, are_sure, areas_of, crossing, is_before, laid_corner
from atra.rays.tree.lanes_kernels import (
    AHEAD,
    CROSSED,
    CROSSED_ERROR,
    DIRECTION,
    FAR,
    LINE,
    NEAR,
    NEAREST,
    NEAREST_ERROR,
    ORIGIN,
    START,
    WIDE,
    ZERO,
    ZERO_64,
    highest_of,
    largest_size,
    lowest_of,
    row_at,
    spread,
)
from atra.rays.tree.memory import RAY_LANES
from atra.trees.layout import BLOCK


@njit(forceinline=True)
def _corner(at, line):  # type: ignore[no-untyped-def]
    """A corner of a triangle, laid along each ray onto the plane across the major axis."""
    (ox, oy, oz), (sx, sy), (row_x, row_y, row_z), _, _ = line
    z = spread(float_at(at + row_z)) - oz
    return fused(sx, z, spread(float_at(at + row_x)) - ox), fused(sy, z, spread(float_at(at + row_y)) - oy), z


@njit(forceinline=True)
def crossed(at, line, memory):  # type: ignore[no-untyped-def]
    """(bits of the rays that surely cross a triangle between `tnear` and `tfar`, and of those that may: `crossing` has
    to decide), as `candidates` and `sure_crossing` of one ray. at: of the triangle's first x.

    Writes the parameters of the sure ones and their errors to memory.
    """
    _, _, _, (error, square), inverse_z = line
    p, q, r = _corner(at, line), _corner(at + 3 * LINE, line), _corner(at + 6 * LINE, line)
    (u, v, w), slack, least, most, some = areas_of(p, q, r, error, square)
    maybe = bits_of(some)
    if maybe == 0:
        return maybe, maybe
    whole, tnear, tfar = u + v + w, row_at(memory + NEAR), row_at(memory + FAR)
    inverse = spread(1.0) / whole
    t = (u * p[2] + v * q[2] + w * r[2]) * inverse * inverse_z
    extent = larger(larger(p[2], q[2]), r[2]) - smaller(smaller(p[2], q[2]), r[2])
    wrong = spread(16.0) * (slack * abs(inverse)) * extent + spread(16.0 * UNIT) * largest_size(p[2], q[2], r[2])
    is_sure = are_sure(least, most, slack) & (spread(PRECISE) * abs(whole) > slack)
    sure = bits_of(is_sure & (abs(t - tnear) > wrong) & (abs(t - tfar) > wrong))
    store(t, memory + CROSSED)
    store(wrong, memory + CROSSED_ERROR)
    return sure & bits_of((t >= tnear) & (tfar > t)), maybe & ~sure


@out_of_line
def _before_others(rays, place, memory, places, exact):  # type: ignore[no-untyped-def]
    """Bits of the rays among some, which float64 does not tell of, whose nearest hits so far lie behind a triangle."""
    nearer = np.int64(0)
    while rays:
        lane = first_bit(rays)
        rays &= rays - 1
        o, d = ray_of(memory, lane)
        other = address_at(places + 8 * lane)
        if other == 0 or is_before(place, 0, other, 0, o, d, exact):
            nearer |= 1 << lane
    return nearer


@njit(forceinline=True)
def take_nearer(hits, place, memory, places, margin, exact):  # type: ignore[no-untyped-def]
    """Bits of the rays whose nearest hits so far lie behind a triangle that they cross; writes that in their place.

    hits: bits of the rays that cross it. place: address of its first x. places: address of (RAY_LANES,) int64, those of
    the nearest hits, 0: there is none.
    """
    t, wrong = row_at(memory + CROSSED), row_at(memory + CROSSED_ERROR)
    nearest, nearest_error = row_at(memory + NEAREST), row_at(memory + NEAREST_ERROR)
    gap, errors = t - nearest, wrong + nearest_error
    is_before_all = spread(0.0) - errors > gap
    nearer = hits & bits_of(is_before_all)
    unclear = hits & ~bits_of(is_before_all | (gap > errors))
    if unclear:
        nearer |= _before_others(unclear, place, memory, places, exact)
    if nearer:
        mask = mask_of(nearer, RAY_LANES)
        held = load(places, np.int64(0), RAY_LANES)
        start, ahead = row_at(memory + START), load(memory + AHEAD, ZERO, RAY_LANES)
        limit = rounded(fused(t + wrong - start, spread(1.0 + BOX_MARGIN), spread(margin)))
        store(where(mask, t, nearest), memory + NEAREST)
        store(where(mask, wrong, nearest_error), memory + NEAREST_ERROR)
        store(where(mask, limit, ahead), memory + AHEAD)
        store(where(mask, splat(np.int64(place), RAY_LANES), held), places)
    return nearer


@njit(forceinline=True)
def ray_of(memory, lane):  # type: ignore[no-untyped-def]
    """(origin, direction) of a ray."""
    at = doubles_at(memory + 8 * lane)
    return (at[0], at[RAY_LANES], at[2 * RAY_LANES]), (at[3 * RAY_LANES], at[4 * RAY_LANES], at[5 * RAY_LANES])


@out_of_line
def cross_exactly(place, rays, memory, exact, touches):  # type: ignore[no-untyped-def]
    """Bits of the rays among some, which float64 does not tell of, that cross a triangle; writes their parameters."""
    at, hits = doubles_at(memory), np.int64(0)
    while rays:
        lane = first_bit(rays)
        rays &= rays - 1
        o, d = ray_of(memory, lane)
        tnear, tfar = at[NEAR // 8 + lane], at[FAR // 8 + lane]
        sign, t, wrong, _, _ = crossing(place, 0, o, d, tnear, tfar, major_axis(d[0], d[1], d[2]), exact, touches)
        if sign != 0:
            hits |= 1 << lane
            at[CROSSED // 8 + lane], at[CROSSED_ERROR // 8 + lane] = t, wrong
    return hits


@njit(forceinline=True)
def line_of(memory, major, error):  # type: ignore[no-untyped-def]
    """What triangle tests need of all rays, as `line_of` of one. error: that of a corner laid along a ray."""
    one, other = (major + 1) % 3, (major + 2) % 3
    inverse = spread(1.0) / row_at(memory + DIRECTION + major * WIDE)
    minus = spread(0.0) - inverse
    return (
        (
            row_at(memory + ORIGIN + one * WIDE), row_at(memory + ORIGIN + other * WIDE),
            row_at(memory + ORIGIN + major * WIDE),
        ),
        (row_at(memory + DIRECTION + one * WIDE) * minus, row_at(memory + DIRECTION + other * WIDE) * minus),
        (one * LINE, other * LINE, major * LINE), (spread(error), spread(error * error)), inverse,
    )  # fmt: skip


@njit(forceinline=True)
def tube_of(line):  # type: ignore[no-untyped-def]
    """What `met_by` needs: a ray in the middle of all, as `line_of` has it, how far others lie from it, and how much
    more with each step along the major axis."""
    (ox, oy, oz), (sx, sy), rows, (error, _), _ = line
    low_x, high_x, low_y, high_y = lowest_of(ox), highest_of(ox, ZERO_64), lowest_of(oy), highest_of(oy, ZERO_64)
    low_z, high_z = lowest_of(oz), highest_of(oz, ZERO_64)
    least_x, most_x, least_y, most_y = lowest_of(sx), highest_of(sx, ZERO_64), lowest_of(sy), highest_of(sy, ZERO_64)
    apart = 0.5 * (max(high_x - low_x, high_y - low_y) + 1.125 * 2.0 * (high_z - low_z))
    turned = 0.5 * max(most_x - least_x, most_y - least_y)
    return (
        (
            splat(0.5 * (low_x + high_x), BLOCK), splat(0.5 * (low_y + high_y), BLOCK),
            splat(0.5 * (low_z + high_z), BLOCK),
        ),
        (splat(0.5 * (least_x + most_x), BLOCK), splat(0.5 * (least_y + most_y), BLOCK)),
        rows, splat(apart + lane_of(error, 0), BLOCK), splat(turned, BLOCK),
    )  # fmt: skip


@njit(forceinline=True)
def met_by(block, tube):  # type: ignore[no-untyped-def]
    """Bits of the triangles of a block that any of the rays may cross: each is seen from a ray in the middle, and its
    corners lie elsewhere by as much as the rays are apart there. No bit for entries that hold no triangle."""
    origin, shear, rows, apart, turned = tube
    p = laid_corner(block, origin, shear, rows)
    q = laid_corner(block + 3 * LINE, origin, shear, rows)
    r = laid_corner(block + 6 * LINE, origin, shear, rows)
    off = fused(largest_size(p[2], q[2], r[2]), turned, apart)
    return bits_of(areas_of(p, q, r, off, (off + off) * off)[4])
