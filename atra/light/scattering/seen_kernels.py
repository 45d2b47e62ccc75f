"""The metallic-roughness material of glTF as it is seen from one direction, whatever light falls on it.

Vectors are in the frame of the shading normal, which is +z; a direction that sees a surface is on the side of +z.
Source: as of `physical_kernels`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO, along, luminance, scaled
from atra.light.scattering.facets_kernels import fresnel
from atra.light.scattering.lost_kernels import kept_share, lost, lost_mean, risen, risen_mean, schlick

SMOOTH = np.float32(1e-3)
"""Surfaces below this squared roughness are mirrors and clear glass."""

LEAST_BEND = 1e-3
"""A solid whose index of refraction is nearer to 1 lets light straight on, however rough it is."""

_LEAST_BEND = np.float32(LEAST_BEND)
_MEAN_RISE = np.float32(1.0 / 21.0)
"""Mean over directions of Schlick's rise, weighted by the cosine."""

NO_LIGHT = ZERO, ZERO, ZERO


@njit(forceinline=True)
def times(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@njit(forceinline=True)
def bends_nothing(matter):  # type: ignore[no-untyped-def]
    return not matter.is_thin and abs(matter.ior - ONE) < _LEAST_BEND


@njit(forceinline=True)
def is_clear_pane(matter):  # type: ignore[no-untyped-def]
    """Whether light passes straight on, as `clear_light` says, and is not scattered to the other side."""
    return matter.is_thin and matter.alpha < SMOOTH


@njit(forceinline=True)
def passes_straight(matter):  # type: ignore[no-untyped-def]
    """Whether what passes is not spread: smooth, or a solid that bends no light."""
    return matter.alpha < SMOOTH or bends_nothing(matter)


@njit(error_model="numpy")
def clear_light(matter, cosine):  # type: ignore[no-untyped-def]
    """(r, g, b) that passes a clear surface straight on, at a cosine with its normal; on both sides of solid glass that
    of the outside, as for a slab."""
    if matter.is_thin:
        own = _rising(matter.least, matter.most, schlick(cosine))
    else:
        own = scaled(fresnel(cosine, max(matter.ior, ONE / matter.ior)), (ONE, ONE, ONE))
    return scaled((ONE - matter.metallic) * matter.transmission, times(rest_of(own), matter.colour))


@njit(forceinline=True)
def glass_share(matter):  # type: ignore[no-untyped-def]
    """How much of the surface is that of a transparent solid; the rest is metal, plastic and panes."""
    return ZERO if matter.is_thin else (ONE - matter.metallic) * matter.transmission


@njit(forceinline=True)
def shares_of(matter):  # type: ignore[no-untyped-def]
    """(plastic and panes, bases below them, passing panes) of the surface."""
    dielectric = ONE - matter.metallic - glass_share(matter)
    passing = dielectric * matter.transmission if matter.is_thin else ZERO
    return dielectric, dielectric - passing, passing


@njit(forceinline=True)
def rest_of(colour):  # type: ignore[no-untyped-def]
    return ONE - colour[0], ONE - colour[1], ONE - colour[2]


@njit(forceinline=True)
def _rising(least, most, rise):  # type: ignore[no-untyped-def]
    """(r, g, b) that a microfacet reflects which reflects `least` at a right angle and `most` where it is grazing."""
    return least[0] + rise * (most - least[0]), least[1] + rise * (most - least[1]), least[2] + rise * (most - least[2])


@njit(error_model="numpy")
def mirrored_by(matter, cosine):  # type: ignore[no-untyped-def]
    """((r, g, b), (r, g, b)): reflected by metal and plastic, by their shares, and by plastic alone, at a cosine with a
    microfacet's normal."""
    rise = schlick(cosine)
    own = _rising(matter.least, matter.most, rise)
    return along(scaled(shares_of(matter)[0], own), matter.metallic, _rising(matter.colour, ONE, rise)), own


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


@njit(forceinline=True, error_model="numpy")
def let_through(matter, cosine, away, again):  # type: ignore[no-untyped-def]
    """`_let_through` at a cosine with the normal. away: `lost` there. again: `_again` of plastic."""
    if matter.alpha < SMOOTH:
        return _let_through(matter, ONE, schlick(cosine), NO_LIGHT)
    return _let_through(matter, ONE - away, risen(matter.alpha, cosine), scaled(away, again))


@njit(error_model="numpy")
def facet_chances(matter, mirrored, own):  # type: ignore[no-untyped-def]
    """(to be mirrored, to pass), among microfacets' light at a cosine with their normal; they add up to 1. mirrored,
    own: of `mirrored_by`."""
    passing = ZERO if is_clear_pane(matter) else shares_of(matter)[2]
    if passing == ZERO:
        return ONE, ZERO
    most, through = luminance(mirrored), passing * luminance(times(rest_of(own), matter.colour))
    total = most + through
    return (most / total, through / total) if total > ZERO else (ONE, ZERO)


class Seen(NamedTuple):
    """What a surface does with light, as far as the direction decides from which it is seen.

    out: that direction. up, down: how often a direction above, and one below, is chosen by its cosine: for the base,
    and for light that meets several microfacets. away, mean: `lost` and `lost_mean`; 1 where it is smooth. again: left
    of light that meets several microfacets of plastic; above, below: of such light, what is reflected, and what passes
    a pane. through, through_mean: what the surface lets through to the base from here, and on average.
    """

    out: tuple[np.float32, np.float32, np.float32]
    up: np.float32
    down: np.float32
    away: np.float32
    mean: np.float32
    again: tuple[np.float32, np.float32, np.float32]
    above: tuple[np.float32, np.float32, np.float32]
    below: tuple[np.float32, np.float32, np.float32]
    through: tuple[np.float32, np.float32, np.float32]
    through_mean: tuple[np.float32, np.float32, np.float32]


UNSEEN = Seen(NO_LIGHT, ZERO, ZERO, ONE, ONE, NO_LIGHT, NO_LIGHT, NO_LIGHT, NO_LIGHT, NO_LIGHT)
"""What stands in the place of `Seen` for all other materials, which do not use it."""


@njit(error_model="numpy")
def seen_from(matter, out):  # type: ignore[no-untyped-def]
    """`Seen`: what is found once for all directions of light that are asked for."""
    if glass_share(matter) == ONE:
        return Seen(out, ZERO, ZERO, ONE, ONE, NO_LIGHT, NO_LIGHT, NO_LIGHT, NO_LIGHT, NO_LIGHT)
    dielectric, base, passing = shares_of(matter)
    alpha, cosine = matter.alpha, out[2]
    away, mean, again, above, below, through, through_mean = ONE, ONE, NO_LIGHT, NO_LIGHT, NO_LIGHT, NO_LIGHT, NO_LIGHT
    if alpha >= SMOOTH:
        away, mean = lost(alpha, cosine), lost_mean(alpha)
        again = _again(_rising(matter.least, matter.most, _MEAN_RISE), mean)
        metal = _again(_rising(matter.colour, ONE, _MEAN_RISE), mean)
        above = along(scaled(dielectric, again), matter.metallic, metal)
        below = scaled(passing, times(rest_of(again), matter.colour))
    if base > ZERO:
        through = let_through(matter, cosine, away, again)
        if alpha >= SMOOTH:
            through_mean = _let_through(matter, ONE - mean, risen_mean(alpha), scaled(mean, again))
        else:
            through_mean = _let_through(matter, ONE, _MEAN_RISE, NO_LIGHT)
    up, down = base * luminance(times(through, matter.colour)), ZERO
    mirrored, own = mirrored_by(matter, cosine)
    total = luminance(mirrored)
    if alpha >= SMOOTH:
        up, down = up + away * luminance(above), away * luminance(below)
    if not is_clear_pane(matter):
        total += passing * luminance(times(rest_of(own), matter.colour))
    total += up + down
    up, down = (up / total, down / total) if total > ZERO else (ZERO, ZERO)
    return Seen(out, up, down, away, mean, again, above, below, through, through_mean)
