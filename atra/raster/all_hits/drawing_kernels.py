"""Drawing all hits: band after band of the image, every cluster that may be seen there, whatever is in front of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.all_hits.layers_kernels import finish_layers, finish_numbers
from atra.all_hits.taking_kernels import LAYERS, THICKNESS, TRANSMITTANCE, take
from atra.all_hits.target_kernels import Target, target_at
from atra.compiled.intrinsics import fetch_add, float_at
from atra.compiled.lanes import pixel_columns, pixel_rows
from atra.compiled.memory import doubles_at, floats_at, identities_at, integers_at, store
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import arange, bits_of, mask_of, rarely, smaller, splat, where
from atra.raster.all_hits.crossings_kernels import parallel_depth
from atra.raster.corners import from_eye, homogeneous
from atra.raster.drawing import fetch_vertices, list_clusters, open_cluster
from atra.raster.image import Band
from atra.raster.narrow import decided, winding
from atra.raster.set_up import (
    CAP,
    FIRST,
    LAST,
    LEFT,
    NEARNESS,
    RIGHT,
    ROUNDING,
    SLOPE_X,
    SLOPE_Y,
    edges_at,
    set_up,
)
from atra.raster.spans import find_spans, nearness_of
from atra.raster.triangles import BATCH, LIST_ROOM, corner_at

SPARE = 8
"""Hits of a pixel that are kept beside its layers until all are sorted, so that few pixels are ever full."""


@njit(forceinline=True)
def _target_of(kind, image, band, band_rows, memory):  # type: ignore[no-untyped-def]
    """What the hits of a band are taken into, by the pixels of the image: memory that stays in the cache."""
    plane = band_rows * image.row
    layers = image.layers + SPARE if kind == LAYERS else 1
    values = memory.band - band.top * image.row * 4
    prim_ids = values + layers * plane * 4
    counts = prim_ids + layers * plane * 4
    return Target(values, prim_ids, counts, image.row, plane, layers, image.weights, 0, 0, 0, 0)


@njit(forceinline=True)
def _clear(kind, lanes, band, target):  # type: ignore[no-untyped-def]
    """Set a band to what it is without a hit; layers by their counts alone."""
    cleared = target.counts if kind == LAYERS else target.values
    start = splat(np.float32(1.0) if kind == TRANSMITTANCE else np.float32(0.0), lanes)
    for byte in range(band.top * target.row * 4, (band.bottom + 1) * target.row * 4, lanes * 4):
        store(start, cleared + byte)


@njit(forceinline=True)
def _take_narrow(  # type: ignore[no-untyped-def]
    kind, lanes, nx, parallel, has_depth, weight, prim_id, packed, k, memory, target
):  # fmt: skip
    """Take the hits of an ordinary triangle, the k-th of its batch and with these corners, in blocks of `lanes` pixels
    in rows of nx, one or two. Blocks begin at even rows, so that none reaches into two bands.

    weight: as for `take`. What lies in the triangle, and how deep, is decided as by `draw_narrow`.
    """
    values, doubles = floats_at(memory.floats + k * 4), doubles_at(memory.doubles + k * 8)
    left, right = int(values[LEFT * BATCH]), int(values[RIGHT * BATCH])
    first, last, ny = int(values[FIRST * BATCH]), int(values[LAST * BATCH]), lanes // nx
    above = first % ny
    columns, rows = pixel_columns(lanes, nx), pixel_rows(lanes, nx) - splat(np.float32(above), lanes)
    surely, hardly = splat(values[ROUNDING * BATCH], lanes), splat(-values[ROUNDING * BATCH], lanes)
    (first0, first1, first2), (column0, column1, column2), (row0, row1, row2) = edges_at(values, lanes)
    within0, within1, within2 = first0 + rows * row0, first1 + rows * row1, first2 + rows * row2
    down = splat(np.float32(ny), lanes)
    below0, below1, below2 = down * row0, down * row1, down * row2
    nothing, one = splat(np.float32(0.0), lanes), splat(np.float32(1.0), lanes)
    slope, cap = splat(values[SLOPE_X * BATCH], lanes), splat(values[CAP * BATCH], lanes)
    slope_y = doubles[SLOPE_Y * BATCH]
    for start in range(left, right + 1, nx):
        along = columns + splat(np.float32(start - left), lanes)
        inside0, inside1, inside2 = within0 + along * column0, within1 + along * column1, within2 + along * column2
        along = along * slope
        pixel, row = (first - above) * target.row + start, doubles[NEARNESS * BATCH] - above * slope_y
        for y in range(first - above, last + 1, ny):
            inside = smaller(smaller(inside0, inside1), inside2)
            taken = inside > hardly
            if rarely(bits_of(taken & (inside <= surely)) != 0):
                exactly = decided(memory.points, packed, start, y, lanes, nx, memory.exact)
                taken = taken & mask_of(exactly, lanes)
            depth = nothing
            if has_depth:
                nearness = splat(np.float32(row), lanes)
                if ny == 2:
                    nearness = where(mask_of((1 << nx) - 1, lanes), nearness, splat(np.float32(row + slope_y), lanes))
                found = smaller(cap, nearness + along)
                depth = nothing - found if parallel else one / found
            take(kind, lanes, nx, taken, depth, weight, prim_id, pixel, target)
            inside0, inside1, inside2 = inside0 + below0, inside1 + below1, inside2 + below2
            pixel += ny * target.row
            row += ny * slope_y


@njit(forceinline=True)
def _take_spans(  # type: ignore[no-untyped-def]
    kind, lanes, parallel, has_depth, has_factors, eye, vertices, vertex_count, weight, prim_id, packed, width, band,
    memory, target,
):  # fmt: skip
    """Take what a band has of a triangle, with vectors of `lanes`. weight: taken if it is a factor.

    Others as for `draw_spans`.
    """
    spans = find_spans(parallel, eye, vertices, vertex_count, packed, width, band, memory)
    if spans.facing != 0:
        w0 = corner_at(memory.points, packed, 0)[2]
        w1 = corner_at(memory.points, packed, 1)[2]
        w2 = corner_at(memory.points, packed, 2)[2]
        facing = spans.facing
        if not parallel:  # each corner behind the eye turns the triangle over
            for w in (w0, w1, w2):
                facing = -facing if w < 0.0 else facing
        own = weight if has_factors else np.float32(facing)
        firsts, lasts = doubles_at(memory.first), doubles_at(memory.last)
        nothing, one = splat(np.float32(0.0), lanes), splat(np.float32(1.0), lanes)
        for k in range(spans.bottom - spans.top + 1):
            y, first, last = spans.top + k, int(firsts[k]), int(lasts[k])
            row = spans.slope_y * y + spans.constant
            pixel = y * target.row
            if parallel and spans.nearest >= 0.0:  # it reaches behind the image plane
                a = homogeneous(doubles_at(eye.to_pixels), from_eye(eye, vertices, vertex_count, packed, 0))
                b = homogeneous(doubles_at(eye.to_pixels), from_eye(eye, vertices, vertex_count, packed, 1))
                c = homogeneous(doubles_at(eye.to_pixels), from_eye(eye, vertices, vertex_count, packed, 2))
                for x in range(first, last + 1):
                    deep = np.float32(parallel_depth(a, b, c, w0, w1, w2, float(x), float(y)))
                    if deep > 0.0:
                        take(kind, 1, 1, mask_of(1, 1), splat(deep, 1), own, prim_id, pixel + x, target)
            else:
                before, end = splat(np.float32(first - 1), lanes), splat(np.float32(last), lanes)
                for start in range(first // lanes * lanes, last + 1, lanes):
                    columns = arange(np.float32(start), lanes)
                    depth = nothing
                    if has_depth:
                        found = nearness_of(parallel, lanes, spans, row, start)
                        depth = nothing - found if parallel else one / found
                    taken = (columns > before) & (columns <= end)
                    take(kind, lanes, lanes, taken, depth, own, prim_id, pixel + start, target)


@njit(forceinline=True)
def _gather_cluster(  # type: ignore[no-untyped-def]
    kind, lanes, half, parallel, has_depth, has_factors, eye, clusters, cluster, width, band, memory, target
):  # fmt: skip
    """Take what a cluster has in a band. half: pixels of a row of the blocks that small triangles are taken in."""
    count, prim_ids, vertices, vertex_count = open_cluster(
        False, parallel, 0.0, eye, clusters, cluster, width, band, memory
    )
    listed, floats, identities = integers_at(memory.listed), floats_at(memory.floats), identities_at(prim_ids)
    for batch in range(0, count, BATCH):
        ordinary = set_up(
            False, np.bool_(parallel), np.bool_(False), np.bool_(has_depth), 0.0, width, batch, band, memory
        )[1]
        for k in range(min(BATCH, count - batch)):
            packed = listed[batch + k]
            prim_id = identities[packed >> 48]
            weight = np.float32(0.0)
            if has_factors:
                weight = float_at(target.weights + np.int64(prim_id) * 4)
            is_ordinary = (ordinary >> k) & 1 != 0
            if parallel:
                is_ordinary = is_ordinary and floats[CAP * BATCH + k] < 0.0
            if not is_ordinary:
                _take_spans(
                    kind, lanes, parallel, has_depth, has_factors, eye, vertices, vertex_count, weight, prim_id,
                    packed, width, band, memory, target,
                )  # fmt: skip
                continue
            if kind == THICKNESS:
                weight = np.float32(winding(memory.points, packed))
            if floats[RIGHT * BATCH + k] - floats[LEFT * BATCH + k] < half:
                _take_narrow(
                    kind, lanes, half, parallel, has_depth, weight, prim_id, packed, k, memory, target
                )  # fmt: skip
            else:
                _take_narrow(
                    kind, lanes, lanes, parallel, has_depth, weight, prim_id, packed, k, memory, target
                )  # fmt: skip


@cache
def gathering_kernel(lanes: int, parallel: bool, kind: int) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes; all three are constants of the compiled code."""
    half = max(lanes // 2, 4)
    has_depth, has_factors = kind in (THICKNESS, LAYERS), kind == TRANSMITTANCE

    @kernel
    def gather_bands(counter_address, eye, clusters, rectangles, order, band_rows, width, height, memory, block):  # type: ignore[no-untyped-def]
        """Take the hits of all bands, until the shared counter runs past the last.

        rectangles: of `cull_clusters`. order (N,) int64: the clusters that may be seen. block: of a `Target`; all of
        its image is written. What lies in a triangle is decided as in `atra.raster.drawing`.
        """
        image = target_at(block)
        for place in range(LIST_ROOM):  # a batch reads beyond its list, and there has to be the corners of a triangle
            integers_at(memory.listed)[place] = 0
        while True:
            top = fetch_add(counter_address, 1) * band_rows
            if top >= height:
                return
            band = Band(0, 0, 0, top, min(top + band_rows, height) - 1)
            target = _target_of(kind, image, band, band_rows, memory)
            _clear(kind, lanes, band, target)
            here, count = integers_at(memory.here), list_clusters(order, rectangles, band, memory.here)
            for place in range(count):
                if place + 1 < count:
                    fetch_vertices(clusters, here[place + 1])
                _gather_cluster(
                    kind, lanes, half, parallel, has_depth, has_factors, eye, clusters, here[place], width, band,
                    memory, target,
                )  # fmt: skip
            if kind == LAYERS:
                finish_layers(band.top, band.bottom, width, target, image)
            else:
                finish_numbers(band.top, band.bottom, width, target, image)

    return gather_bands
