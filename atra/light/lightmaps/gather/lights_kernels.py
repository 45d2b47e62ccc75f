"""Kernels of direct light: rays to lights, to emitting faces and into the sky, and what they carry."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY
from atra.light.lightmaps.gather.choice_kernels import cell_of, chosen
from atra.light.lightmaps.gather.tables_kernels import (
    CARRIED,
    COLOUR,
    DIRECT,
    DIRECTION,
    EMITTERS,
    ENVIRONMENT,
    GIVES_BSDF,
    GIVES_LIGHT,
    INDIRECT,
    KIND,
    LENGTH,
    NORMAL,
    ORIGIN,
    SKY,
    SUN,
    WEIGHT,
    choose,
)
from atra.light.lights_kernels import ALMOST, to_lamp, to_sun
from atra.light.numbers_kernels import ONE, ZERO, along, circle, dot, scaled, set_vector, vector
from atra.light.scattering.sampler_kernels import pair_of
from atra.light.surface_kernels import sky_colour

PI, QUARTER = np.float32(np.pi), np.float32(0.25)
_LIGHTS_OF_A_VERTEX, _PAIRS = 1 << 20, 2
"""Pairs of evenly spread numbers of rays to lights lie beyond those of paths: two for each, and for a random one."""

_NONE = ZERO, ZERO, ZERO


@njit
def cosine_at(normal, direction):  # type: ignore[no-untyped-def]
    """Cosine of a direction and a normal. For probes, whose normal is 0, a quarter: over pi that is the density of a
    direction uniform over the sphere, so the formulas for surfaces hold."""
    if normal[0] == ZERO and normal[1] == ZERO and normal[2] == ZERO:
        return QUARTER
    return dot(normal, direction)


@njit(error_model="numpy")
def _to_light(light, origin, u, v):  # type: ignore[no-untyped-def]
    """(direction, strength, reach) of a ray to a point of a sun, point, sphere or spot light."""
    if light[KIND] == SUN:
        return to_sun(light, u, v), ONE, INFINITY
    return to_lamp(light, origin, u, v)


@njit(error_model="numpy")
def _to_emitter(tables, origin, normal, u, v, chance, selected):  # type: ignore[no-untyped-def]
    """(direction, (r, g, b), reach) of a ray to a point of an emitting face, weighted against scattered rays that hit
    it."""
    face = tables.emitters[choose(tables.emitter_shares, np.float64(chance))]
    i, j, k = tables.faces[face, 0], tables.faces[face, 1], tables.faces[face, 2]
    root = np.sqrt(u)
    b, c = root * (ONE - v), root * v
    a = ONE - b - c
    vertices = tables.vertices
    point = (
        a * vertices[i, 0] + b * vertices[j, 0] + c * vertices[k, 0],
        a * vertices[i, 1] + b * vertices[j, 1] + c * vertices[k, 1],
        a * vertices[i, 2] + b * vertices[j, 2] + c * vertices[k, 2],
    )
    way = along(point, -ONE, origin)
    squared = dot(way, way)
    distance = np.sqrt(squared)
    direction = scaled(ONE / distance, way)
    planes = tables.planes
    away = np.float32(
        -(direction[0] * planes[face, 0] + direction[1] * planes[face, 1] + direction[2] * planes[face, 2])
    )
    cosine = cosine_at(normal, direction)
    if not (away > ZERO and cosine > ZERO):
        return direction, _NONE, ZERO
    by_chance = cosine / PI
    aimed = selected * tables.emitter_density[face] * squared / away
    share = by_chance / (by_chance + aimed)
    carried = share * tables.emission[face, 0], share * tables.emission[face, 1], share * tables.emission[face, 2]
    return direction, carried, distance * ALMOST


@njit(error_model="numpy")
def _to_sky(tables, normal, u, v, chance, selected):  # type: ignore[no-untyped-def]
    """(direction, (r, g, b)) of a ray into the sky, more often to where it is bright."""
    rows, columns = tables.sky_density.shape
    cell = choose(tables.sky_shares, np.float64(chance))
    row, column = cell // columns, cell % columns
    # Uniform in solid angle within the cell.
    upper, lower = np.cos(np.pi * row / rows), np.cos(np.pi * (row + 1) / rows)
    height = np.float32(upper + (lower - upper) * u)
    radius = np.sqrt(max(ZERO, ONE - height * height))
    x, y = circle((np.float32(column) + v) / np.float32(columns))
    direction = -radius * y, height, radius * x  # column 0 looks along +z, the middle one along -z
    cosine = cosine_at(normal, direction)
    if not cosine > ZERO:
        return direction, _NONE
    by_chance = cosine / PI
    aimed = selected * tables.sky_density[row, column]
    share = by_chance / aimed if tables.sky_by == GIVES_LIGHT else by_chance / (by_chance + aimed)
    return direction, scaled(share, sky_colour(tables, direction))


@njit(error_model="numpy")
def sky_share(tables, direction, cosine, selected):  # type: ignore[no-untyped-def]
    """The weight of the sky's light for a scattered ray, where rays are also aimed at the sky."""
    if tables.sky_by == GIVES_BSDF:
        return ONE
    if tables.sky_by == GIVES_LIGHT:
        return ZERO
    rows, columns = tables.sky_density.shape
    height = max(-1.0, min(1.0, np.float64(direction[1])))
    row = min(np.int64(np.arccos(height) / np.pi * rows), rows - 1)
    turns = 0.5 + np.arctan2(np.float64(direction[0]), -np.float64(direction[2])) / (2.0 * np.pi)
    column = min(np.int64(turns * columns), columns - 1)
    by_chance = cosine / PI
    return by_chance / (by_chance + selected * tables.sky_density[row, column])


@njit(error_model="numpy")
def emitter_share(tables, face, away, cosine, squared, selected):  # type: ignore[no-untyped-def]
    """As `sky_share`, for a scattered ray that hits an emitting face. away: cosine at the face. squared: of the
    distance."""
    by_chance = cosine / PI
    return by_chance / (by_chance + selected * tables.emitter_density[face] * squared / away)


@float_kernel
def aim_at_sun(batch, count, light, which, vertex):  # type: ignore[no-untyped-def]
    """As `aim`, to light `which`, a sun; without branches, so that it vectorises. light: its words."""
    floats = batch.floats
    first = np.uint32((vertex + 1) * _LIGHTS_OF_A_VERTEX + _PAIRS * which)
    for i in range(count):
        u, v = pair_of(batch.sequence[i], batch.sample[i], first + np.uint32(1))
        direction = to_sun(light, u, v)
        strength = max(ZERO, cosine_at(vector(floats, NORMAL, i), direction))
        red = strength * light[COLOUR] * floats[WEIGHT, i]
        green = strength * light[COLOUR + 1] * floats[WEIGHT + 1, i]
        blue = strength * light[COLOUR + 2] * floats[WEIGHT + 2, i]
        arrives = (batch.alive[i] != 0) & (max(red, green, blue) > ZERO)
        set_vector(floats, DIRECTION, i, direction)
        set_vector(floats, CARRIED, i, (red, green, blue))
        floats[LENGTH, i] = INFINITY if arrives else ZERO


@float_kernel
def aim(batch, count, tables, given, vertex):  # type: ignore[no-untyped-def]
    """Aim a ray from each path's vertex at light `given`, or at a random one if that is -1.

    vertex: 0 at the texel, then the number of bounces. Writes direction, carried light and reach.
    """
    floats = batch.floats
    for i in range(count):
        floats[LENGTH, i] = ZERO
        if batch.alive[i] == 0:
            continue
        row, selected, sequence, sample = given, ONE, batch.sequence[i], batch.sample[i]
        origin, normal = vector(floats, ORIGIN, i), vector(floats, NORMAL, i)
        first = np.uint32((vertex + 1) * _LIGHTS_OF_A_VERTEX)
        if given >= 0:
            first += np.uint32(_PAIRS * given)
        chance, choice = pair_of(sequence, sample, first)
        u, v = pair_of(sequence, sample, first + np.uint32(1))
        if given < 0:
            row, selected = chosen(tables, cell_of(tables, origin), choice)
        kind = tables.lights[row, KIND]
        if kind == EMITTERS:
            direction, carried, reach = _to_emitter(tables, origin, normal, u, v, chance, selected)
        elif kind == SKY:
            direction, carried = _to_sky(tables, normal, u, v, chance, selected)
            reach = INFINITY
        else:
            light = tables.lights[row]
            direction, strength, reach = _to_light(light, origin, u, v)
            strength *= max(ZERO, cosine_at(normal, direction)) / selected
            carried = scaled(strength, (light[COLOUR], light[COLOUR + 1], light[COLOUR + 2]))
        weight = vector(floats, WEIGHT, i)
        carried = carried[0] * weight[0], carried[1] * weight[1], carried[2] * weight[2]
        if max(carried[0], carried[1], carried[2]) > ZERO:
            set_vector(floats, DIRECTION, i, direction)
            set_vector(floats, CARRIED, i, carried)
            floats[LENGTH, i] = reach


@njit(forceinline=True)
def plane_of(vertex, kind):  # type: ignore[no-untyped-def]
    """The result that direct light of a kind is added to: at a texel (vertex 0) or after bounces."""
    if vertex > 0:
        return INDIRECT
    return ENVIRONMENT if kind == SKY else DIRECT
