"""Corners of a triangle in space, and the plane through them as nearness by pixel position."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at, floats_at
from atra.compiled.store import njit
from atra.exact.intersection import NOISE
from atra.raster.clusters import POINT_BYTES
from atra.raster.set_up import NEAR_AND_FAR
from atra.raster.triangles import corner_at


@njit
def holds_eye(eye, a, b, c):  # type: ignore[no-untyped-def]
    """Whether the eye lies in the plane of a triangle, to the rounding of float64: then no ray hits it, by the rule of
    `atra.exact.intersection`.

    eye: its position. a, b, c: the corners, seen from it.
    """
    (x, y, z), (x1, y1, z1), (x2, y2, z2) = a, b, c
    x1, y1, z1, x2, y2, z2 = x1 - x, y1 - y, z1 - z, x2 - x, y2 - y, z2 - z
    volume = x * (y1 * z2 - z1 * y2) + y * (z1 * x2 - x1 * z2) + z * (x1 * y2 - y1 * x2)
    one, other = x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2
    reach = x * x + y * y + z * z + eye[0] * eye[0] + eye[1] * eye[1] + eye[2] * eye[2]
    return abs(volume) <= NOISE * np.sqrt(reach * one * other)


@njit(forceinline=True)
def from_eye(eye, vertices, count, packed, corner):  # type: ignore[no-untyped-def]
    """A corner, in the world's axes, seen from the eye; vertices: address of the `count` of its cluster."""
    values, position = floats_at(vertices), doubles_at(eye.position)
    place = ((packed >> (16 * corner)) & 0xFFFF) // POINT_BYTES
    x, y, z = values[place], values[place + count], values[place + 2 * count]
    return x - position[0], y - position[1], z - position[2]


@njit(forceinline=True)
def homogeneous(m, corner):  # type: ignore[no-untyped-def]
    """(x, y, 1) times the depth of a corner, or (x, y, 1) where rays are parallel; x and y its pixel position."""
    u, v, w = corner
    return (
        m[0] * u + m[1] * v + m[2] * w + m[3],
        m[4] * u + m[5] * v + m[6] * w + m[7],
        m[8] * u + m[9] * v + m[10] * w + m[11],
    )


@njit(forceinline=True)
def _inverse_of(volume):  # type: ignore[no-untyped-def]
    """1 / volume; for a volume of 0 something huge, which puts the plane at the eye."""
    return 1.0 / volume if volume != 0.0 else 1e200


@njit
def pinhole_plane(m, a, b, c):  # type: ignore[no-untyped-def]
    """Nearness A i + B j + C on the plane of a triangle that may reach behind the eye.

    The plane of the corners p0, p1, p2, homogeneous, with normal n = (p1 - p0) x (p2 - p0), is met at 1 / depth =
    n . (i, j, 1) / n . p0.
    """
    a0, b0, c0 = homogeneous(m, a)
    a1, b1, c1 = homogeneous(m, b)
    a2, b2, c2 = homogeneous(m, c)
    a1, b1, c1 = a1 - a0, b1 - b0, c1 - c0
    a2, b2, c2 = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = b1 * c2 - c1 * b2, c1 * a2 - a1 * c2, a1 * b2 - b1 * a2
    inverse = _inverse_of(na * a0 + nb * b0 + nc * c0)
    return na * inverse, nb * inverse, nc * inverse


@njit
def plane_in_space(eye, vertices, vertex_count, packed, points, nearest, farthest):  # type: ignore[no-untyped-def]
    """`pinhole_plane` of a triangle, by its corners in space; nearest and farthest nearness that is seen of it, given
    those of its corners; and whether any is: it is not behind the eye, nor seen edge-on."""
    a = from_eye(eye, vertices, vertex_count, packed, 0)
    b = from_eye(eye, vertices, vertex_count, packed, 1)
    c = from_eye(eye, vertices, vertex_count, packed, 2)
    slope_x, slope_y, constant = pinhole_plane(doubles_at(eye.to_pixels), a, b, c)
    is_seen = True
    if nearest > NEAR_AND_FAR * farthest:
        is_seen = nearest >= 0.0 and not holds_eye(doubles_at(eye.position), a, b, c)
    if farthest < 0.0:
        nearest, farthest = np.inf, np.inf
        for corner in range(3):
            w = corner_at(points, packed, corner)[2]
            farthest = min(farthest, w if w > 0.0 else np.inf)
    return slope_x, slope_y, constant, nearest, farthest, is_seen


@njit
def parallel_plane(x0, y0, w0, x1, y1, w1, x2, y2, w2):  # type: ignore[no-untyped-def]
    """As `pinhole_plane`, by the pixel positions and nearness of the corners, where rays are parallel."""
    x1, y1, w1, x2, y2, w2 = x1 - x0, y1 - y0, w1 - w0, x2 - x0, y2 - y0, w2 - w0
    inverse = _inverse_of(x1 * y2 - y1 * x2)
    a, b = (w1 * y2 - w2 * y1) * inverse, (w2 * x1 - w1 * x2) * inverse
    return a, b, w0 - a * x0 - b * y0
