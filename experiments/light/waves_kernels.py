"""Kernels of a wave: each is a stage that all paths pass together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY, MISS, START, hit_distance, hit_prim_id, intersect, set_no_hit
from atra.light.emitters.emitters_kernels import FROM_SKY
from atra.light.emitters.emitters_kernels import aim as aim_at_emitter
from atra.light.lightmaps.paths_kernels import (
    BACK,
    DIRECT,
    ENVIRONMENT,
    INDIRECT,
    OPEN,
    RESULTS,
    add_sample,
    place_in_texel,
    sequence_key,
    start_in,
    white_spot,
)
from atra.light.numbers_kernels import ONE, ZERO, scaled, set_vector, vector
from atra.light.pictures.path_kernels import (
    FREE_KIND,
    FREE_LIGHT,
    arriving,
    behind,
    load_ray,
    passed,
    passes_of,
    shadows,
    survival,
)
from atra.light.scattering.spots_kernels import WHITE, spot_of
from atra.light.scattering.spots_kernels import scatter as scatter_ray
from atra.light.surface_kernels import ENDS, SHINES, meet

ORIGIN, DIRECTION, WEIGHT, DENSITY, NEAR, PATH_ROWS = 0, 3, 6, 9, 10, 11
AIM_ORIGIN, AIM_DIRECTION, CARRIED, LENGTH, TOWARDS, ROWS = 11, 14, 17, 20, 21, 22

ROW_PADDING = 80
"""Extra columns of a wave; rows a power of two apart would compete for the same cache sets."""

IDLE, AT_SURFACE, PASSING = 0, 1, 2


class Wave(NamedTuple):
    """Room for N paths and the results of N samples.

    floats: (ROWS, > N) float32: origin, unit direction and weight (r, g, b) of a path, the density of its direction,
    and where its ray starts, once traced the distance of its hit; then origin, unit direction, light (r, g, b), length,
    0 = none, and target of a ray to an emitter. prim_id: (N,) uint32, what a path is at. state: (N,) int8, IDLE,
    AT_SURFACE or PASSING a hole. bounce, passes: (N,) int32, surfaces and holes met. slot: (N,) int32, the sample's
    place. key, sample: (N,) uint32, of its random numbers. results: (N, RESULTS) float32, by slot.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    state: NDArray[np.int8]
    bounce: NDArray[np.int32]
    passes: NDArray[np.int32]
    slot: NDArray[np.int32]
    key: NDArray[np.uint32]
    sample: NDArray[np.uint32]
    results: NDArray[np.float32]


def new_wave(paths: int) -> Wave:
    """A wave with memory for so many paths."""
    floats, results = np.zeros((ROWS, paths + ROW_PADDING), np.float32), np.zeros((paths, RESULTS), np.float32)
    state, (prim_id, key, sample) = np.zeros(paths, np.int8), np.zeros((3, paths), np.uint32)
    bounce, passes, slot = np.zeros((3, paths), np.int32)
    return Wave(floats, prim_id, state, bounce, passes, slot, key, sample, results)


@float_kernel
def generate(wave, order, first, texels, expansion, samples, charts, surfaces):  # type: ignore[no-untyped-def]
    """Start `expansion` paths, side by side, of each of `texels` entries of `order` from place `first` on.

    order: (M,) int32, texel numbers, -1 = idle lanes. samples: (N,) int32, of each texel so far.
    """
    for k in range(texels):
        texel = order[first + k]
        for i in range(k * expansion, (k + 1) * expansion):
            wave.state[i], wave.slot[i] = IDLE if texel < 0 else AT_SURFACE, i
            wave.results[i] = ZERO
        if texel < 0:
            continue
        place = place_in_texel(charts, surfaces, texel)
        key, down = sequence_key(charts.number[texel], charts.seed), scaled(-ONE, place[5])
        for e in range(expansion):
            i, sample = k * expansion + e, samples[texel] + e
            wave.key[i], wave.sample[i], wave.prim_id[i] = key, sample, place[0]
            wave.bounce[i] = wave.passes[i] = 0
            set_vector(wave.floats, ORIGIN, i, start_in(surfaces, place, key, sample))
            set_vector(wave.floats, DIRECTION, i, down)
            set_vector(wave.floats, WEIGHT, i, WHITE)


@njit(forceinline=True)
def _spot(wave, i, surfaces):  # type: ignore[no-untyped-def]
    """(spot, is_front) where a path is; texels are white."""
    origin, direction = vector(wave.floats, ORIGIN, i), vector(wave.floats, DIRECTION, i)
    if wave.bounce[i] == 0:
        return white_spot(surfaces, wave.prim_id[i], origin, direction), True
    return spot_of(surfaces, wave.prim_id[i], origin, direction)


@float_kernel
def aim(wave, count, surfaces, emitters):  # type: ignore[no-untyped-def]
    """Aim a ray at an emitter from each path that is at a surface."""
    floats = wave.floats
    for i in range(count):
        floats[LENGTH, i] = ZERO
        if wave.state[i] == AT_SURFACE:
            spot, _ = _spot(wave, i, surfaces)
            length, origin, towards, light, kind = aim_at_emitter(
                surfaces, emitters, spot, wave.prim_id[i], vector(floats, DIRECTION, i), wave.key[i], wave.sample[i],
                wave.bounce[i],
            )  # fmt: skip
            floats[LENGTH, i], floats[TOWARDS, i] = length, kind
            set_vector(floats, AIM_ORIGIN, i, origin)
            set_vector(floats, AIM_DIRECTION, i, towards)
            set_vector(floats, CARRIED, i, light)


@njit(forceinline=True)
def _add(wave, i, plane, weight, light):  # type: ignore[no-untyped-def]
    for channel in range(3):
        wave.results[wave.slot[i], plane + channel] += weight[channel] * light[channel]


@float_kernel
def shine(wave, count, surfaces, scene, packet, free):  # type: ignore[no-untyped-def]
    """Add what aimed rays carry and nothing blocks. free: (FREE_ROWS, 1) float32. Returns rays traced."""
    floats, traced = wave.floats, 0
    for i in range(count):
        if not floats[LENGTH, i] > ZERO:
            continue
        traced += 1
        load_ray(packet, 1, 0, vector(floats, AIM_ORIGIN, i), vector(floats, AIM_DIRECTION, i), floats[LENGTH, i])
        packet.valid[0], free[FREE_KIND, 0] = -1, floats[TOWARDS, i]
        shadows(1, surfaces, scene, packet, free)
        red, green, blue = vector(free, FREE_LIGHT, 0)
        light = vector(floats, CARRIED, i)
        at_texel = ENVIRONMENT if floats[TOWARDS, i] == FROM_SKY else DIRECT
        plane = at_texel if wave.bounce[i] == 0 else INDIRECT
        _add(wave, i, plane, vector(floats, WEIGHT, i), (red * light[0], green * light[1], blue * light[2]))
    return traced


@float_kernel
def scatter(wave, count, surfaces, roulette):  # type: ignore[no-untyped-def]
    """Choose the next ray of each path at a surface, or end it. Returns how many go on."""
    floats, going = wave.floats, 0
    for i in range(count):
        if wave.state[i] == AT_SURFACE:
            spot, is_front = _spot(wave, i, surfaces)
            key, sample, bounce = wave.key[i], wave.sample[i], wave.bounce[i]
            goes_on, origin, direction, factor, density = scatter_ray(
                surfaces, spot, is_front, wave.prim_id[i], vector(floats, DIRECTION, i), key, sample, bounce
            )
            weight = vector(floats, WEIGHT, i)
            weight = weight[0] * factor[0], weight[1] * factor[1], weight[2] * factor[2]
            if bounce > 0 and bounce >= roulette and goes_on:
                share = survival(weight, key, sample, bounce)
                goes_on = share != ZERO
                weight = scaled(share, weight)
            wave.state[i], wave.bounce[i] = AT_SURFACE if goes_on else IDLE, bounce + 1
            set_vector(floats, ORIGIN, i, origin)
            set_vector(floats, DIRECTION, i, direction)
            set_vector(floats, WEIGHT, i, weight)
            floats[DENSITY, i], floats[NEAR, i] = density, START
        going += wave.state[i] != IDLE
    return going


@float_kernel
def trace(wave, count, scene, packet):  # type: ignore[no-untyped-def]
    """Find what all paths meet. Returns rays traced."""
    traced = 0
    for i in range(count):
        if wave.state[i] == IDLE:
            continue
        traced += 1
        origin, way = vector(wave.floats, ORIGIN, i), vector(wave.floats, DIRECTION, i)
        load_ray(packet, 1, 0, origin, way, INFINITY, wave.floats[NEAR, i])
        packet.valid[0] = -1
        set_no_hit(packet, 1, 0)
        intersect(1, packet.valid, scene, packet)
        wave.prim_id[i], wave.floats[NEAR, i] = hit_prim_id(packet, 1, 0), hit_distance(packet, 1, 0)
    return traced


@float_kernel
def shade(wave, count, surfaces, emitters, max_depth, open_length):  # type: ignore[no-untyped-def]
    """Add the light of what paths meet, let them pass holes, end them at the last. Returns how many go on."""
    floats, going = wave.floats, 0
    for i in range(count):
        if wave.state[i] == IDLE:
            continue
        prim_id, bounce = wave.prim_id[i], wave.bounce[i]
        origin, direction, weight = vector(floats, ORIGIN, i), vector(floats, DIRECTION, i), vector(floats, WEIGHT, i)
        flags = surfaces.flags[prim_id] if prim_id != MISS else ENDS | SHINES
        if flags & passes_of(bounce):
            random = wave.key[i], wave.sample[i], wave.passes[i] + bounce
            goes_on, weight = passed(surfaces, prim_id, origin, direction, weight, False, random)
            set_vector(floats, WEIGHT, i, weight)
            if goes_on:
                floats[NEAR, i], wave.state[i] = behind(floats[NEAR, i]), PASSING
                wave.passes[i] += 1
                going += 1
                continue
        if bounce == 1:
            wave.results[wave.slot[i], OPEN] = ZERO if floats[NEAR, i] < open_length else ONE
            is_back = prim_id != MISS and not meet(surfaces, prim_id, origin, direction)[2]
            wave.results[wave.slot[i], BACK] = ONE if is_back else ZERO
        if flags & SHINES:
            light = arriving(surfaces, emitters, prim_id, origin, direction, floats[DENSITY, i])
            plane = INDIRECT if bounce > 1 else ENVIRONMENT if prim_id == MISS else DIRECT
            _add(wave, i, plane, weight, light)
        is_over = flags & ENDS or bounce == max_depth - 1
        wave.state[i] = IDLE if is_over else AT_SURFACE
        going += wave.state[i] != IDLE
    return going


@float_kernel
def compact(wave, count):  # type: ignore[no-untyped-def]
    """Move the paths that go on to the front, in order; returns their number."""
    kept = 0
    for i in range(count):
        if wave.state[i] != IDLE:
            if kept != i:
                for row in range(PATH_ROWS):
                    wave.floats[row, kept] = wave.floats[row, i]
                wave.prim_id[kept], wave.state[kept], wave.slot[kept] = wave.prim_id[i], wave.state[i], wave.slot[i]
                wave.bounce[kept], wave.passes[kept] = wave.bounce[i], wave.passes[i]
                wave.key[kept], wave.sample[kept] = wave.key[i], wave.sample[i]
            kept += 1
    return kept


@float_kernel
def gather(wave, order, first, texels, expansion, samples, sums):  # type: ignore[no-untyped-def]
    """Add results to the sums of their texels, sample by sample, and count them; returns whether all are finite."""
    is_finite = True
    for k in range(texels):
        texel = order[first + k]
        if texel < 0:
            continue
        for e in range(expansion):
            one = wave.results[k * expansion + e]
            direct, later, sky = (one[0], one[1], one[2]), (one[3], one[4], one[5]), (one[6], one[7], one[8])
            is_open, is_back = one[OPEN] > ZERO, one[BACK] > ZERO
            is_finite &= add_sample(sums, texel, samples[texel] + e, direct, later, sky, is_open, is_back)
        samples[texel] += expansion
    return is_finite
