"""Kernels of paths: directions, closest hits, bounces, and compaction."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.store import float_kernel, njit
from atra.embree.layout import RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import INFINITY, MISS, hit_distance, hit_prim_id, intersect, set_no_hit
from atra.light.lightmaps.gather.choice_kernels import cell_of, odds_of
from atra.light.lightmaps.gather.lights_kernels import cosine_at, emitter_share, plane_of, sky_share
from atra.light.lightmaps.gather.tables_kernels import (
    BACK,
    DIRECT,
    DIRECTION,
    GIVES_BSDF,
    INDIRECT,
    NORMAL,
    OPEN,
    ORIGIN,
    SKY,
    WEIGHT,
)
from atra.light.lightmaps.paint_kernels import albedo_met, opacity_met
from atra.light.lightmaps.samples_kernels import AHEAD, LARGE, PLACE, fetch_row
from atra.light.numbers_kernels import ONE, ZERO, around, bits_of, mixed, on_sphere, scaled, set_vector, unit_of, vector
from atra.light.pictures.path_kernels import load_rays
from atra.light.scattering.sampler_kernels import pair_of
from atra.light.surface_kernels import sky_colour

_DIRECTIONS = PLACE + 1
"""The pair of evenly spread numbers for the direction at a path's first vertex; those of the next vertices follow."""


@float_kernel
def scatter(batch, count, vertex):  # type: ignore[no-untyped-def]
    """Choose a cosine-distributed direction for each path; those of a texel's samples are spread evenly."""
    pair = np.uint32(_DIRECTIONS + vertex)
    for i in range(count):
        if batch.alive[i] != 0:
            u, v = pair_of(batch.sequence[i], batch.sample[i], pair)
            set_vector(batch.floats, DIRECTION, i, around(vector(batch.floats, NORMAL, i), on_sphere(u, v)))


@njit
def _passes(tables, paint, batch, i, prim_id, vertex):  # type: ignore[no-untyped-def]
    """Whether a ray passes what it hits: a pane, if a hash of both says so."""
    if prim_id == MISS or tables.pane_bits[prim_id >> 3] >> np.uint8(prim_id & 7) & 1 == 0:
        return False
    number = unit_of(bits_of(np.uint32(batch.key[i] ^ mixed(np.uint32(prim_id))), np.uint32(vertex)))
    origin, direction = vector(batch.floats, ORIGIN, i), vector(batch.floats, DIRECTION, i)
    return number >= opacity_met(tables, paint, prim_id, origin, direction)


@cache
def trace_kernel(width: int, see_through: bool) -> Callable[..., int]:
    """Closest hits in packets of `width`; both arguments are constants in the compiled code. see_through: there are
    panes."""

    @float_kernel
    def trace(batch, count, tables, paint, vertex, scene, packet):  # type: ignore[no-untyped-def]
        """Find what all paths hit and how far away. Returns the number of rays traced."""
        traced = 0
        for first in range(0, count, width):
            lanes = min(width, count - first)
            rays = 0
            for lane in range(lanes):
                rays += batch.alive[first + lane] != 0
            if rays == 0:
                continue
            traced += rays
            load_rays(packet, width, batch.floats, ORIGIN, DIRECTION, first)
            for lane in range(width):
                packet.valid[lane] = -1 if lane < lanes and batch.alive[first + lane] != 0 else 0
                packet.floats[RAY_TFAR * width + lane] = INFINITY
                set_no_hit(packet, width, lane)
            left = rays
            while left > 0:
                intersect(width, packet.valid, scene, packet)
                left = 0
                for lane in range(lanes):
                    if packet.valid[lane] == 0:
                        continue
                    i = first + lane
                    prim_id, distance = hit_prim_id(packet, width, lane), hit_distance(packet, width, lane)
                    if see_through and _passes(tables, paint, batch, i, prim_id, vertex):
                        for channel in range(3):
                            batch.floats[WEIGHT + channel, i] *= tables.tint[prim_id, channel]
                        packet.floats[RAY_TNEAR * width + lane] = distance + np.float32(tables.offset)
                        packet.floats[RAY_TFAR * width + lane] = INFINITY
                        set_no_hit(packet, width, lane)
                        left += 1
                    else:
                        batch.prim_id[i], batch.distance[i] = prim_id, distance
                        packet.valid[lane] = 0
        return traced

    return trace


@njit(forceinline=True)
def _selected(tables, floats, path, vertex, light):  # type: ignore[no-untyped-def]
    """The probability that a ray from a path's vertex is aimed at a light; 1 at texels."""
    if vertex == 0:
        return ONE
    return odds_of(tables, cell_of(tables, vector(floats, ORIGIN, path)), light)


@float_kernel
def shade(batch, count, tables, paint, vertex, is_last):  # type: ignore[no-untyped-def]
    """Add the light of what paths hit; move them to their next vertex or end them. Returns how many continue.

    paint: as for `albedo_met`. is_last: none continues.
    """
    floats, planes = batch.floats, tables.planes
    aims_at_emitters, aims_at_sky = len(tables.emitters) > 0, tables.sky_by != GIVES_BSDF
    of_sky = len(tables.lights) - 1
    of_emitters = of_sky - aims_at_sky
    going = 0
    for i in range(count):
        if len(planes) > LARGE and i + AHEAD < count:
            coming = batch.prim_id[i + AHEAD]
            if batch.alive[i + AHEAD] != 0 and coming != MISS:
                fetch_row(planes, coming)
                fetch_row(tables.emission, coming)
                fetch_row(tables.albedo, coming)
        if batch.alive[i] == 0:
            continue
        slot, prim_id, distance = batch.slot[i], batch.prim_id[i], batch.distance[i]
        direction, weight = vector(floats, DIRECTION, i), vector(floats, WEIGHT, i)
        cosine = max(cosine_at(vector(floats, NORMAL, i), direction), np.float32(1e-12))
        if vertex == 0 and not distance < tables.open_length:
            batch.results[slot, OPEN] = ONE
        batch.alive[i] = 0
        if prim_id == MISS:
            light = sky_colour(tables, direction)
            if aims_at_sky:
                selected = _selected(tables, floats, i, vertex, of_sky)
                light = scaled(sky_share(tables, direction, cosine, selected), light)
            plane = plane_of(vertex, SKY)
            for channel in range(3):
                batch.results[slot, plane + channel] += weight[channel] * light[channel]
            continue
        nx, ny, nz = planes[prim_id, 0], planes[prim_id, 1], planes[prim_id, 2]
        facing = nx * direction[0] + ny * direction[1] + nz * direction[2]
        is_front = facing < 0.0
        if vertex == 0 and not is_front:
            batch.results[slot, BACK] = ONE
        shining = max(tables.emission[prim_id, 0], tables.emission[prim_id, 1], tables.emission[prim_id, 2])
        if is_front and shining > ZERO:
            share = ONE
            if aims_at_emitters:
                away = np.float32(-facing)
                selected = _selected(tables, floats, i, vertex, of_emitters)
                share = emitter_share(tables, prim_id, away, cosine, distance * distance, selected)
            plane = DIRECT if vertex == 0 else INDIRECT
            for channel in range(3):
                batch.results[slot, plane + channel] += weight[channel] * (share * tables.emission[prim_id, channel])
        if is_last:
            continue
        albedo = albedo_met(tables, paint, prim_id, vector(floats, ORIGIN, i), direction)
        red, green, blue = weight[0] * albedo[0], weight[1] * albedo[1], weight[2] * albedo[2]
        if not max(red, green, blue) > ZERO:
            continue
        side = 1.0 if is_front else -1.0
        ox, oy, oz = (
            np.float64(floats[ORIGIN, i]),
            np.float64(floats[ORIGIN + 1, i]),
            np.float64(floats[ORIGIN + 2, i]),
        )
        ahead = planes[prim_id, 3] - (nx * ox + ny * oy + nz * oz)
        t = ahead / facing if facing != 0.0 else np.float64(distance)
        off = tables.offset * side
        floats[ORIGIN, i] = np.float32(ox + t * direction[0] + off * nx)
        floats[ORIGIN + 1, i] = np.float32(oy + t * direction[1] + off * ny)
        floats[ORIGIN + 2, i] = np.float32(oz + t * direction[2] + off * nz)
        set_vector(floats, NORMAL, i, (np.float32(side * nx), np.float32(side * ny), np.float32(side * nz)))
        set_vector(floats, WEIGHT, i, (red, green, blue))
        batch.alive[i] = 1
        going += 1
    return going


@float_kernel
def end_weak(batch, count, vertex):  # type: ignore[no-untyped-def]
    """Russian roulette: end a path by the share of light that it has lost. Returns how many continue.

    It comes after rays to lights: those from the last vertex of a path count in full, too.
    """
    floats, going = batch.floats, 0
    for i in range(count):
        red, green, blue = vector(floats, WEIGHT, i)
        most = max(red, green, blue)
        if batch.alive[i] != 0 and most < ONE:
            goes_on = unit_of(bits_of(batch.key[i], np.uint32(vertex))) < most
            batch.alive[i] = 1 if goes_on else 0
            set_vector(floats, WEIGHT, i, (red / most, green / most, blue / most))
        going += batch.alive[i]
    return going


@float_kernel
def compact(batch, count):  # type: ignore[no-untyped-def]
    """Move the paths that continue to the front, in order; returns their number. Directions and carried light are not
    kept, as the next stages write them."""
    floats, kept = batch.floats, 0
    for i in range(count):
        if batch.alive[i] != 0:
            if kept != i:
                for row in (ORIGIN, NORMAL, WEIGHT):
                    set_vector(floats, row, kept, vector(floats, row, i))
                batch.key[kept], batch.slot[kept], batch.alive[kept] = batch.key[i], batch.slot[i], 1
                batch.sequence[kept], batch.sample[kept] = batch.sequence[i], batch.sample[i]
            kept += 1
    return kept
