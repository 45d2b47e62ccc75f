"""A clear coat over the metallic-roughness material: one more lobe of microfacets, of index 1.5.

The base gets what the coat lets through, in the direction where that is less: light takes each way in both directions
alike, and none is added. Over all directions that is less than what the coat has let in; the rest is reflected back to
the base and leaves it later, spread over all directions.
Source: the extension KHR_materials_clearcoat of glTF; `facets_kernels`; for light that leaves later C. Kulla and A.
Conty, "Revisiting physically based shading at Imageworks", 2017, who tabulate what microfacets lose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, circle, dot, luminance, scaled, unit
from atra.light.scattering.facets_kernels import PER_PI, ggx, reflected, slope, visible_normal
from atra.light.scattering.lost_kernels import lost, risen, schlick
from atra.light.scattering.physical_kernels import physical_direction, physical_value
from atra.light.scattering.seen_kernels import SMOOTH, clear_light, shares_of, times

_LEAST = np.float32(0.04)
_WHITE = ONE, ONE, ONE
_BASES = """
    -2    -2    -2    -2    -2    -2    -2    -2    -2    -2    -2    -2
    -2   356   502   426   315   180    94    53    20     2    -3    -1
    -2   133   600   895   928   742   526   337   223   134    79    23
    -2    35   260   594   888  1004   911   717   586   461   329   233
    -2    17   155   400   599   825   900   868   810   743   627   494
    -2    17   150   295   509   706   815   851   862   864   804   698
    -2    39   128   295   480   668   778   823   852   879   845   761
    -2    39   162   318   502   684   778   814   839   859   823   738
    11    11    11    11    11    11    11    11    11    11    11    11
    11  1002   686   350    17    90    62    17    -7   -22   -15     5
    11   427   835   803   424   130   180   124   -22   -68   -76   -78
    11   126   382   544   445   176   261   245    90  -111  -170  -183
    11    68   221   402   297   157   241   277   163  -134  -234  -306
    11    66   230   303   238   150   220   267   179  -144  -259  -364
    11   127   198   303   264   157   212   265   173  -149  -270  -370
    11   171   242   330   275   132   212   260   166  -160  -279  -384
    -3    -3     2    53   176   355   514   618   680   731   741   728
    -3   102   109   160   245   397   535   635   694   738   750   736
    -3    37   149   250   378   510   660   739   784   819   817   802
    -3     6    67   205   394   591   755   840   879   903   888   869
    -3    -9    37   173   370   589   782   896   934   959   937   919
    -3    -5    38   153   353   579   780   906   956   986   966   947
    -3    -5    29   143   347   569   768   904   962   995   974   955
    -3    -5    30   147   332   557   769   903   961   999   990   967
    14    14    57   140   162   162   224   180   105  -166  -363  -587
    14  1022   688   271   194   159   245   187   103  -133  -354  -570
    14   463   917   732   435   325   235   201   102   -98  -291  -516
    14   173   545   680   540   418   303   222   116   -71  -246  -471
    14   132   390   540   489   431   336   216   136   -43  -218  -452
    14   103   313   461   461   428   346   228   144   -33  -204  -429
    14   103   303   458   431   422   358   244   133   -38  -187  -411
    14   103   296   431   461   434   348   233   141   -43  -218  -423
"""
"""Factors of the shares that a full coat keeps in, in units of 1e-4. A row: cosines 0 to 1. Eight rows: a base of
roughness 0 to 1. Two of these: terms of a sum. For white metal, then for white plastic of index 1.5."""

_COATS = (
    (0.473, 0.457, 0.317, 0.181, 0.095, 0.051, 0.037, 0.042),
    (0.084, 0, -0.051, -0.032, -0.01, -0.007, -0.042, -0.074),
    (0.434, 0.434, 0.315, 0.183, 0.095, 0.049, 0.035, 0.034),
    (0.093, 0.056, 0.018, 0.016, 0.014, -0.002, -0.038, -0.068),
)
"""The other factor of each term: of a coat of roughness 0 to 1."""


def _losses() -> NDArray[np.float32]:
    """(16, 8, 13) float32: shares kept in above eight bases of metal and eight of plastic, below eight coats, at twelve
    cosines, and after these the mean over all directions, weighted by their cosine.

    The factors are fitted to integrals of this model by quadrature, from below: within 0.0071.
    """
    bases = np.array(_BASES.split(), np.float64).reshape(2, 2, 8, 12) * 1e-4
    rows = np.einsum("ktbx,ktc->kbcx", bases, np.array(_COATS).reshape(2, 2, 8)).clip(0.0).reshape(16, 8, 12)
    weights = 2.0 / 11.0 * np.arange(12) / 11.0  # of lines between the places, times the cosine
    weights[-1] = 1.0 / 11.0 - 1.0 / 363.0
    return np.concatenate([rows, (rows @ weights)[..., None]], axis=2).astype(np.float32)


_LOSSES = _losses()
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
