"""Kernels that choose a point of an emitter and aim a ray at it, and the densities with which they do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY
from atra.light.lights_kernels import ALMOST
from atra.light.numbers_kernels import ONE, ZERO, bits_of, dot, scaled, unit_of
from atra.light.scattering_kernels import BLACK, scattered_light
from atra.light.surface_kernels import leaving, material_of, meet, plain_colour, texel_of

_DIMENSION = np.uint32(0x40000000)
"""First random dimension of aiming; those of scattering count from 0."""

_DIMENSIONS = np.uint32(4)
"""Random numbers per aim."""


class Emitters(NamedTuple):
    """N emissive triangles and a panorama of (H, W) texels, each of which may be absent.

    prim_ids: (N,) uint32. corners: (N, 9) float32: a corner, and the edges to the other two. odds, others: (N,) float32
    and int32, their alias table. densities: (F,) float32, how often a point of each triangle of the mesh is chosen, per
    area; empty without emissive triangles. sky_odds, sky_others: (H W,), alias table of the texels. sky_densities:
    (H, W) float32, how often a direction is chosen, per solid angle. sky_share: how often the sky is chosen.
    """

    prim_ids: NDArray[np.uint32]
    corners: NDArray[np.float32]
    odds: NDArray[np.float32]
    others: NDArray[np.int32]
    densities: NDArray[np.float32]
    sky_odds: NDArray[np.float32]
    sky_others: NDArray[np.int32]
    sky_densities: NDArray[np.float32]
    sky_share: np.float32


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


@njit
def _to_sky(emitters, panorama, chance, second, u, v):  # type: ignore[no-untyped-def]
    """(direction, density, light) of a texel, and a point within it by u and v."""
    rows, columns = panorama.shape[0], panorama.shape[1]
    y, x = divmod(_entry(emitters.sky_odds, emitters.sky_others, chance, second), columns)
    top, bottom = np.cos(np.pi * y / rows), np.cos(np.pi * (y + 1) / rows)
    height = top + (bottom - top) * np.float64(v)
    turn = 2.0 * np.pi * ((x + np.float64(u)) / columns - 0.5)
    across = np.sqrt(max(0.0, 1.0 - height * height))
    direction = np.float32(across * np.sin(turn)), np.float32(height), np.float32(-across * np.cos(turn))
    return direction, emitters.sky_densities[y, x], (panorama[y, x, 0], panorama[y, x, 1], panorama[y, x, 2])


@njit
def _to_triangle(surfaces, emitters, origin, chance, second, u, v):  # type: ignore[no-untyped-def]
    """(direction, distance, density per solid angle, light) of a point of a triangle, whose back has density 0."""
    entry = _entry(emitters.odds, emitters.others, chance, second)
    corners, prim_id = emitters.corners, emitters.prim_ids[entry]
    root = np.sqrt(u)
    b, c = root * (ONE - v), root * v
    way = (
        corners[entry, 0] + b * corners[entry, 3] + c * corners[entry, 6] - origin[0],
        corners[entry, 1] + b * corners[entry, 4] + c * corners[entry, 7] - origin[1],
        corners[entry, 2] + b * corners[entry, 5] + c * corners[entry, 8] - origin[2],
    )
    squared = dot(way, way)
    distance = np.sqrt(squared)
    direction = scaled(ONE / distance, way)
    records = surfaces.records
    normal = np.float32(records[prim_id, 0]), np.float32(records[prim_id, 1]), np.float32(records[prim_id, 2])
    facing = -dot(direction, normal)
    density = emitters.densities[prim_id] * squared / facing if facing > ZERO else ZERO
    return direction, distance, density, plain_colour(surfaces, material_of(surfaces, prim_id))


@njit(error_model="numpy")
def aim(surfaces, emitters, prim_id, origin, direction, key, bounce):  # type: ignore[no-untyped-def]
    """(length, origin, direction, light): a ray from where a path meets `prim_id` to an emitter, and the (r, g, b) that
    arrives along the path if nothing is in its way. Length 0: there is none.

    Light that scattering finds, too, is divided between both by the power heuristic.
    Source: E. Veach and L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", 1995.
    """
    point, normal, is_front = meet(surfaces, prim_id, origin, direction)
    start = leaving(surfaces, prim_id, point, normal)
    dimension = _DIMENSION + np.uint32(bounce) * _DIMENSIONS
    chance, second = unit_of(bits_of(key, dimension)), unit_of(bits_of(key, dimension + np.uint32(1)))
    u, v = unit_of(bits_of(key, dimension + np.uint32(2))), unit_of(bits_of(key, dimension + np.uint32(3)))
    share = emitters.sky_share
    length = INFINITY
    if chance < share:
        towards, density, light = _to_sky(emitters, surfaces.panorama, chance / share, second, u, v)
    else:
        towards, distance, density, light = _to_triangle(
            surfaces, emitters, start, (chance - share) / (ONE - share), second, u, v
        )
        length = distance * ALMOST
    if not (density > ZERO and dot(towards, normal) > ZERO):
        return ZERO, start, towards, BLACK
    scattered, own = scattered_light(surfaces, prim_id, point, normal, is_front, direction, towards)
    if not own > ZERO:
        return ZERO, start, towards, BLACK
    factor = share_of(density, own) / density
    return length, start, towards, (
        factor * scattered[0] * light[0], factor * scattered[1] * light[1], factor * scattered[2] * light[2]
    )  # fmt: skip


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
def found_sky_share(emitters, direction, density):  # type: ignore[no-untyped-def]
    """`found_share` of the sky in a direction."""
    rows, columns = emitters.sky_densities.shape
    if density == ZERO or rows == 0:
        return ONE
    y, x = texel_of(rows, columns, direction)
    return share_of(density, emitters.sky_densities[y, x])
