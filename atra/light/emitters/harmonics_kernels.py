"""Spherical harmonics up to L2: light from all around a point, and what a surface there reflects of it."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ZERO

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
