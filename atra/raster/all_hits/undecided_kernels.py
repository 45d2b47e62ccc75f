"""Undecided samples, so near an edge of a triangle that float32 may not tell whether their ray crosses it.

Embree decides about a ray and a triangle by the signs of three volumes, each the product of the ray's direction, a
corner and an edge. In float32 they are off by few roundings of the largest such product, so that only samples in a
narrow strip along an edge are decided otherwise than exactly; those are listed, and decided exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from atra.all_hits.taking_kernels import TRANSMITTANCE, take
from atra.all_hits.target_kernels import LIST_END, MARKS, target_at
from atra.compiled.intrinsics import fetch_add, float_at
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import mask_of, splat
from atra.raster.all_hits.crossings_kernels import corner_of, covers, depth_at, facing_of, homogeneous_of

ROUNDINGS = 16.0
"""Roundings, of the largest product, that a volume may be off by: those of the corners, of the ray, of two edges, of
two products and their differences, and of the sum of three volumes, are 12; and a few to spare."""

ROBUST_ROUNDINGS = 24.0
"""The same of Embree's robust test. For an edge between corners p and q, from the ray's origin, it computes
U = ((q - p) x (q + p)) . d, which is twice the volume. With corners at most `far` away and an edge of length `long`,
counted in roundings of far long |d|, U is off by

4    corners, 1 each: a corner's error times the other and the direction, which passes it by `long` at most
2    q - p, and 2 for q + p, which is as long as 2 far
5.7  the products of the cross product and their difference, 2 roundings of sqrt(2) long 2 far
6    the products of the scalar product and their sums, 3 roundings of long 2 far
4    the direction, a sum of a column and a row, 2 roundings of long 2 far

together 23.7, so the volume by 11.9. Its test takes what is outside by 2^-23 |U + V + W|, too, and U + V + W is at most
2 long^2 |d| with long <= 2 far: 4 more for the volume. That is 16, and a few to spare.
Sources: PlueckerIntersector1 and PlueckerIntersectorK in Embree's kernels/geometry/triangle_intersector_pluecker.h;
N. J. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., SIAM 2002, chapter 3."""

_FLOAT32_UNIT = 2.0**-24

_BEYOND = 8.0
"""Times the length of an edge up to which, beyond its ends, Embree may find a triangle that is seen edge-on: there all
volumes are rounding, and only the boxes of the few triangles of a leaf keep rays away."""

_ROUNDING = 1e-6
"""Pixels that boxes are enlarged by for the rounding of float64."""

_CHUNK = 1024
"""Triangles a thread takes at a time."""


class Precision(NamedTuple):
    """How exact float32 rays are. pitch: of pixels. direction: the longest. stretch: times that a shear lengthens at
    most. shift: length that is added to corners, in origins of rays and in translations, at most. robust: whether
    Embree's robust test of triangles decides, not its fast one."""

    pitch: float
    direction: float
    stretch: float
    shift: float
    robust: bool


@njit(forceinline=True)
def _whole(low, high, last):  # type: ignore[no-untyped-def]
    """First and last whole number from `low` to `high` and of 0 ... last."""
    return int(np.ceil(min(max(low, 0.0), last + 1.0))), int(np.floor(max(min(high, last), -1.0)))


@njit(forceinline=True)
def _add(keys, count, i, j, width, triangle):  # type: ignore[no-untyped-def]
    """List a sample, and count it at an address."""
    place = fetch_add(count, 1)
    if place < len(keys):
        keys[place] = (j * width + i) << 32 | triangle


@njit(forceinline=True)
def _value(edge, i, j):  # type: ignore[no-untyped-def]
    return edge[0] * i + edge[1] * j + edge[2]


@njit
def _walk(edges, tolerances, box, size, triangle, keys, count):  # type: ignore[no-untyped-def]
    """List the samples of a box where the first edge, |a i + b j + c|, is at most its tolerance, and that are not
    surely beside the other two. box: left, right, top, bottom. size: width, height of the image."""
    (a, b, c), (width, height) = edges[0], size
    left, right, top, bottom = box
    if a == 0.0 and b == 0.0:
        return
    is_flat = abs(b) >= abs(a)
    across, along = (b, a) if is_flat else (a, b)
    slope, start, reach = -along / across, -c / across, tolerances[0] / abs(across)
    low, high, low_across, high_across = (left, right, top, bottom) if is_flat else (top, bottom, left, right)
    last_along, last_across = (width - 1.0, height - 1.0) if is_flat else (height - 1.0, width - 1.0)
    first, last = _whole(low, high, last_along)
    for at in range(first, last + 1):
        middle = start + slope * at
        near, far = _whole(max(middle - reach, low_across), min(middle + reach, high_across), last_across)
        for other in range(near, far + 1):
            i, j = (at, other) if is_flat else (other, at)
            if not (_value(edges[1], i, j) < -tolerances[1] or _value(edges[2], i, j) < -tolerances[2]):
                _add(keys, count, i, j, width, triangle)


@njit
def _list_edges(edges, tolerances, beyond, box, size, triangle, keys, count):  # type: ignore[no-untyped-def]
    """List what is near the edges of a triangle. edges: (a, b, c) each, not negative inside. beyond: whether samples
    past the ends of edges are to be listed, too: which side is inside is not known then."""
    free = np.inf if beyond else 1.0
    (one, two, three), (t1, t2, t3) = edges, tolerances
    _walk((one, two, three), (t1, free * t2, free * t3), box, size, triangle, keys, count)
    _walk((two, three, one), (t2, free * t3, free * t1), box, size, triangle, keys, count)
    _walk((three, one, two), (t3, free * t1, free * t2), box, size, triangle, keys, count)


@njit
def _list_all(edges, tolerance, size, triangle, keys, count):  # type: ignore[no-untyped-def]
    """List all samples of the image that are beside no edge for sure, whichever side is inside."""
    width, height = size
    for j in range(height):
        for i in range(width):
            u, v, w = _value(edges[0], i, j), _value(edges[1], i, j), _value(edges[2], i, j)
            if min(u, v, w) >= -tolerance or max(u, v, w) <= tolerance:
                _add(keys, count, i, j, width, triangle)


@njit(forceinline=True)
def _normal(a, b, sign):  # type: ignore[no-untyped-def]
    """(a, b, c): the volume of samples, the eye and two corners, `homogeneous_of` each, is a i + b j + c."""
    return sign * (a[1] * b[2] - a[2] * b[1]), sign * (a[2] * b[0] - a[0] * b[2]), sign * (a[0] * b[1] - a[1] * b[0])


@njit(forceinline=True)
def _line(px, py, qx, qy, sign):  # type: ignore[no-untyped-def]
    """(a, b, c) of the line through two pixel positions."""
    dx, dy = sign * (qx - px), sign * (qy - py)
    return -dy, dx, dy * px - dx * py


@njit(forceinline=True)
def _depth_line(x0, y0, w0, x1, y1, w1, x2, y2, w2):  # type: ignore[no-untyped-def]
    """(a, b, c) of the line where the plane of a triangle meets a parallel image plane; times the area its depth."""
    x1, y1, w1, x2, y2, w2 = x1 - x0, y1 - y0, w1 - w0, x2 - x0, y2 - y0, w2 - w0
    a, b, area = w1 * y2 - w2 * y1, w2 * x1 - w1 * x2, x1 * y2 - y1 * x2
    return a, b, w0 * area - a * x0 - b * y0


@njit(forceinline=True)
def _squared(p, q):  # type: ignore[no-untyped-def]
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@njit(forceinline=True)
def _sizes(view, v0, v1, v2):  # type: ignore[no-untyped-def]
    """(farthest corner from the eye, longest edge)."""
    a, b, c, eye = corner_of(view, v0), corner_of(view, v1), corner_of(view, v2), (0.0, 0.0, 0.0)
    far, long = max(_squared(a, eye), _squared(b, eye), _squared(c, eye)), max(_squared(a, b), _squared(b, c))
    return np.sqrt(far), np.sqrt(max(long, _squared(c, a)))


@kernel
def list_undecided(  # type: ignore[no-untyped-def]
    counter_address, parallel, view, points, faces, width, height, precision, exact, keys, count, facings
):  # fmt: skip
    """List undecided samples, some of them twice; the int64 at `count` counts them.

    points: of `projected`. exact: as `turn` needs it, of this thread. keys: (N,) int64, (y * width + x) << 32 |
    triangle, written as far as they reach. facings: (F,) float32, of each triangle as `facing_of` has it.
    """
    unit = (ROBUST_ROUNDINGS if precision.robust else ROUNDINGS) * _FLOAT32_UNIT
    per_pixel, size = precision.direction / precision.pitch**2, (width, height)
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + _CHUNK, len(faces))):
            v0, v1, v2 = np.int64(faces[triangle, 0]), np.int64(faces[triangle, 1]), np.int64(faces[triangle, 2])
            facings[triangle] = facing_of(parallel, view, points, v0, v1, v2, exact)
            x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
            x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
            x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
            nearest, farthest = max(w0, w1, w2), min(w0, w1, w2)
            if farthest >= 0.0 if parallel else nearest < 0.0:
                continue
            far, long = _sizes(view, v0, v1, v2)
            far, long = far * precision.stretch + precision.shift, long * precision.stretch
            largest = unit * per_pixel * far * long
            of_depth = unit * far * long * long / precision.pitch**2
            if not parallel and not farthest > 0.0:
                a, b, c = homogeneous_of(view, v0), homogeneous_of(view, v1), homogeneous_of(view, v2)
                normal = _normal(b, c, 1.0)
                volume = normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2]
                sign = 1.0 if volume > 0.0 else -1.0
                edges = _normal(b, c, sign), _normal(c, a, sign), _normal(a, b, sign)
                if abs(volume) <= of_depth:  # the plane is so near the eye that all of it is undecided
                    _list_all(edges, largest, size, triangle, keys, count)
                else:
                    box = 0.0, width - 1.0, 0.0, height - 1.0
                    _list_edges(edges, (largest, largest, largest), False, box, size, triangle, keys, count)
                continue
            area = (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)
            tolerances = (
                (largest, largest, largest) if parallel else (largest * w1 * w2, largest * w2 * w0, largest * w0 * w1)
            )
            worst = max(tolerances[0], tolerances[1], tolerances[2])
            is_thin = not abs(area) > 4.0 * worst
            low_x, high_x, low_y, high_y = min(x0, x1, x2), max(x0, x1, x2), min(y0, y1, y2), max(y0, y1, y2)
            # What is beside no edge by more than a tolerance is the triangle, enlarged by their sum over its area.
            share, aside = (_BEYOND, 1.0) if is_thin else (3.0 * worst / abs(area), _ROUNDING)
            at_x, at_y = share * (high_x - low_x) + aside, share * (high_y - low_y) + aside
            left, right, top, bottom = low_x - at_x, high_x + at_x, low_y - at_y, high_y + at_y
            if not (
                np.ceil(max(left, 0.0)) <= min(right, width - 1.0)
                and np.ceil(max(top, 0.0)) <= min(bottom, height - 1.0)
            ):
                continue
            box, sign = (left, right, top, bottom), 1.0 if area > 0.0 else -1.0
            edges = _line(x1, y1, x2, y2, sign), _line(x2, y2, x0, y0, sign), _line(x0, y0, x1, y1, sign)
            _list_edges(edges, tolerances, is_thin, box, size, triangle, keys, count)
            if parallel and nearest >= 0.0:
                plane = _depth_line(x0, y0, w0, x1, y1, w1, x2, y2, w2)
                _walk((plane, plane, plane), (of_depth, np.inf, np.inf), box, size, triangle, keys, count)


@kernel
def decide(parallel, view, points, faces, turns, width, keys, exact, facings, depths):  # type: ignore[no-untyped-def]
    """Which of the undecided samples cross their triangle. turns: (F,) float32, facings of triangles. facings: (N,)
    float32, 1 or -1 as `facing_of` has it, 0 = not crossed; depths: (N,) float32."""
    for k in range(len(keys)):
        triangle, pixel = keys[k] & 0xFFFFFFFF, keys[k] >> 32
        i, j = float(pixel % width), float(pixel // width)
        v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        facings[k], depths[k] = 0.0, 0.0
        if turns[triangle] != 0.0 and covers(parallel, points, v0, v1, v2, i, j, exact):
            depth = np.float32(depth_at(parallel, view, points, v0, v1, v2, i, j))
            if depth > 0.0:
                facings[k], depths[k] = turns[triangle], depth


@kernel
def mark(keys, width, marks, first, listed):  # type: ignore[no-untyped-def]
    """Make the lists of `Target`. keys: ascending, each once. marks: (rows, row) uint8, zero; first: (rows, row) int32.
    listed: uint32, two for each key."""
    place, last = 0, -1
    for k in range(len(keys)):
        pixel = keys[k] >> 32
        y, x = pixel // width, pixel % width
        if pixel != last:
            if last >= 0:
                listed[place] = LIST_END
                place += 1
            first[y, x], last = place, pixel
        triangle = np.uint32(keys[k] & 0xFFFFFFFF)
        listed[place] = triangle
        place += 1
        marks[y, x] |= np.uint8(1 << (np.int64(triangle) % MARKS))
    if last >= 0:
        listed[place] = LIST_END


@cache
def settling_kernel(kind: int) -> Callable[..., None]:
    """The loop over decided samples; kind, of reduction, is a constant of the compiled code."""
    has_factors = kind == TRANSMITTANCE

    @kernel
    def settle(keys, facings, depths, width, block):  # type: ignore[no-untyped-def]
        """Take the hits among undecided samples. keys, facings, depths: of `decide`. block: of a `Target`."""
        target = target_at(block)
        for k in range(len(keys)):
            if facings[k] != 0.0:
                pixel, prim_id = keys[k] >> 32, np.uint32(keys[k] & 0xFFFFFFFF)
                place = pixel // width * target.row + pixel % width
                weight = float_at(target.weights + np.int64(prim_id) * 4) if has_factors else facings[k]
                take(kind, 1, 1, mask_of(1, 1), splat(depths[k], 1), weight, prim_id, place, target)

    return settle
