"""Drawing all hits: band after band of the image, every cluster that may be seen there, whatever is in front of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.all_hits.layers_kernels import finish_layers, finish_numbers
from atra.all_hits.taking_kernels import LAYERS, THICKNESS, TRANSMITTANCE
from atra.all_hits.target_kernels import Target, target_at
from atra.compiled.intrinsics import fetch_add, float_at
from atra.compiled.memory import floats_at, identities_at, integers_at, store
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import splat
from atra.raster.all_hits.narrow_kernels import take_narrow
from atra.raster.all_hits.spans_kernels import take_spans
from atra.raster.drawing import fetch_vertices, list_clusters, open_cluster
from atra.raster.image import Band
from atra.raster.narrow import facing_of
from atra.raster.triangles import BATCH, CAP, LEFT, LIST_ROOM, RIGHT, set_up

SPARE = 8
"""Hits of a pixel that are kept beside its layers until all are sorted, so that few pixels are ever full."""


@njit(forceinline=True)
def _target_of(kind, image, band, band_rows, workspace):  # type: ignore[no-untyped-def]
    """What the hits of a band are taken into, by the pixels of the image: memory that stays in the cache."""
    plane = band_rows * image.row
    layers = image.layers + SPARE if kind == LAYERS else 1
    values = workspace.band - band.top * image.row * 4
    prim_ids = values + layers * plane * 4
    counts = prim_ids + layers * plane * 4
    return Target(values, prim_ids, counts, image.row, plane, layers, image.weights, 0, 0, 0, 0)


@njit(forceinline=True)
def _clear(kind, lanes, band, target):  # type: ignore[no-untyped-def]
    """Set a band to what it is without a hit; layers by their counts alone."""
    first, end = band.top * target.row * 4, (band.bottom + 1) * target.row * 4
    if kind == LAYERS:
        for byte in range(first, end, lanes * 4):
            store(splat(np.uint32(0), lanes), target.counts + byte)
    else:
        start = np.float32(1.0) if kind == TRANSMITTANCE else np.float32(0.0)
        for byte in range(first, end, lanes * 4):
            store(splat(start, lanes), target.values + byte)


@njit(forceinline=True)
def _gather_cluster(  # type: ignore[no-untyped-def]
    kind, lanes, half, parallel, has_depth, has_factors, eye, clusters, cluster, width, band, workspace, target
):  # fmt: skip
    """Take what a cluster has in a band. half: pixels of a row of the blocks that small triangles are taken in."""
    count, prim_ids, vertices, vertex_count = open_cluster(parallel, eye, clusters, cluster, width, band, workspace)
    listed, floats, identities = integers_at(workspace.listed), floats_at(workspace.floats), identities_at(prim_ids)
    for batch in range(0, count, BATCH):
        ordinary = set_up(np.bool_(parallel), np.bool_(False), np.bool_(has_depth), width, batch, band, workspace)[1]
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
                take_spans(
                    kind, lanes, parallel, has_depth, has_factors, eye, vertices, vertex_count, weight, prim_id,
                    packed, width, band, workspace, target,
                )  # fmt: skip
                continue
            if kind == THICKNESS:
                weight = np.float32(facing_of(workspace.points, packed))
            if floats[RIGHT * BATCH + k] - floats[LEFT * BATCH + k] < half:
                take_narrow(
                    kind, lanes, half, parallel, has_depth, weight, prim_id, packed, k, workspace, target
                )  # fmt: skip
            else:
                take_narrow(
                    kind, lanes, lanes, parallel, has_depth, weight, prim_id, packed, k, workspace, target
                )  # fmt: skip


@cache
def gathering_kernel(lanes: int, parallel: bool, kind: int) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes; all three are constants of the compiled code."""
    half = max(lanes // 2, 4)
    has_depth, has_factors = kind in (THICKNESS, LAYERS), kind == TRANSMITTANCE

    @kernel
    def gather_bands(counter_address, eye, clusters, rectangles, order, band_rows, width, height, workspace, block):  # type: ignore[no-untyped-def]
        """Take the hits of all bands, until the shared counter runs past the last.

        rectangles: of `cull_clusters`. order (N,) int64: the clusters that may be seen. block: of a `Target`; all of
        its image is written. What lies in a triangle is decided as in `atra.raster.drawing`.
        """
        image = target_at(block)
        for place in range(LIST_ROOM):  # a batch reads beyond its list, and there has to be the corners of a triangle
            integers_at(workspace.listed)[place] = 0
        while True:
            top = fetch_add(counter_address, 1) * band_rows
            if top >= height:
                return
            band = Band(0, 0, 0, top, min(top + band_rows, height) - 1)
            target = _target_of(kind, image, band, band_rows, workspace)
            _clear(kind, lanes, band, target)
            here, count = integers_at(workspace.here), list_clusters(order, rectangles, band, workspace.here)
            for place in range(count):
                if place + 1 < count:
                    fetch_vertices(clusters, here[place + 1])
                _gather_cluster(
                    kind, lanes, half, parallel, has_depth, has_factors, eye, clusters, here[place], width, band,
                    workspace, target,
                )  # fmt: skip
            if kind == LAYERS:
                finish_layers(band.top, band.bottom, width, target, image)
            else:
                finish_numbers(band.top, band.bottom, width, target, image)

    return gather_bands
