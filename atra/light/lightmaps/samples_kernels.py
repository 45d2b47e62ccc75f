"""Kernels of samples: the first rays of texels, and the sums of results."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import prefetch
from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY
from atra.light.lightmaps.charts.texels_kernels import corners_of, edges_of, point_at, slopes_of, weights_at
from atra.light.lightmaps.gather.tables_kernels import (
    DIRECT,
    ENVIRONMENT,
    INDIRECT,
    LUMINANCE,
    NORMAL,
    ORIGIN,
    RESULTS,
    SQUARE,
    WEIGHT,
    note_doubling,
)
from atra.light.numbers_kernels import ZERO, key_of, mixed, set_vector
from atra.light.scattering.sampler_kernels import pair_of
from atra.light.scattering.spots_kernels import WHITE

_GOLDEN = np.uint32(0x9E3779B9)

PLACE = 0
"""The pair of evenly spread numbers for the place in a texel."""

AHEAD = 16
"""Faces are prefetched this many texels ahead, their corners half as many."""

LARGE = 1 << 13
"""Smallest mesh, in faces, with prefetching; smaller ones fit the cache anyway."""

INSET = 2.0
"""Distance of points from a triangle's rim, where another surface may stand, in offsets of rays."""


@njit
def sample_key(number, sample, seed):  # type: ignore[no-untyped-def]
    """A uint32 key for a sample of a texel or probe."""
    return key_of(np.uint32(number), mixed(np.uint32(np.uint32(sample) * _GOLDEN + seed)))


@njit
def sequence_key(number, seed):  # type: ignore[no-untyped-def]
    """A uint32 key for the evenly spread numbers of all samples of a texel or probe."""
    return key_of(np.uint32(number), mixed(np.uint32(seed)))


@njit(forceinline=True)
def fetch_row(array, row):  # type: ignore[no-untyped-def]
    """Prefetch a row of up to two cache lines."""
    address = np.int64(array.ctypes.data) + np.int64(row) * array.strides[0]
    prefetch(address)
    prefetch(address + array.strides[0] - 1)


@njit(forceinline=True)
def _fetch_ahead(order, place, end, prim_id, tables):  # type: ignore[no-untyped-def]
    """Prefetch what the texels after place `place` of the order will read."""
    if place + AHEAD < end and order[place + AHEAD] >= 0:
        face = prim_id[order[place + AHEAD]]
        fetch_row(tables.uv, face)
        fetch_row(tables.planes, face)
        fetch_row(tables.faces, face)
    if place + AHEAD // 2 < end and order[place + AHEAD // 2] >= 0:
        face = prim_id[order[place + AHEAD // 2]]
        for corner in range(3):
            fetch_row(tables.vertices, tables.faces[face, corner])


@float_kernel
def generate(batch, order, first, texels, expansion, samples, prim_of, tables):  # type: ignore[no-untyped-def]
    """Write the first rays of `texels` entries of `order` from place `first` on, `expansion` of each, side by side.

    order: (M,) int32, texel numbers, -1 = an idle lane. samples: (N,) int32, of each texel so far. prim_of: (N,) int32
    prim_ids and (N,) int64 numbers on the map.
    """
    prim_id, number = prim_of
    offset, planes = tables.offset, tables.planes
    batch.results[: texels * expansion] = ZERO
    for k in range(texels):
        if len(planes) > LARGE:
            _fetch_ahead(order, first + k, first + texels, prim_id, tables)
        texel = order[first + k]
        start = np.uint64(k * expansion)  # unsigned: Numba does not vectorise indices that may be negative
        for e in range(expansion):
            i = start + np.uint64(e)
            batch.slot[i] = i
            batch.alive[i] = 0 if texel < 0 else 1
        if texel < 0:
            continue
        place, face = number[texel], prim_id[texel]
        row = place // tables.width
        column = place - row * tables.width
        edges, corners = edges_of(tables.uv, face), corners_of(tables.vertices, tables.faces, face)
        slopes = slopes_of(edges)
        nx, ny, nz = planes[face, 0], planes[face, 1], planes[face, 2]
        normal = np.float32(nx), np.float32(ny), np.float32(nz)
        sample, sequence = samples[texel], sequence_key(place, tables.seed)
        for e in range(expansion):
            i = start + np.uint64(e)
            batch.key[i] = sample_key(place, sample + e, tables.seed)
            batch.sequence[i], batch.sample[i] = sequence, sample + e
            x, y = pair_of(sequence, sample + e, PLACE)
            x, y = column + np.float64(x), row + np.float64(y)
            v, w = weights_at(edges, slopes, x, y)
            point = point_at(corners, v, w, INSET * offset)
            batch.floats[ORIGIN, i] = np.float32(point[0] + offset * nx)
            batch.floats[ORIGIN + 1, i] = np.float32(point[1] + offset * ny)
            batch.floats[ORIGIN + 2, i] = np.float32(point[2] + offset * nz)
            set_vector(batch.floats, NORMAL, i, normal)
            set_vector(batch.floats, WEIGHT, i, WHITE)


@float_kernel
def gather(batch, order, first, texels, expansion, samples, sums):  # type: ignore[no-untyped-def]
    """Add results to the sums of their texels, (N, SUMS) float64, sample by sample, and count them.

    Returns the number of a texel whose light is not finite, or -1.
    """
    bad = -1
    for k in range(texels):
        if k + AHEAD < texels:
            fetch_row(sums, max(order[first + k + AHEAD], 0))
        texel = order[first + k]
        if texel < 0:
            continue
        for e in range(expansion):
            i = k * expansion + e
            luminance = ZERO
            for channel in range(3):
                light = (
                    batch.results[i, DIRECT + channel]
                    + batch.results[i, INDIRECT + channel]
                    + batch.results[i, ENVIRONMENT + channel]
                )
                luminance += LUMINANCE[channel] * light
            if not luminance < INFINITY:
                bad = texel
            for one in range(RESULTS):
                sums[texel, one] += batch.results[i, one]
            sums[texel, SQUARE] += np.float64(luminance) * luminance
            note_doubling(sums, texel, samples[texel] + e + 1)
        samples[texel] += expansion
    return bad
