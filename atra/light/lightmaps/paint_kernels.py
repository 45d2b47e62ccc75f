"""Colours and opacities of a bake at the places that rays hit, by the lookups of path tracing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY
from atra.light.numbers_kernels import ZERO
from atra.light.scattering.spots_kernels import emission_at, opacity_at
from atra.light.surface_kernels import HAS_COLOURS, Surfaces, colour_of, material_of, meet, vertex_colour, weights_at

COLOUR, OPACITY, EMISSION = 1, 2, 4
"""Bits of `by_place`: what varies within a triangle."""

LARGEST_ALBEDO = 0.999
"""Largest albedo; with 1, light would bounce forever."""

_MOST = np.float32(LARGEST_ALBEDO)


class Paint(NamedTuple):
    """Materials that vary within triangles. surfaces: their tables. by_place: (F,) uint8, of each triangle."""

    surfaces: Surfaces
    by_place: NDArray[np.uint8]


@njit
def _albedo_at(surfaces, prim_id, point):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of a triangle at a point."""
    material = material_of(surfaces, prim_id)
    red, green, blue = colour_of(surfaces, material, prim_id, point)
    if surfaces.materials[material, HAS_COLOURS] != 0.0:
        tint = vertex_colour(surfaces, prim_id, weights_at(surfaces, prim_id, point))
        red, green, blue = red * tint[0], green * tint[1], blue * tint[2]
    return min(max(red, ZERO), _MOST), min(max(green, ZERO), _MOST), min(max(blue, ZERO), _MOST)


@njit(forceinline=True)
def albedo_met(tables, paint, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 where a ray meets a triangle. paint: a `Paint`, or None, for which no code is compiled."""
    if paint is not None and paint.by_place[prim_id] & COLOUR != 0:
        return _albedo_at(paint.surfaces, prim_id, meet(paint.surfaces, prim_id, origin, direction)[0])
    return tables.albedo[prim_id, 0], tables.albedo[prim_id, 1], tables.albedo[prim_id, 2]


@njit(forceinline=True)
def opacity_met(tables, paint, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """The share of light that a triangle stops where a ray meets it. paint: as for `albedo_met`."""
    if paint is not None and paint.by_place[prim_id] & OPACITY != 0:
        point, _, is_front = meet(paint.surfaces, prim_id, origin, direction)
        return opacity_at(paint.surfaces, prim_id, point, is_front, False)
    return tables.opacity[prim_id]


@float_kernel
def look_up(paint, prim_id, points, albedo, opacity):  # type: ignore[no-untyped-def]
    """Put what varies at (N, 3) float64 points of triangles into (N, 3) and (N,) float32. Points that are not finite
    keep what is there."""
    surfaces = paint.surfaces
    for i in range(len(prim_id)):
        face, point = prim_id[i], (points[i, 0], points[i, 1], points[i, 2])
        if not abs(point[0]) + abs(point[1]) + abs(point[2]) < INFINITY:
            continue
        if paint.by_place[face] & COLOUR != 0:
            albedo[i, 0], albedo[i, 1], albedo[i, 2] = _albedo_at(surfaces, face, point)
        if paint.by_place[face] & OPACITY != 0:
            opacity[i] = opacity_at(surfaces, face, point, True, False)


@float_kernel
def take_means(paint, corners, weights, albedo, emission, opacity):  # type: ignore[no-untyped-def]
    """Put means of what varies within triangles into their rows of `albedo`, `emission` (F, 3) and `opacity` (F,).

    corners: (F, 3, 3) float64. weights: (K, 2) float64, of the second and third corners, where triangles are looked at.
    """
    surfaces, part = paint.surfaces, np.float32(1.0 / len(weights))
    for face in range(len(corners)):
        varies = paint.by_place[face]
        if varies == 0:
            continue
        colour, light, stopped = (ZERO, ZERO, ZERO), (ZERO, ZERO, ZERO), ZERO
        for k in range(len(weights)):
            v, w = weights[k, 0], weights[k, 1]
            u = 1.0 - v - w
            point = (
                u * corners[face, 0, 0] + v * corners[face, 1, 0] + w * corners[face, 2, 0],
                u * corners[face, 0, 1] + v * corners[face, 1, 1] + w * corners[face, 2, 1],
                u * corners[face, 0, 2] + v * corners[face, 1, 2] + w * corners[face, 2, 2],
            )
            if varies & COLOUR != 0:
                one = _albedo_at(surfaces, face, point)
                colour = colour[0] + part * one[0], colour[1] + part * one[1], colour[2] + part * one[2]
            if varies & EMISSION != 0:
                one = emission_at(surfaces, face, point)
                light = light[0] + part * one[0], light[1] + part * one[1], light[2] + part * one[2]
            if varies & OPACITY != 0:
                stopped += part * opacity_at(surfaces, face, point, True, False)
        if varies & COLOUR != 0:
            albedo[face, 0], albedo[face, 1], albedo[face, 2] = colour
        if varies & EMISSION != 0:
            emission[face, 0], emission[face, 1], emission[face, 2] = light
        if varies & OPACITY != 0:
            opacity[face] = stopped
