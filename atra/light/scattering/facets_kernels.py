"""Microfacets: GGX with Smith's masking, and the glass of a solid whose surface they make rough.

Source: B. Walter et al., "Microfacet models for refraction through rough surfaces", 2007; E. Heitz, "Understanding the
masking-shadowing function in microfacet-based BRDFs", 2014; J. Dupuy and A. Benyoub, "Sampling visible GGX normals with
spherical caps", 2023; E. Heitz et al., "Multiple-scattering microfacet BSDFs with the Smith model", 2016.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import HALF, ONE, TWO, ZERO, along, circle, dot, mixed, scaled, unit, unit_of

PER_PI = np.float32(1.0 / np.pi)

_MOST_FACETS = 32
"""A path that has not left by then is let go where it is: less than one of a million at any roughness."""

_STEPS = np.float32(1 << 24)


@njit(error_model="numpy")
def fresnel(cosine, ior):  # type: ignore[no-untyped-def]
    """Share of unpolarised light that a dielectric reflects; ior: of the far side over the near side."""
    inside = ior * ior - ONE + cosine * cosine
    if inside <= ZERO:
        return ONE
    far = np.sqrt(inside)
    across = (cosine - far) / (cosine + far)
    within = (ior * ior * cosine - far) / (ior * ior * cosine + far)
    return HALF * (across * across + within * within)


@njit(forceinline=True, error_model="numpy")
def slope(alpha, cosine):  # type: ignore[no-untyped-def]
    """sqrt(alpha^2 + (1 - alpha^2) cosine^2), of Smith's masking."""
    square = alpha * alpha
    return np.sqrt(square + (ONE - square) * cosine * cosine)


@njit(forceinline=True, error_model="numpy")
def ggx(alpha, h):  # type: ignore[no-untyped-def]
    """Density of microfacets' normals."""
    square = alpha * alpha
    spread = h[0] * h[0] + h[1] * h[1] + square * h[2] * h[2]
    return square * PER_PI / (spread * spread)


@njit(error_model="numpy")
def visible_normal(alpha, out, u, v):  # type: ignore[no-untyped-def]
    """A microfacet's normal, as often as `out` sees it."""
    x, y = circle(v)
    seen = unit((alpha * out[0], alpha * out[1], out[2]))
    height = (ONE - u) * (ONE + seen[2]) - seen[2]
    radius = np.sqrt(max(ZERO, ONE - height * height))
    return unit((alpha * (radius * x + seen[0]), alpha * (radius * y + seen[1]), height + seen[2]))


@njit(forceinline=True, error_model="numpy")
def _seen(alpha, cosine):  # type: ignore[no-untyped-def]
    """Smith's share of microfacets that are seen from a direction."""
    return TWO * cosine / (cosine + slope(alpha, cosine))


@njit(error_model="numpy")
def reflected(alpha, out, onward, h):  # type: ignore[no-untyped-def]
    """What white microfacets reflect once, times the cosine, per solid angle."""
    return HALF * ggx(alpha, h) * onward[2] / (onward[2] * slope(alpha, out[2]) + out[2] * slope(alpha, onward[2]))


@njit(error_model="numpy")
def glass_density(alpha, ior, out, onward):  # type: ignore[no-untyped-def]
    """Light of white rough glass that meets one microfacet, per solid angle: also how often `glass_direction` chooses
    it. A facet that is seen from both sides is taken to be seen from the side where fewer are, so that glass which
    hardly bends light is clear."""
    if onward[2] > ZERO:
        h = unit((out[0] + onward[0], out[1] + onward[1], out[2] + onward[2]))
        return fresnel(dot(out, h), ior) * reflected(alpha, out, onward, h)
    h = unit((out[0] + ior * onward[0], out[1] + ior * onward[1], out[2] + ior * onward[2]))
    h = h if h[2] > ZERO else scaled(-ONE, h)
    cosine, far = dot(out, h), dot(onward, h)
    if cosine <= ZERO or far >= ZERO or onward[2] == ZERO:
        return ZERO
    across = cosine + ior * far
    jacobian = ior * ior * -far / (across * across)
    seen = min(_seen(alpha, out[2]), _seen(alpha, -onward[2]))
    return (ONE - fresnel(cosine, ior)) * seen * ggx(alpha, h) * cosine / out[2] * jacobian


@njit(error_model="numpy")
def glass_direction(alpha, ior, out, u, v, chance):  # type: ignore[no-untyped-def]
    """(direction, is_single): where light goes on at rough glass, from facet to facet until it leaves, so that none is
    lost. is_single: it met one, as `glass_density` says; other ways have no density."""
    side, back, index = ONE, out, ior
    seed = mixed(np.uint32(u * _STEPS) ^ mixed(np.uint32(v * _STEPS)) ^ np.uint32(chance * _STEPS))
    onward = out
    for facet in range(_MOST_FACETS):
        h = visible_normal(alpha, back, u, v)
        cosine = min(ONE, dot(back, h))
        share = fresnel(cosine, index)
        was = back[2]
        if chance < share:
            chance /= share
            onward = along(scaled(-ONE, back), TWO * cosine, h)
        else:
            chance = (chance - share) / (ONE - share)
            ratio = ONE / index
            step = ratio * cosine - np.sqrt(max(ZERO, ONE - ratio * ratio * (ONE - cosine * cosine)))
            onward = along(scaled(-ratio, back), step, h)
            onward = onward[0], onward[1], -onward[2]  # up is towards the side where the light is
            side, index = -side, ratio
        leaves = ZERO
        if onward[2] > ZERO:
            leaves = _seen(alpha, onward[2])
            if facet == 0 and side > ZERO:  # masking and shadowing know of each other
                leaves = onward[2] * (was + slope(alpha, was))
                leaves /= onward[2] * slope(alpha, was) + was * slope(alpha, onward[2])
            elif facet == 0:
                leaves = min(ONE, leaves / _seen(alpha, was))
        if chance < leaves:
            return (onward[0], onward[1], side * onward[2]), facet == 0
        back = scaled(-ONE, onward)
        seed = mixed(seed)
        u = unit_of(seed)
        seed = mixed(seed)
        v = unit_of(seed)
        seed = mixed(seed)
        chance = unit_of(seed)
    return (onward[0], onward[1], side * abs(onward[2])), False
