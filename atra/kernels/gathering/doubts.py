"""Doubts: the samples so near an edge of a triangle that float32 may not tell whether their ray crosses it.

Embree decides about a ray and a triangle by the signs of three volumes, each the product of the ray's direction, a
corner and an edge. In float32 they are off by few roundings of the largest such product, so that only samples in a
narrow strip along an edge are decided otherwise than exactly; those are listed, and decided exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.gathering.crossings import covers, depth_at, facing_of, homogeneous
from atra.kernels.gathering.taking import TRANSMITTANCE, take
from atra.kernels.gathering.target import LIST_END, MARKS, target_at
from atra.kernels.intrinsics import fetch_add, float_at
from atra.kernels.raster.vectors import mask_of, repeated

ROUNDINGS = 16.0
"""Roundings, of the largest product, that a volume may be off by: those of the corners, of the ray, of two edges, of
two products and their differences, and of the sum of three volumes, are 12; and a few to spare."""

_FLOAT32_UNIT = 2.0**-24

_BEYOND = 8.0
"""Times the length of an edge up to which, beyond its ends, Embree may find a triangle that is seen edge-on: there all
volumes are rounding, and only the boxes of the few triangles of a leaf keep rays away."""

_CHUNK = 1024
"""Triangles a thread takes at a time."""


class Precision(NamedTuple):
    """How exact float32 rays are. pitch: of pixels. direction: the longest. stretch: times that a shear lengthens at
    most. shift: length that is added to corners, in origins of rays and in translations, at most."""

    pitch: float
    direction: float
    stretch: float
    shift: float


@njit(inline="always")
def _whole(low, high, last):  # type: ignore[no-untyped-def]
    """First and last whole number from `low` to `high` and of 0 ... last."""
    return int(np.ceil(min(max(low, 0.0), last + 1.0))), int(np.floor(max(min(high, last), -1.0)))


@njit
def _walk(a, b, c, tolerance, left, right, top, bottom, width, height, triangle, keys, size):  # type: ignore[no-untyped-def]
    """List the samples of a box where |a i + b j + c| <= tolerance."""
    if abs(b) >= abs(a):
        if b == 0.0:
            return
        slope, start, reach = -a / b, -c / b, tolerance / abs(b)
        first, last = _whole(left, right, width - 1.0)
        for i in range(first, last + 1):
            y = start + slope * i
            low, high = _whole(max(y - reach, top), min(y + reach, bottom), height - 1.0)
            for j in range(low, high + 1):
                place = fetch_add(size, 1)
                if place < len(keys):
                    keys[place] = (j * width + i) << 32 | triangle
    else:
        slope, start, reach = -b / a, -c / a, tolerance / abs(a)
        first, last = _whole(top, bottom, height - 1.0)
        for j in range(first, last + 1):
            x = start + slope * j
            low, high = _whole(max(x - reach, left), min(x + reach, right), width - 1.0)
            for i in range(low, high + 1):
                place = fetch_add(size, 1)
                if place < len(keys):
                    keys[place] = (j * width + i) << 32 | triangle


@njit(inline="always")
def _normal(view, v, w):  # type: ignore[no-untyped-def]
    """(a, b, c): the volume of samples, the eye and two corners is a i + b j + c."""
    ax, ay, az = homogeneous(view, v)
    bx, by, bz = homogeneous(view, w)
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(inline="always")
def _sizes(view, v0, v1, v2):  # type: ignore[no-untyped-def]
    """(farthest corner from the eye, longest edge)."""
    vertices, eye = view.vertices, view.eye
    x0, y0, z0 = vertices[v0, 0] - eye[0], vertices[v0, 1] - eye[1], vertices[v0, 2] - eye[2]
    x1, y1, z1 = vertices[v1, 0] - eye[0], vertices[v1, 1] - eye[1], vertices[v1, 2] - eye[2]
    x2, y2, z2 = vertices[v2, 0] - eye[0], vertices[v2, 1] - eye[1], vertices[v2, 2] - eye[2]
    far = max(x0 * x0 + y0 * y0 + z0 * z0, x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2)
    a = (x1 - x0) ** 2 + (y1 - y0) ** 2 + (z1 - z0) ** 2
    b = (x2 - x1) ** 2 + (y2 - y1) ** 2 + (z2 - z1) ** 2
    c = (x0 - x2) ** 2 + (y0 - y2) ** 2 + (z0 - z2) ** 2
    return np.sqrt(far), np.sqrt(max(a, b, c))


@njit
def _through_eye_plane(view, v0, v1, v2, tolerance, thinnest, width, height, triangle, keys, size):  # type: ignore[no-untyped-def]
    """A triangle on both sides of the eye; thinnest: volume of the eye and the triangle below which its plane is
    so near the eye that all of its samples are in doubt."""
    a0, b0, c0 = _normal(view, v1, v2)
    a1, b1, c1 = _normal(view, v2, v0)
    a2, b2, c2 = _normal(view, v0, v1)
    x, y, z = homogeneous(view, v0)
    right, bottom = width - 1.0, height - 1.0
    if abs(a0 * x + b0 * y + c0 * z) > thinnest:
        for a, b, c in ((a0, b0, c0), (a1, b1, c1), (a2, b2, c2)):
            _walk(a, b, c, tolerance, 0.0, right, 0.0, bottom, width, height, triangle, keys, size)
        return
    for j in range(height):
        for i in range(width):
            u, v, w = a0 * i + b0 * j + c0, a1 * i + b1 * j + c1, a2 * i + b2 * j + c2
            if min(u, v, w) >= -tolerance or max(u, v, w) <= tolerance:
                place = fetch_add(size, 1)
                if place < len(keys):
                    keys[place] = (j * width + i) << 32 | triangle


@njit
def _at_image_plane(points, v0, v1, v2, tolerance, box, width, height, triangle, keys, size):  # type: ignore[no-untyped-def]
    """Samples where a triangle on both sides of a parallel image plane is next to it; tolerance: of volumes."""
    x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
    x1, y1, w1 = points[v1, 0] - x0, points[v1, 1] - y0, points[v1, 2] - w0
    x2, y2, w2 = points[v2, 0] - x0, points[v2, 1] - y0, points[v2, 2] - w0
    a, b, area = w1 * y2 - w2 * y1, w2 * x1 - w1 * x2, x1 * y2 - y1 * x2
    c = w0 * area - a * x0 - b * y0
    _walk(a, b, c, tolerance, box[0], box[1], box[2], box[3], width, height, triangle, keys, size)


@kernel
def list_doubts(counter_address, parallel, view, points, faces, width, height, precision, keys, size):  # type: ignore[no-untyped-def]
    """List samples in doubt, some of them twice; the int64 at `size` counts them.

    points: of `project`. keys: (N,) int64, (y * width + x) << 32 | triangle, written as far as they reach.
    """
    unit = ROUNDINGS * _FLOAT32_UNIT
    per_pixel = precision.direction / precision.pitch**2
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + _CHUNK, len(faces))):
            v0, v1, v2 = np.int64(faces[triangle, 0]), np.int64(faces[triangle, 1]), np.int64(faces[triangle, 2])
            w0, w1, w2 = points[v0, 2], points[v1, 2], points[v2, 2]
            behind = parallel and min(w0, w1, w2) >= 0.0
            if behind or (not parallel and max(w0, w1, w2) < 0.0):
                continue
            is_in_front = parallel or min(w0, w1, w2) > 0.0
            x0, y0, x1, y1, x2, y2 = (
                points[v0, 0],
                points[v0, 1],
                points[v1, 0],
                points[v1, 1],
                points[v2, 0],
                points[v2, 1],
            )
            if is_in_front:
                low_x, high_x, low_y, high_y = min(x0, x1, x2), max(x0, x1, x2), min(y0, y1, y2), max(y0, y1, y2)
                far_x, far_y = _BEYOND * (high_x - low_x) + 1.0, _BEYOND * (high_y - low_y) + 1.0
                if low_x - far_x > width or high_x + far_x < -1.0 or low_y - far_y > height or high_y + far_y < -1.0:
                    continue
            far, long = _sizes(view, v0, v1, v2)
            far, long = far * precision.stretch + precision.shift, long * precision.stretch
            largest = unit * per_pixel * far * long
            if not is_in_front:
                thinnest = unit * far * long * long / precision.pitch**2
                _through_eye_plane(view, v0, v1, v2, largest, thinnest, width, height, triangle, keys, size)
                continue
            area = abs((x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0))
            of_all = largest if parallel else largest * max(w0, w1, w2) ** 2
            beyond = min(2.0 * of_all / area, _BEYOND) if area > 0.0 else _BEYOND
            more = 1.0 if beyond > 0.5 else 0.0
            for px, py, qx, qy, both in (
                (x0, y0, x1, y1, w0 * w1),
                (x1, y1, x2, y2, w1 * w2),
                (x2, y2, x0, y0, w2 * w0),
            ):
                tolerance = largest if parallel else largest * both
                dx, dy = qx - px, qy - py
                steepest = max(abs(dx), abs(dy))
                if steepest == 0.0:
                    continue
                aside = tolerance / steepest + more
                at_x, at_y = aside + beyond * abs(dx), aside + beyond * abs(dy)
                _walk(
                    -dy, dx, dy * px - dx * py, tolerance,
                    min(px, qx) - at_x, max(px, qx) + at_x, min(py, qy) - at_y, max(py, qy) + at_y,
                    width, height, triangle, keys, size,
                )  # fmt: skip
            if parallel and max(w0, w1, w2) >= 0.0:
                box = low_x - 1.0, high_x + 1.0, low_y - 1.0, high_y + 1.0
                of_depth = unit * far * long * long / precision.pitch**2
                _at_image_plane(points, v0, v1, v2, of_depth, box, width, height, triangle, keys, size)


@kernel
def decide(parallel, view, points, faces, width, keys, exact, facings, depths):  # type: ignore[no-untyped-def]
    """Which of the samples in doubt cross their triangle. facings: (N,) float32, 1 or -1 as `facing_of` has it, 0 =
    not crossed; depths: (N,) float32."""
    for k in range(len(keys)):
        triangle, pixel = keys[k] & 0xFFFFFFFF, keys[k] >> 32
        i, j = float(pixel % width), float(pixel // width)
        v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        facing = facing_of(parallel, view, points, v0, v1, v2, exact)
        facings[k], depths[k] = 0.0, 0.0
        if facing != 0 and covers(parallel, points, v0, v1, v2, i, j, exact):
            depth = np.float32(depth_at(parallel, view, points, v0, v1, v2, i, j))
            if depth > 0.0:
                facings[k], depths[k] = facing, depth


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


@kernel
def face(counter_address, parallel, view, points, faces, exact, facings):  # type: ignore[no-untyped-def]
    """facings: (F,) float32, of each triangle as `facing_of` has it. exact: as `turn` needs it, of this thread."""
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + _CHUNK, len(faces))):
            v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
            facings[triangle] = facing_of(parallel, view, points, v0, v1, v2, exact)


@cache
def settling_kernel(kind: int) -> Callable[..., None]:
    """The loop over decided samples; kind, of reduction, is a constant of the compiled code."""
    has_factors = kind == TRANSMITTANCE

    @kernel
    def settle(keys, facings, depths, width, block):  # type: ignore[no-untyped-def]
        """Take the hits among the samples in doubt. keys, facings, depths: of `decide`. block: of a `Target`."""
        target = target_at(block)
        for k in range(len(keys)):
            if facings[k] != 0.0:
                pixel, prim_id = keys[k] >> 32, np.uint32(keys[k] & 0xFFFFFFFF)
                place = pixel // width * target.row + pixel % width
                weight = float_at(target.weights + np.int64(prim_id) * 4) if has_factors else facings[k]
                take(kind, 1, 1, mask_of(1, 1), repeated(depths[k], 1), weight, prim_id, place, target)

    return settle
