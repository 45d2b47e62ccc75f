"""The metallic-roughness material of glTF, and rough glass: what they scatter, and directions chosen by it.

Vectors are in the frame of the shading normal, which is +z; `out` leads back along the path, on the side of +z.
Source: glTF 2.0, appendix B; B. Walter et al., "Microfacet models for refraction through rough surfaces", 2007;
E. Heitz, "Understanding the masking-shadowing function in microfacet-based BRDFs", 2014; J. Dupuy and A. Benyoub,
"Sampling visible GGX normals with spherical caps", 2023. Light that meets several microfacets: `lost_kernels`.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import HALF, ONE, TWO, ZERO, along, circle, dot, scaled, unit
from atra.light.scattering.lost_kernels import kept_share, lost, lost_mean

SMOOTH = np.float32(1e-3)
"""Surfaces below this squared roughness are mirrors and clear glass."""

LEAST_BEND = 1e-3
"""A solid whose index of refraction is nearer to 1 lets light straight on, however rough it is."""

_LEAST_BEND = np.float32(LEAST_BEND)
_PER_PI = np.float32(1.0 / np.pi)
_MEAN_RISE = np.float32(1.0 / 21.0)
"""Mean over directions of Schlick's rise, weighted by the cosine."""

_NONE = ZERO, ZERO, ZERO


@njit(forceinline=True)
def luminance(colour):  # type: ignore[no-untyped-def]
    return np.float32(0.2126) * colour[0] + np.float32(0.7152) * colour[1] + np.float32(0.0722) * colour[2]


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


@njit(forceinline=True)
def _schlick(cosine):  # type: ignore[no-untyped-def]
    rest = max(ZERO, ONE - cosine)
    square = rest * rest
    return square * square * rest


@njit(forceinline=True)
def _bends_nothing(matter):  # type: ignore[no-untyped-def]
    return not matter.is_thin and abs(matter.ior - ONE) < _LEAST_BEND


@njit(error_model="numpy")
def _shares(matter, cosine):  # type: ignore[no-untyped-def]
    """(mirrored (r, g, b), dielectric share that is mirrored, by Fresnel) at a cosine with a microfacet's normal."""
    ior = matter.ior
    bare = (ior - ONE) / (ior + ONE)
    bare *= bare
    rise = _schlick(cosine)
    is_solid = matter.transmission > ZERO and not matter.is_thin
    own = bare + (ONE - bare) * rise
    if is_solid:
        own = ZERO if _bends_nothing(matter) else fresnel(cosine, ior)
    metal, base = matter.metallic, matter.colour
    return (
        own + metal * (base[0] + (ONE - base[0]) * rise - own),
        own + metal * (base[1] + (ONE - base[1]) * rise - own),
        own + metal * (base[2] + (ONE - base[2]) * rise - own),
    ), own


@njit(forceinline=True)
def is_clear_pane(matter):  # type: ignore[no-untyped-def]
    """Whether light passes straight on, as `clear_light` says, and is not scattered to the other side."""
    return matter.is_thin and matter.alpha < SMOOTH


@njit(forceinline=True)
def passes_straight(matter):  # type: ignore[no-untyped-def]
    """Whether what passes is not spread: smooth, or a solid that bends no light."""
    return matter.alpha < SMOOTH or _bends_nothing(matter)


@njit(error_model="numpy")
def clear_light(matter, cosine):  # type: ignore[no-untyped-def]
    """(r, g, b) that passes a clear surface straight on, at a cosine with its normal; on both sides of solid glass that
    of the outside, as for a slab."""
    own = _shares(matter, cosine)[1] if matter.is_thin else fresnel(cosine, max(matter.ior, ONE / matter.ior))
    return scaled((ONE - matter.metallic) * matter.transmission * (ONE - own), matter.colour)


@njit(error_model="numpy")
def _chances(matter, cosine):  # type: ignore[no-untyped-def]
    """(to be mirrored, to pass), among microfacets' light at a cosine with their normal; they add up to 1."""
    mirrored, own = _shares(matter, cosine)
    through = (ONE - matter.metallic) * matter.transmission * (ONE - own) * luminance(matter.colour)
    through = ZERO if is_clear_pane(matter) else through
    most = luminance(mirrored)
    total = most + through
    return (most / total, through / total) if total > ZERO else (ONE, ZERO)


@njit(error_model="numpy")
def _again(matter, mean):  # type: ignore[no-untyped-def]
    """(r, g, b) that is left of light that meets more than one microfacet. mean: `lost_mean`.

    What a dielectric does not reflect then, its base does; the diffuse part has the rise of its Fresnel term already.
    """
    metal, base = matter.metallic, matter.colour
    bare = (matter.ior - ONE) / (matter.ior + ONE)
    bare *= bare
    own = kept_share(bare, mean)
    solid = (ONE - metal) * (ONE - matter.transmission)
    return (
        solid * (own + (bare - own) * base[0]) + metal * kept_share(base[0] + (ONE - base[0]) * _MEAN_RISE, mean),
        solid * (own + (bare - own) * base[1]) + metal * kept_share(base[1] + (ONE - base[1]) * _MEAN_RISE, mean),
        solid * (own + (bare - own) * base[2]) + metal * kept_share(base[2] + (ONE - base[2]) * _MEAN_RISE, mean),
    )


@njit(error_model="numpy")
def _diffuse_chance(matter, cosine):  # type: ignore[no-untyped-def]
    """How often a direction is chosen by its cosine: for the diffuse part, and light that meets several microfacets."""
    mirrored, own = _shares(matter, cosine)
    base = (ONE - matter.metallic) * (ONE - own) * luminance(matter.colour)
    diffuse = base * (ONE - matter.transmission)
    if matter.alpha >= SMOOTH:
        diffuse += luminance(_again(matter, lost_mean(matter.alpha))) * lost(matter.alpha, cosine)
    total = diffuse + luminance(mirrored) + (ZERO if is_clear_pane(matter) else base * matter.transmission)
    return diffuse / total if total > ZERO else ZERO


@njit(forceinline=True, error_model="numpy")
def _slope(alpha, cosine):  # type: ignore[no-untyped-def]
    """sqrt(alpha^2 + (1 - alpha^2) cosine^2), of Smith's masking."""
    square = alpha * alpha
    return np.sqrt(square + (ONE - square) * cosine * cosine)


@njit(forceinline=True, error_model="numpy")
def _ggx(alpha, h):  # type: ignore[no-untyped-def]
    """Density of microfacets' normals."""
    square = alpha * alpha
    spread = h[0] * h[0] + h[1] * h[1] + square * h[2] * h[2]
    return square * _PER_PI / (spread * spread)


@njit(error_model="numpy")
def physical_value(matter, out, onward):  # type: ignore[no-untyped-def]
    """((r, g, b), density): scattered light times the cosine, per solid angle, and how often `physical_direction`
    chooses the direction. Mirrors and clear glass are left out: no direction that is aimed meets theirs."""
    by_diffuse = _diffuse_chance(matter, out[2])
    alpha, is_smooth = matter.alpha, matter.alpha < SMOOTH
    base = scaled(ONE - matter.metallic, matter.colour)
    if onward[2] > ZERO:
        h = unit((out[0] + onward[0], out[1] + onward[1], out[2] + onward[2]))
        cosine = dot(out, h)
        mirrored, own = _shares(matter, cosine)
        flat = (ONE - own) * (ONE - matter.transmission) * onward[2] * _PER_PI
        value, density = scaled(flat, base), by_diffuse * onward[2] * _PER_PI
        if is_smooth:
            return value, density
        facets = _ggx(alpha, h)
        one, other = _slope(alpha, out[2]), _slope(alpha, onward[2])
        factor = HALF * facets * onward[2] / (onward[2] * one + out[2] * other)
        density += (ONE - by_diffuse) * _chances(matter, cosine)[0] * HALF * facets / (out[2] + one)
        mean = lost_mean(alpha)
        several = lost(alpha, out[2]) * lost(alpha, onward[2]) / mean * onward[2] * _PER_PI
        return along(along(value, factor, mirrored), several, _again(matter, mean)), density
    if passes_straight(matter) or matter.transmission == ZERO or onward[2] == ZERO:
        return _NONE, ZERO
    below = -onward[2]
    one, other = _slope(alpha, out[2]), _slope(alpha, below)
    visible = TWO * out[2] / (out[2] + one)
    if matter.is_thin:
        h = unit((out[0] + onward[0], out[1] + onward[1], out[2] + below))
        cosine = dot(out, h)
        jacobian = ONE / (np.float32(4.0) * cosine)
        masking = TWO * out[2] * below / (below * one + out[2] * other) / visible
    else:
        ior = matter.ior
        h = unit((out[0] + ior * onward[0], out[1] + ior * onward[1], out[2] + ior * onward[2]))
        h = h if h[2] > ZERO else scaled(-ONE, h)
        cosine, far = dot(out, h), dot(onward, h)
        if cosine <= ZERO or far >= ZERO:
            return _NONE, ZERO
        across = cosine + ior * far
        jacobian = ior * ior * -far / (across * across)
        masking = TWO * below / (below + other)
    chosen = visible * _ggx(alpha, h) * cosine / out[2] * jacobian
    own = _shares(matter, cosine)[1]
    factor = matter.transmission * (ONE - own) * masking * chosen
    return scaled(factor, base), (ONE - by_diffuse) * _chances(matter, cosine)[1] * chosen


@njit(error_model="numpy")
def physical_direction(matter, out, u, v, lobe):  # type: ignore[no-untyped-def]
    """(direction, (r, g, b), density): a direction chosen by three numbers in [0, 1), the light it carries over how
    often it is chosen, and its density per solid angle; 0 for mirrors and clear glass. No light where it is absorbed.
    """
    by_diffuse = _diffuse_chance(matter, out[2])
    is_smooth = matter.alpha < SMOOTH
    x, y = circle(v)
    if lobe < by_diffuse:
        radius = np.sqrt(u)
        onward = radius * x, radius * y, np.sqrt(max(ZERO, ONE - u))
    else:
        lobe = (lobe - by_diffuse) / (ONE - by_diffuse)
        h = (ZERO, ZERO, ONE) if is_smooth else _visible_normal(matter.alpha, out, u, x, y)
        cosine = min(ONE, dot(out, h))
        by_mirror, by_passing = _chances(matter, cosine)
        is_mirrored = lobe < by_mirror
        if is_mirrored:
            onward = TWO * cosine * h[0] - out[0], TWO * cosine * h[1] - out[1], TWO * cosine * h[2] - out[2]
        elif matter.is_thin:
            onward = TWO * cosine * h[0] - out[0], TWO * cosine * h[1] - out[1], -(TWO * cosine * h[2] - out[2])
        else:
            ratio = ONE if _bends_nothing(matter) else ONE / matter.ior
            step = ratio * cosine - np.sqrt(max(ZERO, ONE - ratio * ratio * (ONE - cosine * cosine)))
            onward = along(scaled(-ratio, out), step, h)
        if is_smooth or (not is_mirrored and passes_straight(matter)):
            mirrored, own = _shares(matter, cosine)
            if is_mirrored:
                return onward, scaled(ONE / ((ONE - by_diffuse) * by_mirror), mirrored), ZERO
            factor = (ONE - matter.metallic) * matter.transmission * (ONE - own) / ((ONE - by_diffuse) * by_passing)
            return onward, scaled(factor, matter.colour), ZERO
        if is_mirrored != (onward[2] > ZERO):
            return onward, _NONE, ZERO
    value, density = physical_value(matter, out, onward)
    if not density > ZERO:
        return onward, _NONE, ZERO
    return onward, scaled(ONE / density, value), density


@njit(error_model="numpy")
def _visible_normal(alpha, out, u, x, y):  # type: ignore[no-untyped-def]
    """A microfacet's normal, as often as `out` sees it."""
    seen = unit((alpha * out[0], alpha * out[1], out[2]))
    height = (ONE - u) * (ONE + seen[2]) - seen[2]
    radius = np.sqrt(max(ZERO, ONE - height * height))
    return unit((alpha * (radius * x + seen[0]), alpha * (radius * y + seen[1]), height + seen[2]))
