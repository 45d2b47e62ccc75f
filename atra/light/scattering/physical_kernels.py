"""The metallic-roughness material of glTF: what it scatters, and directions chosen by it.

Vectors are in the frame of the shading normal, which is +z; `out` leads back along the path, on the side of +z.
What microfacets of metal and plastic do not reflect at once, they reflect later (`lost_kernels`); the base below
plastic gets what its surface lets through, both ways, so that nothing white gains or loses light.
Source: glTF 2.0, appendix B; C. Kelemen and L. Szirmay-Kalos, "A microfacet based coupled specular-matte BRDF model",
2001, for the base; `facets_kernels`.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, circle, dot, scaled, unit
from atra.light.scattering.facets_kernels import (
    PER_PI,
    fresnel,
    ggx,
    glass_density,
    glass_direction,
    reflected,
    slope,
    visible_normal,
)
from atra.light.scattering.lost_kernels import kept_share, lost, lost_mean, risen, risen_mean, schlick

SMOOTH = np.float32(1e-3)
"""Surfaces below this squared roughness are mirrors and clear glass."""

LEAST_BEND = 1e-3
"""A solid whose index of refraction is nearer to 1 lets light straight on, however rough it is."""

_LEAST_BEND = np.float32(LEAST_BEND)
_MEAN_RISE = np.float32(1.0 / 21.0)
"""Mean over directions of Schlick's rise, weighted by the cosine."""

_NONE = ZERO, ZERO, ZERO


@njit(forceinline=True)
def luminance(colour):  # type: ignore[no-untyped-def]
    return np.float32(0.2126) * colour[0] + np.float32(0.7152) * colour[1] + np.float32(0.0722) * colour[2]


@njit(forceinline=True)
def _times(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@njit(forceinline=True)
def _bends_nothing(matter):  # type: ignore[no-untyped-def]
    return not matter.is_thin and abs(matter.ior - ONE) < _LEAST_BEND


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
    if matter.is_thin:
        own = _own(matter, schlick(cosine))
    else:
        own = scaled(fresnel(cosine, max(matter.ior, ONE / matter.ior)), (ONE, ONE, ONE))
    return scaled((ONE - matter.metallic) * matter.transmission, _times(_rest(own), matter.colour))


@njit(forceinline=True)
def _glass_share(matter):  # type: ignore[no-untyped-def]
    """How much of the surface is that of a transparent solid; the rest is metal, plastic and panes."""
    return ZERO if matter.is_thin else (ONE - matter.metallic) * matter.transmission


@njit(forceinline=True)
def _shares(matter):  # type: ignore[no-untyped-def]
    """(plastic and panes, bases below them, passing panes) of the surface."""
    dielectric = ONE - matter.metallic - _glass_share(matter)
    passing = dielectric * matter.transmission if matter.is_thin else ZERO
    return dielectric, dielectric - passing, passing


@njit(forceinline=True)
def _rest(colour):  # type: ignore[no-untyped-def]
    return ONE - colour[0], ONE - colour[1], ONE - colour[2]


@njit(forceinline=True)
def _rising(least, rise):  # type: ignore[no-untyped-def]
    """What is reflected of a colour that is `least` at a right angle and white where it is grazing."""
    return along(least, rise, _rest(least))


@njit(forceinline=True)
def _own(matter, rise):  # type: ignore[no-untyped-def]
    """(r, g, b) that a microfacet of plastic reflects."""
    least, most = matter.least, matter.most
    return least[0] + rise * (most - least[0]), least[1] + rise * (most - least[1]), least[2] + rise * (most - least[2])


@njit(error_model="numpy")
def _mirrored(matter, cosine):  # type: ignore[no-untyped-def]
    """((r, g, b), (r, g, b)): reflected by metal and plastic, by their shares, and by plastic alone, at a cosine with a
    microfacet's normal."""
    rise = schlick(cosine)
    own = _own(matter, rise)
    return along(scaled(_shares(matter)[0], own), matter.metallic, _rising(matter.colour, rise)), own


@njit(error_model="numpy")
def _again(full, mean):  # type: ignore[no-untyped-def]
    """(r, g, b) that is left of light that meets more than one microfacet. full: (r, g, b) that one reflects, the mean
    over directions. mean: `lost_mean`."""
    return kept_share(full[0], mean), kept_share(full[1], mean), kept_share(full[2], mean)


@njit(error_model="numpy")
def _let_through(matter, once, rise, more):  # type: ignore[no-untyped-def]
    """(r, g, b) that the surface of plastic lets through. once: share that meets one microfacet; rise: of it, by
    Schlick; more: (r, g, b), reflected later."""
    least, grazing = matter.least, matter.most * rise
    return (
        max(ZERO, ONE - least[0] * (once - rise) - grazing - more[0]),
        max(ZERO, ONE - least[1] * (once - rise) - grazing - more[1]),
        max(ZERO, ONE - least[2] * (once - rise) - grazing - more[2]),
    )


@njit(error_model="numpy")
def _through(matter, cosine):  # type: ignore[no-untyped-def]
    """`_let_through` at a cosine with the normal."""
    alpha = matter.alpha
    if alpha < SMOOTH:
        return _let_through(matter, ONE, schlick(cosine), _NONE)
    away, later = lost(alpha, cosine), _again(_own(matter, _MEAN_RISE), lost_mean(alpha))
    return _let_through(matter, ONE - away, risen(alpha, cosine), scaled(away, later))


@njit(error_model="numpy")
def _through_mean(matter):  # type: ignore[no-untyped-def]
    """The mean of `_through` over all directions, weighted by their cosine."""
    alpha = matter.alpha
    if alpha < SMOOTH:
        return _let_through(matter, ONE, _MEAN_RISE, _NONE)
    away = lost_mean(alpha)
    later = scaled(away, _again(_own(matter, _MEAN_RISE), away))
    return _let_through(matter, ONE - away, risen_mean(alpha), later)


@njit(error_model="numpy")
def _later(matter):  # type: ignore[no-untyped-def]
    """((r, g, b), (r, g, b)): light that meets more than one microfacet and is reflected, or passes a pane."""
    dielectric, _, passing = _shares(matter)
    mean = lost_mean(matter.alpha)
    own = _again(_own(matter, _MEAN_RISE), mean)
    metal = _again(_rising(matter.colour, _MEAN_RISE), mean)
    above = along(scaled(dielectric, own), matter.metallic, metal)
    return above, scaled(passing, _times(_rest(own), matter.colour))


@njit(error_model="numpy")
def _chances(matter, cosine):  # type: ignore[no-untyped-def]
    """(to be mirrored, to pass), among microfacets' light at a cosine with their normal; they add up to 1."""
    mirrored, own = _mirrored(matter, cosine)
    passing = ZERO if is_clear_pane(matter) else _shares(matter)[2]
    most, through = luminance(mirrored), passing * luminance(_times(_rest(own), matter.colour))
    total = most + through
    return (most / total, through / total) if total > ZERO else (ONE, ZERO)


@njit(error_model="numpy")
def _diffuse_chances(matter, cosine):  # type: ignore[no-untyped-def]
    """How often a direction above, and one below, is chosen by its cosine: for the base, and for light that meets
    several microfacets."""
    _, base, passing = _shares(matter)
    up, down = base * luminance(_times(_through(matter, cosine), matter.colour)), ZERO
    mirrored, own = _mirrored(matter, cosine)
    total = luminance(mirrored)
    if matter.alpha >= SMOOTH:
        above, below = _later(matter)
        away = lost(matter.alpha, cosine)
        up, down = up + away * luminance(above), away * luminance(below)
    if not is_clear_pane(matter):
        total += passing * luminance(_times(_rest(own), matter.colour))
    total += up + down
    return (up / total, down / total) if total > ZERO else (ZERO, ZERO)


@njit(error_model="numpy")
def physical_value(matter, out, onward):  # type: ignore[no-untyped-def]
    """((r, g, b), density): scattered light times the cosine, per solid angle, and how often `physical_direction`
    chooses the direction. Mirrors and clear glass are left out: no direction that is aimed meets theirs; so is light
    that meets several microfacets of solid glass."""
    alpha, glass = matter.alpha, _glass_share(matter)
    value, density = _NONE, ZERO
    if glass < ONE and onward[2] != ZERO:
        value, density = _opaque_value(matter, out, onward)
    density *= ONE - glass
    if glass > ZERO and not passes_straight(matter):
        own = glass * glass_density(alpha, matter.ior, out, onward)
        tint = matter.colour if onward[2] < ZERO else (ONE, ONE, ONE)
        value, density = along(value, own, tint), density + own
    return value, density


@njit(error_model="numpy")
def _opaque_value(matter, out, onward):  # type: ignore[no-untyped-def]
    """`physical_value` of metal, plastic and panes."""
    up, down = _diffuse_chances(matter, out[2])
    alpha, is_smooth = matter.alpha, matter.alpha < SMOOTH
    height = abs(onward[2])
    spread = height * PER_PI
    value, several = _NONE, ZERO
    if not is_smooth:
        several = lost(alpha, out[2]) * lost(alpha, height) / lost_mean(alpha) * spread
    if onward[2] > ZERO:
        light = _times(_through(matter, out[2]), _through(matter, height))
        mean, base = _through_mean(matter), scaled(_shares(matter)[1] * spread, matter.colour)
        if mean[0] > ZERO and mean[1] > ZERO and mean[2] > ZERO:
            value = base[0] * light[0] / mean[0], base[1] * light[1] / mean[1], base[2] * light[2] / mean[2]
    elif is_smooth or not matter.is_thin or matter.transmission == ZERO:
        return _NONE, ZERO
    density = (up if onward[2] > ZERO else down) * spread
    if is_smooth:
        return value, density
    twin = onward[0], onward[1], height  # what passes a pane is what it mirrors, on the other side
    h = unit((out[0] + twin[0], out[1] + twin[1], out[2] + twin[2]))
    cosine = dot(out, h)
    once = reflected(alpha, out, twin, h)
    chosen = (ONE - up - down) * ggx(alpha, h) / (TWO * (out[2] + slope(alpha, out[2])))
    mirrored, own = _mirrored(matter, cosine)
    above, below = _later(matter)
    if onward[2] > ZERO:
        return along(along(value, once, mirrored), several, above), density + chosen * _chances(matter, cosine)[0]
    through = scaled(_shares(matter)[2] * once, _times(_rest(own), matter.colour))
    return along(through, several, below), density + chosen * _chances(matter, cosine)[1]


@njit(error_model="numpy")
def physical_direction(matter, out, u, v, lobe):  # type: ignore[no-untyped-def]
    """(direction, (r, g, b), density): a direction chosen by three numbers in [0, 1), the light it carries over how
    often it is chosen, and its density per solid angle; 0 where nothing is aimed. No light where it is absorbed."""
    glass, alpha = _glass_share(matter), matter.alpha
    is_smooth = alpha < SMOOTH
    if lobe < glass:
        lobe /= glass
        if not passes_straight(matter):
            onward, is_single = glass_direction(alpha, matter.ior, out, u, v, lobe)
            if not is_single:
                return onward, matter.colour if onward[2] < ZERO else (ONE, ONE, ONE), ZERO
        else:
            cosine = out[2]
            ratio = ONE if _bends_nothing(matter) else ONE / matter.ior
            if not _bends_nothing(matter) and lobe < fresnel(cosine, matter.ior):
                return (-out[0], -out[1], cosine), (ONE, ONE, ONE), ZERO
            far = np.sqrt(max(ZERO, ONE - ratio * ratio * (ONE - cosine * cosine)))
            return (-ratio * out[0], -ratio * out[1], -far), matter.colour, ZERO
    else:
        lobe = (lobe - glass) / (ONE - glass)
        up, down = _diffuse_chances(matter, out[2])
        if lobe < up + down:
            x, y = circle(v)
            radius, height = np.sqrt(u), np.sqrt(max(ZERO, ONE - u))
            onward = radius * x, radius * y, height if lobe < up else -height
        else:
            lobe = (lobe - up - down) / (ONE - up - down)
            h = (ZERO, ZERO, ONE) if is_smooth else visible_normal(alpha, out, u, v)
            cosine = min(ONE, dot(out, h))
            by_mirror, _ = _chances(matter, cosine)
            is_mirrored = lobe < by_mirror
            onward = along(scaled(-ONE, out), TWO * cosine, h)
            if is_smooth:
                factor = ONE / ((ONE - glass) * (ONE - up - down) * by_mirror)
                return onward, scaled(factor, _mirrored(matter, cosine)[0]), ZERO
            if not onward[2] > ZERO:
                return onward, _NONE, ZERO
            onward = onward if is_mirrored else (onward[0], onward[1], -onward[2])
    value, density = physical_value(matter, out, onward)
    if not density > ZERO:
        return onward, _NONE, ZERO
    return onward, scaled(ONE / density, value), density
