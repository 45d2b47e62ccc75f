"""Triangles and rays that start and head alike, all tested at once in float64, with bounds of the error."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import address_at, float_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, larger, mask_of, rounded, smaller, splat, where, widened
from atra.compiled.vectors import lane as lane_of
from atra.exact.lines_kernels import UNIT, major_axis
from atra.rays.all_hits.boxes_kernels import BOX_MARGIN
from atra.rays.all_hits.crossings_kernels import PRECISE, crossing, is_before
from atra.rays.all_hits.memory import LANES
from atra.rays.nearest.lanes_kernels import (
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
    px, py, pz = _corner(at, line)
    qx, qy, qz = _corner(at + 3 * LINE, line)
    rx, ry, rz = _corner(at + 6 * LINE, line)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    _, _, _, (error, square), inverse_z = line
    sizes = (abs(px) + abs(py)) + (abs(qx) + abs(qy)) + (abs(rx) + abs(ry))
    slack = fused(sizes, error, square)
    none = slack - slack
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    maybe = bits_of((least + slack >= none) | (most <= slack))
    if maybe == 0:
        return maybe, maybe
    whole, tnear, tfar = u + v + w, row_at(memory + NEAR), row_at(memory + FAR)
    inverse = spread(1.0) / whole
    t = (u * pz + v * qz + w * rz) * inverse * inverse_z
    extent = larger(larger(pz, qz), rz) - smaller(smaller(pz, qz), rz)
    wrong = spread(16.0) * (slack * abs(inverse)) * extent + spread(16.0 * UNIT) * largest_size(pz, qz, rz)
    is_sure = ((least > slack) | (none > most + slack)) & (spread(PRECISE) * abs(whole) > slack)
    sure = bits_of(is_sure & (abs(t - tnear) > wrong) & (abs(t - tfar) > wrong))
    store(t, memory + CROSSED)
    store(wrong, memory + CROSSED_ERROR)
    return sure & bits_of((t >= tnear) & (tfar > t)), maybe & ~sure


@njit
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

    hits: bits of the rays that cross it. place: address of its first x. places: address of (LANES,) int64, those of the
    nearest hits, 0: there is none.
    """
    t, wrong = row_at(memory + CROSSED), row_at(memory + CROSSED_ERROR)
    nearest, doubt = row_at(memory + NEAREST), row_at(memory + NEAREST_ERROR)
    gap, doubt = t - nearest, wrong + doubt
    is_before_all = spread(0.0) - doubt > gap
    nearer = hits & bits_of(is_before_all)
    unclear = hits & ~bits_of(is_before_all | (gap > doubt))
    if unclear:
        nearer |= _before_others(unclear, place, memory, places, exact)
    if nearer:
        mask = mask_of(nearer, LANES)
        held = load(places, np.int64(0), LANES)
        start, ahead = row_at(memory + START), load(memory + AHEAD, ZERO, LANES)
        limit = rounded(fused(t + wrong - start, spread(1.0 + BOX_MARGIN), spread(margin)))
        store(where(mask, t, nearest), memory + NEAREST)
        store(where(mask, wrong, row_at(memory + NEAREST_ERROR)), memory + NEAREST_ERROR)
        store(where(mask, limit, ahead), memory + AHEAD)
        store(where(mask, splat(np.int64(place), LANES), held), places)
    return nearer


@njit(forceinline=True)
def ray_of(memory, lane):  # type: ignore[no-untyped-def]
    """(origin, direction) of a ray."""
    at = doubles_at(memory + 8 * lane)
    return (at[0], at[LANES], at[2 * LANES]), (at[3 * LANES], at[4 * LANES], at[5 * LANES])


@njit
def decided(place, rays, memory, exact, touches):  # type: ignore[no-untyped-def]
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
    """What `_met` needs: a ray in the middle of all, as `line_of` has it, and how far others lie from it, and how much
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
def _middle_corner(place, tube):  # type: ignore[no-untyped-def]
    (ox, oy, oz), (sx, sy), (row_x, row_y, row_z), _, _ = tube
    z = widened(load(place + row_z, ZERO, BLOCK)) - oz
    x = fused(sx, z, widened(load(place + row_x, ZERO, BLOCK)) - ox)
    return x, fused(sy, z, widened(load(place + row_y, ZERO, BLOCK)) - oy), z


@njit(forceinline=True)
def met_by(block, tube):  # type: ignore[no-untyped-def]
    """Bits of the triangles of a block that any of the rays may cross: each is seen from a ray in the middle, and its
    corners lie elsewhere by as much as the rays are apart there. No bit for entries that hold no triangle."""
    px, py, pz = _middle_corner(block, tube)
    qx, qy, qz = _middle_corner(block + 3 * LINE, tube)
    rx, ry, rz = _middle_corner(block + 6 * LINE, tube)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    sizes = (abs(px) + abs(py)) + (abs(qx) + abs(qy)) + (abs(rx) + abs(ry))
    off = fused(largest_size(pz, qz, rz), tube[4], tube[3])
    slack = fused(sizes, off, (off + off) * off)
    none = slack - slack
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    return bits_of((least + slack >= none) | (most <= slack))
