"""The sky: its light from a direction, directions chosen by its light, and how often they are chosen. And spherical
harmonics up to L2: light from all around a point, and what a surface there reflects of it.

A panorama is interpolated bilinearly between the middles of its texels; at the poles, its last row goes on. Directions
are chosen by a texel and, around its middle, by the weight that it has there, so that the density is interpolated as
the light is.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import HALF, ONE, ZERO
from atra.light.surface_kernels import GRADIENT, SKY_TURN

_POLE = 1e-4
"""Least sine of the angle to a pole that a density is divided by."""


@njit(forceinline=True)
def _around(rows, columns, direction, turn):  # type: ignore[no-untyped-def]
    """(y0, y1, x0, x1, down, across): the four texels around where a unit vector points to on a panorama, and the
    weights of those below and to the right."""
    height = max(-1.0, min(1.0, np.float64(direction[1])))
    s = 0.5 + turn + np.arctan2(np.float64(direction[0]), -np.float64(direction[2])) / (2.0 * np.pi)
    y, x = np.arccos(height) / np.pi * rows - 0.5, s * columns - 0.5
    above, left = np.floor(y), np.floor(x)
    y0, y1 = max(np.int64(above), 0), min(np.int64(above) + 1, rows - 1)
    x0, x1 = np.int64(left) % columns, (np.int64(left) + 1) % columns
    return y0, y1, x0, x1, np.float32(y - above), np.float32(x - left)


@njit(forceinline=True)
def _between(a, b, c, d, down, across):  # type: ignore[no-untyped-def]
    return (ONE - down) * ((ONE - across) * a + across * b) + down * ((ONE - across) * c + across * d)


@njit
def sky_colour(surfaces, direction):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of the sky in a direction, a unit vector."""
    sky = surfaces.sky
    if sky[0] == GRADIENT:
        above = HALF * (direction[1] + ONE)
        below = ONE - above
        return (below * sky[1] + above * sky[4], below * sky[2] + above * sky[5], below * sky[3] + above * sky[6])
    texels = surfaces.panorama
    y0, y1, x0, x1, down, across = _around(texels.shape[0], texels.shape[1], direction, sky[SKY_TURN])
    a, b, c, d = texels[y0, x0], texels[y0, x1], texels[y1, x0], texels[y1, x1]
    return (
        _between(a[0], b[0], c[0], d[0], down, across),
        _between(a[1], b[1], c[1], d[1], down, across),
        _between(a[2], b[2], c[2], d[2], down, across),
    )


@njit
def sky_density(densities, direction, turn):  # type: ignore[no-untyped-def]
    """How often a direction is chosen by the light of a panorama, per solid angle. densities: of `Emitters`."""
    rows, columns = densities.shape
    y0, y1, x0, x1, down, across = _around(rows, columns, direction, turn)
    chosen = _between(densities[y0, x0], densities[y0, x1], densities[y1, x0], densities[y1, x1], down, across)
    level = np.sqrt(np.float64(direction[0]) * direction[0] + np.float64(direction[2]) * direction[2])
    return np.float32(chosen / max(level, _POLE))


@njit(forceinline=True)
def sky_direction(rows, columns, texel, u, v, turn):  # type: ignore[no-untyped-def]
    """A unit vector to a place around the middle of a texel of a panorama, by two numbers in [0, 1)."""
    y, x = divmod(texel, columns)
    t, s = (y + 0.5 + _tent(v)) / rows, (x + 0.5 + _tent(u)) / columns
    t = abs(t) if t < 1.0 else 2.0 - t
    around, across = 2.0 * np.pi * (s - 0.5 - turn), np.sin(np.pi * t)
    return np.float32(across * np.sin(around)), np.float32(np.cos(np.pi * t)), np.float32(-across * np.cos(around))


@njit(forceinline=True)
def _tent(number):  # type: ignore[no-untyped-def]
    """A number in [0, 1) -> one in [-1, 1], the likelier the nearer to 0: its density is 1 less its distance."""
    twice = 2.0 * np.float64(number)
    return np.sqrt(twice) - 1.0 if twice < 1.0 else 1.0 - np.sqrt(2.0 - twice)


HARMONICS = 9
"""Spherical harmonics up to L2."""

OF_COSINE = np.array([1.0, *[2 / 3] * 3, *[1 / 4] * 5])
"""Factors of harmonics in the light on a surface, over pi. Source: as of `harmonics`."""


def harmonics(x, y, z):  # type: ignore[no-untyped-def]
    """The nine real spherical harmonics up to L2 of unit vectors, float64, ordered by l and then m.

    Source: R. Ramamoorthi and P. Hanrahan, "An efficient representation for irradiance environment maps", 2001.
    """
    return (
        0.28209479177387814 + 0.0 * x,
        0.4886025119029199 * y,
        0.4886025119029199 * z,
        0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        1.0925484305920792 * y * z,
        0.31539156525252005 * (3.0 * z * z - 1.0),
        1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y),
    )


harmonics_at = njit(harmonics)


@njit
def reflected(coefficients, normal):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 that a white surface of this normal reflects. coefficients: (9, 3) float32, times OF_COSINE."""
    weights = harmonics_at(np.float64(normal[0]), np.float64(normal[1]), np.float64(normal[2]))
    red = green = blue = 0.0
    for one in range(HARMONICS):
        red += weights[one] * coefficients[one, 0]
        green += weights[one] * coefficients[one, 1]
        blue += weights[one] * coefficients[one, 2]
    return max(ZERO, np.float32(red)), max(ZERO, np.float32(green)), max(ZERO, np.float32(blue))
