"""Kernels that choose a point of an emitter and aim a ray at it, and the densities with which they do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY
from atra.light.emitters.grid_kernels import LampGrid, cell_of, chosen_in
from atra.light.emitters.sky_kernels import sky_colour, sky_density, sky_direction
from atra.light.lights_kernels import ALMOST, KIND, SUN, to_lamp, to_sun
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, bits_of, dot, luminance, scaled, unit_of
from atra.light.scattering.sampler_kernels import CHOICE, PAIRS, PLACE, pair_of
from atra.light.scattering.spots_kernels import BLACK, scattered_light
from atra.light.surface_kernels import SKY_TURN, emission_at, leaving, meet

_S1, _S2, _S3, _S4 = (np.float32(step) for step in (0.8566749, 0.7338919, 0.6287067, 0.5385973))
"""Steps between candidates, which spread them evenly. Source: M. Roberts, "The unreasonable effectiveness of
quasirandom sequences", 2018."""


FROM_TRIANGLE, FROM_LAMP, FROM_SKY = ZERO, ONE, TWO
"""What a ray is aimed at, as float32."""


class Emitters(NamedTuple):
    """N triangles that shine, a panorama of (H, W) texels, and L lamps: suns, points, spheres and spots; each may be
    absent.

    prim_ids: (N,) uint32. corners: (N, 9) float32: a corner, and the edges to the other two. odds, others: (N,) float32
    and int32, their alias table. densities: (F,) float32, how often a point of each triangle of the mesh is chosen, per
    area; empty without triangles that shine. sky_odds, sky_others: (H W,), alias table of the texels. sky_densities:
    (H, W) float32, how often directions to the middles of texels are chosen, per solid angle, times the sine of the
    angle to the pole. lamps: (L, LIGHT_WORDS) float32; lamp_light: (L,
    3) float32, what a surface that faces them receives, over how often they are chosen; with a grid, over how often
    lamps are. lamp_odds, lamp_others: (L,), alias table. sky_share, lamp_share: how often the sky, and lamps, are
    chosen. candidates: points of emitters that are weighed for each ray. grid: what chooses lamps in place of the alias
    table, if it has cells.
    """

    prim_ids: NDArray[np.uint32]
    corners: NDArray[np.float32]
    odds: NDArray[np.float32]
    others: NDArray[np.int32]
    densities: NDArray[np.float32]
    sky_odds: NDArray[np.float32]
    sky_others: NDArray[np.int32]
    sky_densities: NDArray[np.float32]
    lamps: NDArray[np.float32]
    lamp_light: NDArray[np.float32]
    lamp_odds: NDArray[np.float32]
    lamp_others: NDArray[np.int32]
    sky_share: np.float32
    lamp_share: np.float32
    candidates: int
    grid: LampGrid


@njit(forceinline=True)
def has_emitters(emitters):  # type: ignore[no-untyped-def]
    """Whether there is anything to aim at."""
    return len(emitters.prim_ids) > 0 or len(emitters.sky_densities) > 0 or len(emitters.lamps) > 0


@float_kernel
def fill_alias_table(odds, others, small, large):  # type: ignore[no-untyped-def]
    """Make an alias table: a uniform choice of an entry, which with probability 1 - odds becomes its other one.

    odds: (N,) float64, in: weights, whose mean is 1; out: probabilities. others: (N,) int32. small, large: (N,) int32,
    scratch. Source: M. D. Vose, "A linear algorithm for generating random numbers with a given distribution", 1991.
    """
    few = many = 0
    for entry in range(len(odds)):
        others[entry] = entry
        if odds[entry] < 1.0:
            small[few] = entry
            few += 1
        else:
            large[many] = entry
            many += 1
    while few > 0 and many > 0:
        few -= 1
        poor, rich = small[few], large[many - 1]
        others[poor] = rich
        odds[rich] -= 1.0 - odds[poor]
        if odds[rich] < 1.0:
            many -= 1
            small[few] = rich
            few += 1
    for place in range(few):  # left over by rounding
        odds[small[place]] = 1.0
    for place in range(many):
        odds[large[place]] = 1.0


@njit(forceinline=True)
def _entry(odds, others, chance, second):  # type: ignore[no-untyped-def]
    """The entry of an alias table for two random numbers in [0, 1)."""
    entry = min(np.int64(np.float64(chance) * len(odds)), len(odds) - 1)
    return entry if second < odds[entry] else np.int64(others[entry])


@njit(forceinline=True)
def _to_sky(surfaces, emitters, chance, second, u, v):  # type: ignore[no-untyped-def]
    """(direction, density, light) of a place of the panorama, by four numbers in [0, 1)."""
    rows, columns = emitters.sky_densities.shape
    texel, turn = _entry(emitters.sky_odds, emitters.sky_others, chance, second), surfaces.sky[SKY_TURN]
    direction = sky_direction(rows, columns, texel, u, v, turn)
    return direction, sky_density(emitters.sky_densities, direction, turn), sky_colour(surfaces, direction)


@njit(forceinline=True, error_model="numpy")
def _to_triangle(surfaces, emitters, origin, chance, second, u, v):  # type: ignore[no-untyped-def]
    """(direction, distance, density per solid angle, light) of a point of a triangle, whose back has density 0."""
    entry = _entry(emitters.odds, emitters.others, chance, second)
    corners, prim_id = emitters.corners, emitters.prim_ids[entry]
    root = np.sqrt(u)
    b, c = root * (ONE - v), root * v
    point = (
        corners[entry, 0] + b * corners[entry, 3] + c * corners[entry, 6],
        corners[entry, 1] + b * corners[entry, 4] + c * corners[entry, 7],
        corners[entry, 2] + b * corners[entry, 5] + c * corners[entry, 8],
    )
    way = along(point, -ONE, origin)
    squared = dot(way, way)
    distance = np.sqrt(squared)
    direction = scaled(ONE / distance, way)
    records = surfaces.records
    normal = np.float32(records[prim_id, 0]), np.float32(records[prim_id, 1]), np.float32(records[prim_id, 2])
    facing = -dot(direction, normal)
    density = emitters.densities[prim_id] * squared / facing if facing > ZERO else ZERO
    return direction, distance, density, emission_at(surfaces, prim_id, point)


@njit(forceinline=True)
def _to_lamp(emitters, origin, chance, second, u, v):  # type: ignore[no-untyped-def]
    """(direction, reach, light over how often it is chosen) of a point of a lamp."""
    if len(emitters.grid.of_all) > 0:
        entry, odds = chosen_in(emitters.grid, len(emitters.lamps), cell_of(emitters.grid, origin), chance)
    else:
        entry, odds = _entry(emitters.lamp_odds, emitters.lamp_others, chance, second), ONE
    lamp, light = emitters.lamps[entry], emitters.lamp_light
    if lamp[KIND] == SUN:
        direction, strength, reach = to_sun(lamp, u, v), ONE, INFINITY
    else:
        direction, strength, reach = to_lamp(lamp, origin, u, v)
    strength /= odds
    return direction, reach, (strength * light[entry, 0], strength * light[entry, 1], strength * light[entry, 2])


@njit(forceinline=True, error_model="numpy")
def _candidate(surfaces, emitters, spot, origin, chance, second, u, v):  # type: ignore[no-untyped-def]
    """(length, direction, (r, g, b), kind): a point of an emitter, and the light that arrives from it
    along the path, over how often it is chosen, if nothing is in its way.

    Light that scattering finds, too, is divided between both by the power heuristic.
    Source: E. Veach and L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", 1995.
    """
    sky, lamps = emitters.sky_share, emitters.lamp_share
    length, density, kind = INFINITY, ONE, FROM_LAMP
    if chance < lamps:
        towards, length, light = _to_lamp(emitters, origin, chance / lamps, second, u, v)
    elif chance < lamps + sky or len(emitters.prim_ids) == 0:
        towards, density, light = _to_sky(surfaces, emitters, (chance - lamps) / sky, second, u, v)
        kind = FROM_SKY
    else:
        rest = (chance - lamps - sky) / (ONE - lamps - sky)
        towards, distance, density, light = _to_triangle(surfaces, emitters, origin, rest, second, u, v)
        length, kind = distance * ALMOST, FROM_TRIANGLE
    if not density > ZERO:
        return ZERO, towards, BLACK, kind
    scattered, own = scattered_light(spot, towards)
    factor = ONE if kind == FROM_LAMP else share_of(density, own) / density
    return length, towards, (
        factor * scattered[0] * light[0], factor * scattered[1] * light[1], factor * scattered[2] * light[2]
    ), kind  # fmt: skip


@njit(forceinline=True, error_model="numpy")
def aim(surfaces, emitters, spot, prim_id, direction, key, sample, bounce):  # type: ignore[no-untyped-def]
    """(length, origin, direction, light, kind): a ray from where a path meets `prim_id` to an emitter, the (r, g, b)
    that arrives along the path if nothing is in its way, and of what. Length 0: there is no ray.

    Of several candidates, one is chosen by its light.
    Source: J. Talbot, D. Cline and P. Egbert, "Importance resampling for global illumination", 2005.
    """
    chance, second = pair_of(key, sample, bounce * PAIRS + CHOICE)
    u, v = pair_of(key, sample, bounce * PAIRS + PLACE)
    left = unit_of(bits_of(key ^ np.uint32(sample), np.uint32(bounce)))
    origin = leaving(surfaces, prim_id, spot.point, spot.normal)
    length, towards, light, weight, total, of = ZERO, direction, BLACK, ZERO, ZERO, FROM_TRIANGLE
    for _ in range(emitters.candidates):
        other, way, carried, kind = _candidate(surfaces, emitters, spot, origin, chance, second, u, v)
        chance, second, u, v = _next(chance, _S1), _next(second, _S2), _next(u, _S3), _next(v, _S4)
        more = luminance(carried)
        if not more > ZERO:
            continue
        total += more
        share = more / total if total < INFINITY else ONE  # infinite light is to be noticed
        if left < share:
            length, towards, light, weight, of = other, way, carried, more, kind
            left /= share
        else:
            left = (left - share) / (ONE - share)
    if not weight > ZERO:
        return ZERO, origin, towards, BLACK, of
    if dot(towards, spot.normal) < ZERO:
        origin = leaving(surfaces, prim_id, spot.point, scaled(-ONE, spot.normal))
    light = scaled(total / (weight * np.float32(emitters.candidates)), light)
    return length, origin, towards, light, of


@njit(forceinline=True)
def _next(number, step):  # type: ignore[no-untyped-def]
    """The next of evenly spread numbers in [0, 1)."""
    moved = number + step
    return moved - ONE if moved >= ONE else moved


@njit(forceinline=True, error_model="numpy")
def share_of(density, other):  # type: ignore[no-untyped-def]
    """The power heuristic's share of light found with `density` per solid angle, where another way has `other`."""
    ratio = other / density
    return ONE / (ONE + ratio * ratio)


@njit(error_model="numpy")
def found_share(surfaces, emitters, prim_id, origin, direction, density):  # type: ignore[no-untyped-def]
    """The share of light of an emissive triangle that a path has found by scattering with `density`, 0 where nothing
    was aimed at it."""
    if density == ZERO or len(emitters.densities) == 0:
        return ONE
    point, normal, _ = meet(surfaces, prim_id, origin, direction)
    way = (
        np.float32(point[0]) - origin[0],
        np.float32(point[1]) - origin[1],
        np.float32(point[2]) - origin[2],
    )
    aimed = emitters.densities[prim_id] * dot(way, way) / abs(dot(normal, direction))
    return share_of(density, aimed)


@njit(error_model="numpy")
def found_sky_share(surfaces, emitters, direction, density):  # type: ignore[no-untyped-def]
    """`found_share` of the sky in a direction."""
    if density == ZERO or len(emitters.sky_densities) == 0:
        return ONE
    return share_of(density, sky_density(emitters.sky_densities, direction, surfaces.sky[SKY_TURN]))
