"""A clear coat over the metallic-roughness material: one more lobe of microfacets, of index 1.5.

The base gets what the coat lets through, in the direction where that is less: light takes each way in both directions
alike, and none is added. Source: the extension KHR_materials_clearcoat of glTF; `facets_kernels`.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, dot, scaled, unit
from atra.light.scattering.facets_kernels import ggx, reflected, slope, visible_normal
from atra.light.scattering.lost_kernels import lost, risen, schlick
from atra.light.scattering.physical_kernels import physical_direction, physical_value
from atra.light.scattering.seen_kernels import SMOOTH, clear_light

_LEAST = np.float32(0.04)
_WHITE = ONE, ONE, ONE


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
    value = scaled(ONE - max(chance, _share(matter, abs(onward[2]))), value)
    density *= ONE - chance
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
    if lobe >= chance:
        onward, weight, density = physical_direction(matter, seen, u, v, (lobe - chance) / (ONE - chance))
        if density == ZERO:
            least = ONE - max(chance, _share(matter, abs(onward[2])))
            return onward, scaled(least / (ONE - chance), weight), density
    elif alpha < SMOOTH:
        return (-out[0], -out[1], out[2]), _WHITE, ZERO
    else:
        h = visible_normal(alpha, out, u, v)
        onward = along(scaled(-ONE, out), TWO * dot(out, h), h)
        if not onward[2] > ZERO:
            return onward, (ZERO, ZERO, ZERO), ZERO
    value, density = coated_value(matter, seen, onward)
    return onward, scaled(ONE / density, value), density
