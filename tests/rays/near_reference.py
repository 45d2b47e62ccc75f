"""The nearest hit of each ray in float64 with proved bounds of all errors, or the triangles that may be it.

It shares nothing with the library: a binary tree of boxes, split at the median, finds the triangles. All numbers given
are float64, and zero or between 2^-200 and 2^100 in size, so that nothing below over- or underflows (`near_judging`
checks).

**Bounds.** u = 2^-53 is the largest relative error of one operation. An expression whose terms each pass at most k
operations, added in any order, errs by at most g(k) P, where g(k) = k u / (1 - k u) and P is the sum of the terms'
sizes in exact arithmetic (N. J. Higham, "Accuracy and Stability of Numerical Algorithms", section 3.1); this includes
the subtractions that make its factors: each passes its relative error on to the terms. P takes as many operations, all
of positive numbers, so its relative error is g(k) at most. So (k + 1) u times the computed P bounds
the error, as (k + 1) u (1 - g(k)) > g(k) for k < 100. J. R. Shewchuk ("Adaptive precision floating-point arithmetic and
fast robust geometric predicates", 1997) has the same form: for the determinant of three differences of rows of three,
(7 + 56 u) u P, where terms pass 7 operations.

1. Side of an edge: d . (a x b) with a, b differences from the origin. A term passes 2 differences, 2 products, 1
   subtraction, 2 additions: k = 7, bound 8 u P. A side is certain where its size is above.
2. Normal n = e x f of edges e, f, each a difference; N = n . (a - o): a term passes 3 differences, 2 products, 1
   subtraction, 2 additions: k = 8, bound 9 u P_N. D = n . d: 2 differences, k = 7, bound 8 u P_D.
3. t = N / D. With x = 9 u P_N / |N| and y = 8 u P_D / |D|, N is off by a factor from 1 - x to 1 + x and D from 1 - y to
   1 + y, so t by a factor from (1 - x)(1 - u) / (1 + y) to (1 + x)(1 + u) / (1 - y), which for y < 1/2 lie within
   r = 2 (x + y) + 2 u of 1 (1 / (1 - y) <= 1 + 2 y, and x <= 1/2 too). What rounds in computing r itself is far below
   its factor of 2 in x + y. In turn t is within 2 r of the computed one, of it, where r <= 1/4.
4. Slab of a box: (low - o) / d passes a difference and a quotient. Computed parameters p of sides are off by 2 u |p|
   and a little more: a ray that meets the box has p_in - 3 u |p_in| <= p_out + 3 u |p_out|, and enters it at
   p_in - 3 u |p_in| at the earliest. Largest and smallest pass no operation. Boxes hold float64 corners as they are.
   A ray that the tie rule moves by an infinitely small way meets only triangles whose closed box the ray itself meets.
"""

from __future__ import annotations

import numba
import numpy as np

U = 2.0**-53

MOST = 64
"""Triangles of a ray that may be its nearest hit, at most."""

LEAF = 4

NONE, SURE, OPEN, TOO_MANY = 0, 1, 2, 3
"""What is known of a ray: it hits nothing; its nearest hit; triangles of which one may be; there are too many."""


@numba.njit(nogil=True)
def build(corners, order, low, high, first, count):
    """A tree over (F, 3, 3) float64 corners; order: (F,) int64, all triangles, is put in order. Node k has children
    first[k] and first[k] + 1 where count[k] is 0, else count[k] triangles from order[first[k]] on. Returns its nodes.

    low, high: (2 F, 3) float64. first, count: (2 F,) int64.
    """
    stack = np.empty((128, 3), np.int64)
    stack[0] = 0, 0, len(order)
    top, used = 1, 1
    while top:
        top -= 1
        node, start, end = stack[top]
        low[node], high[node] = np.inf, -np.inf
        middle_low, middle_high = np.full(3, np.inf), np.full(3, -np.inf)
        for k in range(start, end):
            for axis in range(3):
                total = 0.0
                for corner in range(3):
                    x = corners[order[k], corner, axis]
                    low[node, axis], high[node, axis] = min(low[node, axis], x), max(high[node, axis], x)
                    total += x
                middle_low[axis], middle_high[axis] = min(middle_low[axis], total), max(middle_high[axis], total)
        axis = np.argmax(middle_high - middle_low)
        if end - start <= LEAF:
            first[node], count[node] = start, end - start
            continue
        keys = np.empty(end - start)
        for k in range(start, end):
            keys[k - start] = corners[order[k], 0, axis] + corners[order[k], 1, axis] + corners[order[k], 2, axis]
        order[start:end] = order[start:end][np.argsort(keys)]
        middle = (start + end) // 2
        first[node], count[node] = used, 0
        stack[top] = used, start, middle
        stack[top + 1] = used + 1, middle, end
        top += 2
        used += 2
    return used


@numba.njit(nogil=True, inline="always")
def side(dx, dy, dz, ax, ay, az, bx, by, bz):
    """(sign of d . (a x b), 0 where it is not certain)."""
    yz, zy, zx, xz, xy, yx = ay * bz, az * by, az * bx, ax * bz, ax * by, ay * bx
    found = dx * (yz - zy) + dy * (zx - xz) + dz * (xy - yx)
    size = abs(dx) * (abs(yz) + abs(zy)) + abs(dy) * (abs(zx) + abs(xz)) + abs(dz) * (abs(xy) + abs(yx))
    return 0 if abs(found) <= 8 * U * size else 1 if found > 0 else -1


@numba.njit(nogil=True, inline="always")
def entry(node, low, high, o, d):
    """Where a ray enters a box at the earliest; inf: never."""
    start, end = 0.0, np.inf
    for k in range(3):
        if d[k] == 0.0:
            if o[k] < low[node, k] or o[k] > high[node, k]:
                return np.inf
            continue
        one, other = (low[node, k] - o[k]) / d[k], (high[node, k] - o[k]) / d[k]
        start, end = max(start, min(one, other)), min(end, max(one, other))
    start -= 3 * U * abs(start)
    return start if start <= end + 3 * U * abs(end) else np.inf


@numba.njit(nogil=True)
def crossing(corners, face, o, d):
    """(state, low, t, high) of a ray and a triangle: state NONE, SURE or OPEN; of what may be a crossing, the parameter
    and bounds of it."""
    ax, ay, az = corners[face, 0, 0] - o[0], corners[face, 0, 1] - o[1], corners[face, 0, 2] - o[2]
    bx, by, bz = corners[face, 1, 0] - o[0], corners[face, 1, 1] - o[1], corners[face, 1, 2] - o[2]
    cx, cy, cz = corners[face, 2, 0] - o[0], corners[face, 2, 1] - o[1], corners[face, 2, 2] - o[2]
    one = side(d[0], d[1], d[2], ax, ay, az, bx, by, bz)
    two = side(d[0], d[1], d[2], bx, by, bz, cx, cy, cz)
    three = side(d[0], d[1], d[2], cx, cy, cz, ax, ay, az)
    if max(one, two, three) - min(one, two, three) == 2:
        return NONE, 0.0, 0.0, 0.0
    ex, ey, ez = corners[face, 1, 0] - corners[face, 0, 0], corners[face, 1, 1] - corners[face, 0, 1], \
        corners[face, 1, 2] - corners[face, 0, 2]  # fmt: skip
    fx, fy, fz = corners[face, 2, 0] - corners[face, 0, 0], corners[face, 2, 1] - corners[face, 0, 1], \
        corners[face, 2, 2] - corners[face, 0, 2]  # fmt: skip
    yz, zy, zx, xz, xy, yx = ey * fz, ez * fy, ez * fx, ex * fz, ex * fy, ey * fx
    nx, ny, nz = yz - zy, zx - xz, xy - yx
    px, py, pz = abs(yz) + abs(zy), abs(zx) + abs(xz), abs(xy) + abs(yx)
    ahead, facing = nx * ax + ny * ay + nz * az, nx * d[0] + ny * d[1] + nz * d[2]
    ahead_error = 9 * U * (px * abs(ax) + py * abs(ay) + pz * abs(az))
    facing_error = 8 * U * (px * abs(d[0]) + py * abs(d[1]) + pz * abs(d[2]))
    is_certain = abs(ahead) > ahead_error and abs(facing) > facing_error
    if is_certain and (ahead > 0) != (facing > 0):
        return NONE, 0.0, 0.0, 0.0
    if is_certain:
        t = ahead / facing
        r = 2 * (ahead_error / abs(ahead) + facing_error / abs(facing)) + 2 * U
        if r <= 0.25:
            state = SURE if one != 0 and one == two and one == three else OPEN
            return state, t * (1 - 2 * r), t, t * (1 + 2 * r)
    return OPEN, 0.0, 0.0, np.inf


@numba.njit(nogil=True)
def nearest(corners, order, low, high, first, count, origins, directions, states, rivals, counts, t_of, errors):
    """Write what is known of each ray. states: (N,) int8. rivals: (N, MOST) int64, those that may be its nearest hit,
    counts: (N,) int64. t_of, errors: (N,) float64, the parameter of the only one, and its largest error."""
    stack, reached = np.empty(256, np.int64), np.empty(256)
    lows = np.empty(MOST)
    for ray in range(len(origins)):
        o, d = origins[ray], directions[ray]
        limit, used, all_sure, is_full = np.inf, 0, True, False
        stack[0], reached[0], top = 0, entry(0, low, high, o, d), 1
        while top:
            top -= 1
            if reached[top] > limit or reached[top] == np.inf:
                continue
            node = stack[top]
            if count[node] == 0:
                one, other = first[node], first[node] + 1
                at_one, at_other = entry(one, low, high, o, d), entry(other, low, high, o, d)
                if at_one < at_other:
                    one, other, at_one, at_other = other, one, at_other, at_one
                stack[top], reached[top], stack[top + 1], reached[top + 1] = one, at_one, other, at_other
                top += 2
                continue
            for place in range(first[node], first[node] + count[node]):
                face = order[place]
                state, least, t, most = crossing(corners, face, o, d)
                if state == NONE or least > limit:
                    continue
                if state == SURE and most < limit:
                    limit = most
                    kept = 0
                    for k in range(used):
                        if lows[k] <= limit:
                            lows[kept], rivals[ray, kept] = lows[k], rivals[ray, k]
                            kept += 1
                    used = kept
                if used == MOST:
                    is_full = True
                    break
                lows[used], rivals[ray, used] = least, face
                used += 1
                if used == 1:
                    all_sure = state == SURE
                    t_of[ray], errors[ray] = t, max(most - t, t - least)
        counts[ray] = used
        states[ray] = TOO_MANY if is_full else NONE if used == 0 else SURE if used == 1 and all_sure else OPEN
