"""What rough surfaces reflect in all directions together, as polynomials: light that a second microfacet meets, and the
share that Fresnel's rise towards grazing angles adds.

Source: C. Kulla and A. Conty, "Revisiting physically based shading at Imageworks", 2017, whose tables these polynomials
replace. They are fitted to integrals of GGX with Smith's height-correlated masking, within 0.013 (tests/light), from
the side on which no light is added. x = cosine (1 + alpha) / (cosine + alpha) spreads what is grazing.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import HALF, ONE, ZERO

_LOST = (
    (0.14121, 0.27933, 0.70636, 0.34093, -0.65987),
    (0.18235, 0.60305, 0.53734, -0.15769, -0.84294),
    (-0.48718, 1.6527, -1.4088, -4.9359, 6.0541),
    (-0.41639, 0.95672, 3.3134, -0.068579, -5.7847),
    (0.38877, -5.9225, 11.554, 13.475, -42.885),
)
"""Coefficients of (x - 1/2)^i (r - 1/2)^j; r: roughness."""

_RISEN_AT_RIMS = (
    (3.5313, -8.1631, 4.0978),
    (-7.2035, 14.82, -4.0948),
    (7.9875, -8.5866, -8.6059),
    (-3.3393, 2.7625, 5.5362),
)
_RISEN = ((1.0043, -3.0031, 3.4135, -1.3583), (-1.9797, 5.4585, -5.7167, 2.2188), (0.97353, -2.3762, 2.1783, -0.81237))
"""Coefficients of x^i r^j; the former are multiplied by x (1 - cosine)^5."""

_LOST_MEAN = (0.95681, 0.22708, -5.8643, 8.5148, 15.248, -45.553, 25.017)
_RISEN_MEAN = (0.025414, -0.076315, 0.10465, 0.12068, -0.40066, 0.20904)
"""Coefficients of (r - 1/2)^j: twice the integral of `lost`, over r^3, and of `risen`, times the cosine."""

_LEAST_MEAN = np.float32(1e-4)


@njit(forceinline=True)
def schlick(cosine):  # type: ignore[no-untyped-def]
    """Schlick's rise of what is reflected towards grazing angles."""
    rest = max(ZERO, ONE - cosine)
    square = rest * rest
    return square * square * rest


@njit(error_model="numpy")
def lost(alpha, cosine):  # type: ignore[no-untyped-def]
    """Share of light from a direction that meets more than one white microfacet. alpha: squared roughness."""
    return _within(_polynomial(_LOST, cosine * (ONE + alpha) / (cosine + alpha) - HALF, np.sqrt(alpha) - HALF))


@njit(error_model="numpy")
def risen(alpha, cosine):  # type: ignore[no-untyped-def]
    """Share of light from a direction that microfacets reflect once, if each reflects `schlick`."""
    r, x = np.sqrt(alpha), cosine * (ONE + alpha) / (cosine + alpha)
    return _within(x * schlick(cosine) * _polynomial(_RISEN_AT_RIMS, x, r) + _polynomial(_RISEN, x, r))


@njit
def lost_mean(alpha):  # type: ignore[no-untyped-def]
    """The mean of `lost` over all directions, weighted by their cosine; above 0."""
    r = np.sqrt(alpha)
    return max(_LEAST_MEAN, r * alpha * _row(_LOST_MEAN, r - HALF))


@njit
def risen_mean(alpha):  # type: ignore[no-untyped-def]
    """As `lost_mean`, of `risen`."""
    return _row(_RISEN_MEAN, np.sqrt(alpha) - HALF)


@njit(error_model="numpy")
def kept_share(reflectance, mean):  # type: ignore[no-untyped-def]
    """What leaves of the light that meets more than one microfacet. reflectance: of a microfacet, the mean over
    directions. mean: `lost_mean`."""
    return reflectance * reflectance * (ONE - mean) / (ONE - reflectance * mean)


@njit(forceinline=True)
def _within(share):  # type: ignore[no-untyped-def]
    return min(ONE, max(ZERO, share))


@njit(forceinline=True)
def _row(coefficients, r):  # type: ignore[no-untyped-def]
    found = ZERO
    for j in range(len(coefficients)):
        found = found * r + np.float32(coefficients[len(coefficients) - 1 - j])
    return found


@njit(forceinline=True)
def _polynomial(coefficients, x, r):  # type: ignore[no-untyped-def]
    found = ZERO
    for i in range(len(coefficients)):
        found = found * x + _row(coefficients[len(coefficients) - 1 - i], r)
    return found
