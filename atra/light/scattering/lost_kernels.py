"""Light that meets a second microfacet: the share that a rough surface loses if it reflects once, as polynomials.

Source: C. Kulla and A. Conty, "Revisiting physically based shading at Imageworks", 2017, whose tables these polynomials
replace; they are fitted to integrals of GGX with Smith's height-correlated masking, within 0.01 (tests/light).
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import HALF, ONE, ZERO

_LOST = (
    (0.14276, 0.2779, 0.72185, 0.50058, -0.63134, -0.77962),
    (0.20246, 0.51219, 0.35401, 1.1428, 0.18624, -4.2392),
    (-0.38956, 1.4451, -1.2532, -4.5663, 2.6507, 5.2201),
    (-0.78668, 2.7685, 5.6038, -21.126, -15.197, 54.555),
    (-0.038107, -4.278, 8.1202, 10.725, -25.58, -14.363),
    (1.3109, -7.8629, -0.41301, 70.463, 10.837, -174.58),
)
"""Coefficients of (x - 1/2)^i (r - 1/2)^j; r: roughness, x = cosine (1 + r^2) / (cosine + r^2), which spreads what is
grazing."""

_MEAN = (0.11919, 0.70591, 0.95931, -0.74964, -0.55856, 1.2714, -1.9843)
"""Coefficients of (r - 1/2)^j: twice the integral of `lost` times the cosine."""

_LEAST_MEAN = np.float32(1e-3)


@njit(error_model="numpy")
def lost(alpha, cosine):  # type: ignore[no-untyped-def]
    """Share of light from a direction that meets more than one white microfacet. alpha: squared roughness."""
    r, x = np.sqrt(alpha) - HALF, cosine * (ONE + alpha) / (cosine + alpha) - HALF
    share = ZERO
    for i in range(6):
        row = ZERO
        for j in range(6):
            row = row * r + np.float32(_LOST[5 - i][5 - j])
        share = share * x + row
    return min(ONE, max(ZERO, share))


@njit
def lost_mean(alpha):  # type: ignore[no-untyped-def]
    """The mean of `lost` over all directions, weighted by their cosine; above 0."""
    r, share = np.sqrt(alpha) - HALF, ZERO
    for j in range(7):
        share = share * r + np.float32(_MEAN[6 - j])
    return max(_LEAST_MEAN, share)


@njit(error_model="numpy")
def kept_share(reflectance, mean):  # type: ignore[no-untyped-def]
    """What leaves of the light that meets more than one microfacet. reflectance: of a microfacet, the mean over
    directions. mean: `lost_mean`."""
    return reflectance * reflectance * (ONE - mean) / (ONE - reflectance * mean)
