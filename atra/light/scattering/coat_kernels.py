"""A clear coat over the metallic-roughness material: one more lobe of microfacets, of index 1.5.

The base gets what the coat lets through, in the direction where that is less: light takes each way in both directions
alike, and none is added. What that leaves out comes out later, spread over all directions (`coat_losses`).
Source: the extension KHR_materials_clearcoat of glTF; `facets_kernels`.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, circle, dot, luminance, scaled, unit
from atra.light.scattering.coat_losses import coat_losses
from atra.light.scattering.facets_kernels import PER_PI, ggx, reflected, slope, visible_normal
from atra.light.scattering.lost_kernels import lost, risen, schlick
from atra.light.scattering.physical_kernels import physical_direction, physical_value
from atra.light.scattering.seen_kernels import SMOOTH, clear_light, shares_of, times

_LEAST = np.float32(0.04)
_WHITE = ONE, ONE, ONE
_LOSSES = coat_losses()
_COSINES, _MEAN = np.float32(11.0), np.float32(12.0)
"""Places in a row of `_LOSSES`: of a cosine of 1, and of the mean."""

_STEPS, _PLASTIC = np.float32(7.0), 8
"""Steps of roughness from 0 to 1; the first table of plastic."""


@njit(forceinline=True)
def _facet(matter, cosine):  # type: ignore[no-untyped-def]
    """What a microfacet of the coat reflects."""
    return matter.coat * (_LEAST + (ONE - _LEAST) * schlick(cosine))


@njit(error_model="numpy")
def _share(matter, cosine):  # type: ignore[no-untyped-def]
    """What the coat reflects of light at a cosine with the normal."""
    alpha = matter.coat_alpha
    if alpha < SMOOTH:
        return _facet(matter, cosine)
    rise = risen(alpha, cosine)
    return matter.coat * (_LEAST * (ONE - lost(alpha, cosine) - rise) + rise)


@njit(forceinline=True)
def _between(number, share, row, part, place):  # type: ignore[no-untyped-def]
    """A number of table `number`, `share` of the way from a row to the next, at a place between two columns."""
    column = min(np.int64(place), 11)
    f = place - np.float32(column)
    first = (ONE - f) * _LOSSES[number, row, column] + f * _LOSSES[number, row, column + 1]
    second = (ONE - f) * _LOSSES[number, row + 1, column] + f * _LOSSES[number, row + 1, column + 1]
    return share * ((ONE - part) * first + part * second)


@njit
def _kept_in(matter, place):  # type: ignore[no-untyped-def]
    """(plastic, metal): shares that a full coat keeps in at a place of `_LOSSES`."""
    rows, steps = _STEPS * np.sqrt(matter.coat_alpha), _STEPS * np.sqrt(matter.alpha)
    row, step = min(np.int64(rows), 6), min(np.int64(steps), 6)
    part, f = rows - np.float32(row), steps - np.float32(step)
    plastic = _between(_PLASTIC + step, ONE - f, row, part, place) + _between(_PLASTIC + step + 1, f, row, part, place)
    f = f * f if step == 0 else f  # what smooth metal keeps in grows by the square
    return plastic, _between(step, ONE - f, row, part, place) + _between(step + 1, f, row, part, place)


@njit
def _later_chance(matter, cosine, chance):  # type: ignore[no-untyped-def]
    """How often a direction is chosen by its cosine, for light that the coat has kept in. chance: of the coat."""
    base, metal = _kept_in(matter, _COSINES * cosine)
    share = matter.coat * (shares_of(matter)[1] * base + matter.metallic * metal)
    return min((ONE - chance) / TWO, share * luminance(times(matter.colour, matter.colour)))


@njit(error_model="numpy")
def _later(matter, out, onward):  # type: ignore[no-untyped-def]
    """(r, g, b) that leaves later, times the cosine, per solid angle: it meets the base twice."""
    here, there = _kept_in(matter, _COSINES * out[2]), _kept_in(matter, _COSINES * onward[2])
    mean = _kept_in(matter, _MEAN)
    share = ZERO
    if mean[0] > ZERO:
        share += shares_of(matter)[1] * here[0] * there[0] / mean[0]
    if mean[1] > ZERO:
        share += matter.metallic * here[1] * there[1] / mean[1]
    return scaled(matter.coat * share * onward[2] * PER_PI, times(matter.colour, matter.colour))


@njit(error_model="numpy")
def coated_clear_light(matter, cosine):  # type: ignore[no-untyped-def]
    """`clear_light` below a coat."""
    light = clear_light(matter, cosine)
    return light if matter.coat == ZERO else scaled(ONE - _share(matter, cosine), light)


@njit(error_model="numpy")
def coated_value(matter, seen, onward):  # type: ignore[no-untyped-def]
    """`physical_value` below a coat, and of the coat."""
    value, density = physical_value(matter, seen, onward)
    if matter.coat == ZERO:
        return value, density
    out, alpha = seen.out, matter.coat_alpha
    chance = _share(matter, out[2])
    later = _later_chance(matter, out[2], chance)
    value = scaled(ONE - max(chance, _share(matter, abs(onward[2]))), value)
    density *= ONE - chance - later
    if onward[2] > ZERO:
        value = along(value, ONE, _later(matter, out, onward))
        density += later * onward[2] * PER_PI
    if onward[2] > ZERO and alpha >= SMOOTH:
        h = unit((out[0] + onward[0], out[1] + onward[1], out[2] + onward[2]))
        value = along(value, _facet(matter, dot(out, h)) * reflected(alpha, out, onward, h), _WHITE)
        density += chance * ggx(alpha, h) / (TWO * (out[2] + slope(alpha, out[2])))
    return value, density


@njit(error_model="numpy")
def coated_direction(matter, seen, u, v, lobe):  # type: ignore[no-untyped-def]
    """`physical_direction` below a coat, and of the coat."""
    if matter.coat == ZERO:
        return physical_direction(matter, seen, u, v, lobe)
    out, alpha = seen.out, matter.coat_alpha
    chance = _share(matter, out[2])
    later = _later_chance(matter, out[2], chance)
    if lobe >= chance + later:
        rest = ONE - chance - later
        onward, weight, density = physical_direction(matter, seen, u, v, (lobe - chance - later) / rest)
        if density == ZERO:
            least = ONE - max(chance, _share(matter, abs(onward[2])))
            return onward, scaled(least / rest, weight), density
    elif lobe >= chance:
        x, y = circle(v)
        radius = np.sqrt(u)
        onward = radius * x, radius * y, np.sqrt(max(ZERO, ONE - u))
    elif alpha < SMOOTH:
        return (-out[0], -out[1], out[2]), _WHITE, ZERO
    else:
        h = visible_normal(alpha, out, u, v)
        onward = along(scaled(-ONE, out), TWO * dot(out, h), h)
        if not onward[2] > ZERO:
            return onward, (ZERO, ZERO, ZERO), ZERO
    value, density = coated_value(matter, seen, onward)
    if not density > ZERO:
        return onward, (ZERO, ZERO, ZERO), ZERO
    return onward, scaled(ONE / density, value), density
