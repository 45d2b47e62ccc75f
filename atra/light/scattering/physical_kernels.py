"""The metallic-roughness material of glTF: what it scatters, and directions chosen by it.

Vectors are in the frame of the shading normal, which is +z; `Seen.out` leads back along the path, on the side of +z.
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
from atra.light.scattering.lost_kernels import lost
from atra.light.scattering.seen_kernels import (
    NO_LIGHT,
    SMOOTH,
    bends_nothing,
    facet_chances,
    glass_share,
    let_through,
    mirrored_by,
    passes_straight,
    rest_of,
    shares_of,
    times,
)


@njit(error_model="numpy")
def physical_value(matter, seen, onward):  # type: ignore[no-untyped-def]
    """((r, g, b), density): scattered light times the cosine, per solid angle, and how often `physical_direction`
    chooses the direction. Mirrors and clear glass are left out: no direction that is aimed meets theirs; so is light
    that meets several microfacets of solid glass."""
    glass, value, density = glass_share(matter), NO_LIGHT, ZERO
    if glass < ONE and onward[2] != ZERO:
        value, density = _opaque_value(matter, seen, onward)
    density *= ONE - glass
    if glass > ZERO and not passes_straight(matter):
        own = glass * glass_density(matter.alpha, matter.ior, seen.out, onward)
        tint = matter.colour if onward[2] < ZERO else (ONE, ONE, ONE)
        value, density = along(value, own, tint), density + own
    return value, density


@njit(forceinline=True, error_model="numpy")
def _opaque_value(matter, seen, onward):  # type: ignore[no-untyped-def]
    """`physical_value` of metal, plastic and panes."""
    out, up, down = seen.out, seen.up, seen.down
    alpha, is_smooth = matter.alpha, matter.alpha < SMOOTH
    height = abs(onward[2])
    spread = height * PER_PI
    value, several, away, passing = NO_LIGHT, ZERO, ONE, shares_of(matter)[2]
    if onward[2] < ZERO and (is_smooth or passing == ZERO):
        return NO_LIGHT, ZERO
    if not is_smooth:
        away = lost(alpha, height)
        several = seen.away * away / seen.mean * spread
    base, mean = shares_of(matter)[1], seen.through_mean
    if onward[2] > ZERO and base > ZERO and mean[0] > ZERO and mean[1] > ZERO and mean[2] > ZERO:
        light = times(seen.through, let_through(matter, height, away, seen.again))
        flat = scaled(base * spread, matter.colour)
        value = flat[0] * light[0] / mean[0], flat[1] * light[1] / mean[1], flat[2] * light[2] / mean[2]
    density = (up if onward[2] > ZERO else down) * spread
    if is_smooth:
        return value, density
    twin = onward[0], onward[1], height  # what passes a pane is what it mirrors, on the other side
    h = unit((out[0] + twin[0], out[1] + twin[1], out[2] + twin[2]))
    cosine = dot(out, h)
    once = reflected(alpha, out, twin, h)
    chosen = (ONE - up - down) * ggx(alpha, h) / (TWO * (out[2] + slope(alpha, out[2])))
    mirrored, own = mirrored_by(matter, cosine)
    by_mirror, by_passing = facet_chances(matter, mirrored, own)
    if onward[2] > ZERO:
        return along(along(value, once, mirrored), several, seen.above), density + chosen * by_mirror
    through = scaled(passing * once, times(rest_of(own), matter.colour))
    return along(through, several, seen.below), density + chosen * by_passing


@njit(error_model="numpy")
def physical_direction(matter, seen, u, v, lobe):  # type: ignore[no-untyped-def]
    """(direction, (r, g, b), density): a direction chosen by three numbers in [0, 1), the light it carries over how
    often it is chosen, and its density per solid angle; 0 where nothing is aimed. No light where it is absorbed."""
    glass, alpha, out = glass_share(matter), matter.alpha, seen.out
    if lobe < glass:
        lobe /= glass
        if not passes_straight(matter):
            onward, is_single = glass_direction(alpha, matter.ior, out, u, v, lobe)
            if not is_single:
                return onward, matter.colour if onward[2] < ZERO else (ONE, ONE, ONE), ZERO
        else:
            cosine = out[2]
            ratio = ONE if bends_nothing(matter) else ONE / matter.ior
            if not bends_nothing(matter) and lobe < fresnel(cosine, matter.ior):
                return (-out[0], -out[1], cosine), (ONE, ONE, ONE), ZERO
            far = np.sqrt(max(ZERO, ONE - ratio * ratio * (ONE - cosine * cosine)))
            return (-ratio * out[0], -ratio * out[1], -far), matter.colour, ZERO
    else:
        lobe = (lobe - glass) / (ONE - glass)
        up, down = seen.up, seen.down
        if lobe < up + down:
            x, y = circle(v)
            radius, height = np.sqrt(u), np.sqrt(max(ZERO, ONE - u))
            onward = radius * x, radius * y, height if lobe < up else -height
        else:
            lobe = (lobe - up - down) / (ONE - up - down)
            h = (ZERO, ZERO, ONE) if alpha < SMOOTH else visible_normal(alpha, out, u, v)
            cosine = min(ONE, dot(out, h))
            mirrored, own = mirrored_by(matter, cosine)
            by_mirror, _ = facet_chances(matter, mirrored, own)
            is_mirrored = lobe < by_mirror
            onward = along(scaled(-ONE, out), TWO * cosine, h)
            if alpha < SMOOTH:
                factor = ONE / ((ONE - glass) * (ONE - up - down) * by_mirror)
                return onward, scaled(factor, mirrored), ZERO
            if not onward[2] > ZERO:
                return onward, NO_LIGHT, ZERO
            onward = onward if is_mirrored else (onward[0], onward[1], -onward[2])
    value, density = physical_value(matter, seen, onward)
    if not density > ZERO:
        return onward, NO_LIGHT, ZERO
    return onward, scaled(ONE / density, value), density
