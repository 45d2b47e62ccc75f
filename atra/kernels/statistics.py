"""A coarse look at a view: a few thousand rays against every triangle, without a BVH."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.planning import CORNERS, front_part, load_triangle, pixel_range


@njit(inline="always")
def _sample_range(low, high, step, samples):  # type: ignore[no-untyped-def]
    """First sample and the one behind the last in a pixel range; sample k is at (k + 1/2) step."""
    first = np.ceil(min(max(low / step - 0.5, 0.0), float(samples)))
    last = np.floor(max(min(high / step - 0.5, samples - 1.0), -1.0))
    return int(first), int(last) + 1


@njit(inline="always")
def _cross(p, q):  # type: ignore[no-untyped-def]
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


@kernel
def probe_triangles(points_pixels, depths, faces, step, hit_count, nearest, box_pixels):  # type: ignore[no-untyped-def]
    """Shoot a ray every `step` pixels, across and down, at all triangles.

    points_pixels: (V, 3) float64 homogeneous pixels. depths: (V,) float64. hit_count: (rows, columns) int64, how many
    triangles each ray meets, added to what is there. nearest: (rows, columns) float64, lowered to the nearest depth.
    box_pixels: (F,) float64, set to the area of each triangle's bounding rectangle within the image.
    """
    polygon, scratch = np.empty((CORNERS, 3)), np.empty((CORNERS, 3))
    rows, columns = nearest.shape
    for triangle in range(len(faces)):
        box_pixels[triangle] = 0.0
        front, back, largest = load_triangle(points_pixels, faces, triangle, polygon)
        corners = front_part(polygon, front, back, scratch)
        if corners == 0:
            continue
        tiny = 1e-12 * largest
        y_low, y_high = pixel_range(polygon, corners, 1, tiny)
        x_low, x_high = pixel_range(polygon, corners, 0, tiny)
        inside_x = min(x_high, float(columns * step)) - max(x_low, 0.0)
        inside_y = min(y_high, float(rows * step)) - max(y_low, 0.0)
        if not (inside_x > 0.0 and inside_y > 0.0):
            continue
        box_pixels[triangle] = inside_x * inside_y
        top, bottom = _sample_range(y_low, y_high, step, rows)
        left, right = _sample_range(x_low, x_high, step, columns)
        if top >= bottom or left >= right:
            continue
        a, b, c = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        p, q, r = points_pixels[a], points_pixels[b], points_pixels[c]
        # With s = (x, y, 1) the ray meets the triangle where s = u p + v q + w r with u, v, w >= 0 (Cramer's rule).
        qr, rp, pq = _cross(q, r), _cross(r, p), _cross(p, q)
        volume = p[0] * qr[0] + p[1] * qr[1] + p[2] * qr[2]
        if volume == 0.0:
            continue
        for row in range(top, bottom):
            y = (row + 0.5) * step
            for column in range(left, right):
                x = (column + 0.5) * step
                u = (x * qr[0] + y * qr[1] + qr[2]) / volume
                v = (x * rp[0] + y * rp[1] + rp[2]) / volume
                w = (x * pq[0] + y * pq[1] + pq[2]) / volume
                if u >= 0.0 and v >= 0.0 and w >= 0.0:
                    depth = (u * depths[a] + v * depths[b] + w * depths[c]) / (u + v + w)
                    if depth > 0.0:
                        hit_count[row, column] += 1
                        nearest[row, column] = min(nearest[row, column], depth)
