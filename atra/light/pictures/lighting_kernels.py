"""Kernels that light pixels: occlusion of rays to lights and into the sky, and sums of what arrives."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import ticks
from atra.compiled.memory import load, store, stream
from atra.compiled.store import float_kernel, float_part, njit
from atra.compiled.vectors import bits_of, splat, where
from atra.embree.layout import FLAG_COHERENT, RAY_DIR_X, RAY_ORG_X, RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    SMALLEST_COMPONENT,
    START,
    hit_distance,
    hit_prim_id,
    intersect,
    occluded,
    set_no_hit,
)
from atra.light.numbers_kernels import ONE, ZERO, unit
from atra.light.pictures.gbuffer_kernels import (
    CHUNK,
    COLOUR,
    DIRECTION,
    LANES,
    LENGTH,
    LIGHT,
    NORMAL,
    ORIGIN,
    SEEN,
    SKY,
    STRIDE,
    aim_at_light,
    aim_into_sky,
    fetch_ahead,
    find_surfaces,
    find_triangles,
    set_vector,
    vector_of,
)
from atra.light.pictures.path_kernels import behind, load_ray, passed, passes_of, path_key, pixel_line, shadows
from atra.light.scattering.spots_kernels import WHITE
from atra.light.surface_kernels import SHINES, emission_at

SKY_PLANES = LIGHT_PLANES = 4
"""Sums of the sky, and of each light: r, g, b, and the unblocked share."""

LAYER_PLANES = 6
"""Sums of layers: the base colour, 1 for the sky, then the shading normal, 0 for the sky."""

STAGES = "surfaces", "generate", "shadow", "occlusion", "accumulate"
"""Names of `times`."""

_SURFACES, _GENERATE, _SHADOW, _OCCLUSION, _ACCUMULATE = range(5)

_MOST = np.finfo(np.float32).max


@njit(forceinline=True)
def _address(array):  # type: ignore[no-untyped-def]
    return np.int64(array.ctypes.data)


@njit(forceinline=True)
def _occlude(width, chunk, count, surfaces, scene, packet):  # type: ignore[no-untyped-def]
    """Set LIGHT to 0 where a chunk's rays are blocked, in packets of `width`, and to less where they pass holes. Pixels
    keep their lanes, so each has the same neighbours in every chunk."""
    floats = chunk.floats
    field = 4 * width
    rays, valid = _address(packet.floats), _address(packet.valid)
    zero, tiny = splat(ZERO, width), splat(SMALLEST_COMPONENT, width)
    every = load(_address(packet.all_lanes), ZERO, width)  # the bits of -1: all lanes valid
    store(splat(START, width), rays + RAY_TNEAR * field)
    for first in range(0, count, width):
        at = _address(floats) + 4 * first
        length = load(at + LENGTH * STRIDE * 4, ZERO, width)
        is_traced = length > zero
        if bits_of(is_traced) == 0:
            continue
        for axis in range(3):
            origin = load(at + (ORIGIN + axis) * STRIDE * 4, ZERO, width)
            direction = load(at + (DIRECTION + axis) * STRIDE * 4, ZERO, width)
            store(origin, rays + (RAY_ORG_X + axis) * field)
            store(where(abs(direction) >= tiny, direction, zero), rays + (RAY_DIR_X + axis) * field)
        store(length, rays + RAY_TFAR * field)
        store(where(is_traced, every, zero), valid)
        light = load(at + LIGHT * STRIDE * 4, ZERO, width)
        if surfaces.has_holes:
            shadows(width, surfaces, scene, packet, chunk.free)
            passing = light * load(_address(chunk.free), ZERO, width)  # materials shown let all colours pass alike
            store(where(is_traced, passing, light), at + LIGHT * STRIDE * 4)
            store(splat(START, width), rays + RAY_TNEAR * field)
            continue
        occluded(width, packet.valid, scene, packet)
        is_free = load(rays + RAY_TFAR * field, ZERO, width) >= zero
        store(where(is_free, light, zero), at + LIGHT * STRIDE * 4)


@njit(forceinline=True)
def look_through(width, chunk, first, count, pixels, surfaces, scene, packet):  # type: ignore[no-untyped-def]
    """Put what `count` pixels from number `first` on see behind triangles that the eye may look through into the
    chunk. Returns the number of rays, traced by packets of `width`."""
    rays, eye = 0, passes_of(0)
    for i in range(count):
        prim_id = chunk.prim_id[i]
        if chunk.floats[SEEN * STRIDE + i] == ZERO or not surfaces.flags[prim_id] & eye:
            continue
        origin, direction = pixel_line(pixels, first + i)
        direction, distance, passes = unit(direction), START, 0
        while prim_id != MISS and surfaces.flags[prim_id] & eye:
            random = path_key(first + i), pixels.sample, passes
            goes_on, _ = passed(surfaces, prim_id, origin, direction, WHITE, True, random)
            if not goes_on:
                break
            before = prim_id
            while prim_id == before and prim_id != MISS:
                for lane in range(width):
                    packet.valid[lane] = -1 if lane == 0 else 0
                load_ray(packet, width, 0, origin, direction, INFINITY, behind(distance))
                set_no_hit(packet, width, 0)
                intersect(width, packet.valid, scene, packet)
                prim_id, distance = hit_prim_id(packet, width, 0), hit_distance(packet, width, 0)
            passes += 1
        rays += passes
        chunk.floats[SEEN * STRIDE + i] = ZERO if prim_id == MISS else ONE
        chunk.prim_id[i] = np.uint32(0) if prim_id == MISS else prim_id
    return rays


@njit(forceinline=True)
def _put(numbers, address, is_first):  # type: ignore[no-untyped-def]
    """Store numbers past the caches, or add them to those at an address."""
    if is_first:
        stream(numbers, address)
    else:
        store(load(address, ZERO, LANES) + numbers, address)


@float_part
def _add_light(floats, first, count, row, share, sums, is_first):  # type: ignore[no-untyped-def]
    """Add `share` of the light that arrived, times the colour in `row` and the next two, to four rows of sums.

    is_first: overwrite the sums without reading them. Returns whether all light was finite. Sums without new light are
    not touched, because memory traffic dominates.
    """
    zero, most, shares = splat(ZERO, LANES), splat(_MOST, LANES), splat(share, LANES)
    is_finite = zero >= zero
    for i in range(0, count, LANES):
        at = _address(floats) + 4 * i
        part = load(at + LIGHT * STRIDE * 4, ZERO, LANES) * shares
        is_lit = part > zero
        if bits_of(is_lit) == 0 and not is_first:
            continue
        to = _address(sums) + 4 * (first + i)
        for channel in range(3):
            colour = load(at + (row + channel) * STRIDE * 4, ZERO, LANES)
            arrived = where(is_lit, colour * part, zero)
            is_finite = is_finite & (most >= arrived)
            _put(arrived, to + channel * sums.strides[0], is_first)
        _put(where(is_lit, shares, zero), to + 3 * sums.strides[0], is_first)
    return bits_of(is_finite) == (1 << LANES) - 1


@float_part
def _find_emission(chunk, count, surfaces):  # type: ignore[no-untyped-def]
    """Replace SKY by what surfaces emit to the eye, and LIGHT by 1 where they do, else 0."""
    floats = chunk.floats
    for i in range(count):
        prim_id = np.int64(chunk.prim_id[i])
        shines = floats[SEEN * STRIDE + i] != ZERO and surfaces.flags[prim_id] & SHINES != 0
        floats[LIGHT * STRIDE + i] = ONE if shines and _is_front(floats, i, prim_id, surfaces) else ZERO
        if floats[LIGHT * STRIDE + i] != ZERO:
            set_vector(floats, SKY, i, emission_at(surfaces, prim_id, vector_of(floats, ORIGIN, i)))


@njit(forceinline=True)
def _is_front(floats, i, prim_id, surfaces):  # type: ignore[no-untyped-def]
    """Whether a pixel sees a triangle's front; normals face the eye."""
    records, ahead = surfaces.records, 0.0
    for axis in range(3):
        ahead += records[prim_id, axis] * floats[(NORMAL + axis) * STRIDE + i]
    return ahead > 0.0


@njit(forceinline=True)
def _lap(times, stage, start):  # type: ignore[no-untyped-def]
    """End a stage that began at `start`; returns the start of the next."""
    now = ticks()
    times[stage] += now - start
    return now


@cache
def lighting_kernel(width: int) -> Callable[..., int]:
    """All stages, in packets of `width`."""

    @float_kernel
    def light_pixels(  # type: ignore[no-untyped-def]
        first, count, pixels, surfaces, lights, to_lights, into_sky, is_cosine, query, chunk, sums, is_first, times
    ):  # fmt: skip
        """Add a sample of `count` pixels from number `first` on, chunk by chunk.

        lights: (L, LIGHT_WORDS) float32. to_lights, into_sky: `Aim`. sums: (SKY_PLANES + L LIGHT_PLANES, pixels)
        float32 of a `Film`, and LIGHT_PLANES more for what surfaces emit, if any do. is_first: overwrite the sums.
        times: (stages,) int64, ticks are added. Returns the number of rays traced, -1 if light was not finite.
        """
        floats, rays, is_finite = chunk.floats, 0, True
        clock = ticks()
        for start in range(first, first + count, CHUNK):
            some = min(CHUNK, first + count - start)
            fetch_ahead(start + CHUNK, first + count, pixels)
            find_triangles(chunk, start, some, pixels)
            if surfaces.is_looked_through:
                rays += look_through(width, chunk, start, some, pixels, surfaces, query.scene, query.packet)
            find_surfaces(chunk, start, some, pixels, surfaces)
            for i in range(some, some + LANES):  # no rays and no light behind the last pixel
                floats[LENGTH * STRIDE + i] = floats[LIGHT * STRIDE + i] = ZERO
            clock = _lap(times, _SURFACES, clock)
            query.flags[0] = FLAG_COHERENT
            share = ONE / np.float32(len(to_lights.points))
            for number in range(len(lights) * len(to_lights.points)):
                of_light = number // len(to_lights.points)
                point = number - of_light * len(to_lights.points)
                there = aim_at_light(floats, some, lights[of_light], to_lights, point)
                clock = _lap(times, _GENERATE, clock)
                if to_lights.is_traced:
                    rays += there
                    _occlude(width, chunk, some, surfaces, query.scene, query.packet)
                    clock = _lap(times, _SHADOW, clock)
                own = sums[SKY_PLANES + of_light * LIGHT_PLANES :]
                is_finite &= _add_light(floats, start, some, COLOUR, share, own, is_first and point == 0)
                clock = _lap(times, _ACCUMULATE, clock)
            query.flags[0] = 0
            share = ONE / np.float32(len(into_sky.points))
            for point in range(len(into_sky.points)):
                there = aim_into_sky(floats, start, some, is_cosine, into_sky, point)
                clock = _lap(times, _GENERATE, clock)
                if into_sky.is_traced:
                    rays += there
                    _occlude(width, chunk, some, surfaces, query.scene, query.packet)
                    clock = _lap(times, _OCCLUSION, clock)
                is_finite &= _add_light(floats, start, some, SKY, share, sums, is_first and point == 0)
                clock = _lap(times, _ACCUMULATE, clock)
            if len(sums) > SKY_PLANES + LIGHT_PLANES * len(lights):
                _find_emission(chunk, some, surfaces)
                own = sums[SKY_PLANES + LIGHT_PLANES * len(lights) :]
                is_finite &= _add_light(floats, start, some, SKY, ONE, own, is_first)
                clock = _lap(times, _ACCUMULATE, clock)
        return rays if is_finite else -1

    return light_pixels


@cache
def layers_kernel(width: int) -> Callable[..., None]:
    """The kernel that adds a sample to the sums of layers. width: rays of the scene's packets."""

    @float_kernel
    def add_layers(first, count, pixels, surfaces, scene, packet, chunk, sums):  # type: ignore[no-untyped-def]
        """Add what `count` pixels from number `first` on see to sums: (LAYER_PLANES, pixels) float32."""
        floats = chunk.floats
        for start in range(first, first + count, CHUNK):
            some = min(CHUNK, first + count - start)
            fetch_ahead(start + CHUNK, first + count, pixels)
            find_triangles(chunk, start, some, pixels)
            if surfaces.is_looked_through:
                look_through(width, chunk, start, some, pixels, surfaces, scene, packet)
            find_surfaces(chunk, start, some, pixels, surfaces)
            for i in range(some):
                is_seen = floats[SEEN * STRIDE + i] != ZERO
                for axis in range(3):
                    sums[axis, start + i] += floats[(COLOUR + axis) * STRIDE + i] if is_seen else ONE
                    sums[3 + axis, start + i] += floats[(NORMAL + axis) * STRIDE + i] if is_seen else ZERO

    return add_layers
