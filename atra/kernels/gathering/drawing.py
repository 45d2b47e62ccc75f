"""Drawing all hits: band after band of the image, every cluster that may be seen there, whatever is in front of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.gathering.layers import finish_layers
from atra.kernels.gathering.narrow import take_narrow
from atra.kernels.gathering.spans import take_spans
from atra.kernels.gathering.taking import LAYERS, THICKNESS, TRANSMITTANCE
from atra.kernels.gathering.target import Target, target_at
from atra.kernels.intrinsics import fetch_add, float_at
from atra.kernels.raster.culling import forget_tiles
from atra.kernels.raster.drawing import fetch_vertices, list_clusters, open_cluster
from atra.kernels.raster.image import Band
from atra.kernels.raster.memory import floats_at, identities_at, integers_at, store
from atra.kernels.raster.narrow import facing_of
from atra.kernels.raster.triangles import BATCH, CAP, LEFT, LIST_ROOM, RIGHT, set_up
from atra.kernels.raster.vectors import repeated


@njit(inline="always")
def _target_of(kind, image, band, band_rows, workspace):  # type: ignore[no-untyped-def]
    """What the hits of a band are taken into, by the pixels of the image: the image itself, or else memory that stays
    in the cache, if they are to be sorted."""
    values, prim_ids, counts = image.values, image.prim_ids, image.counts
    row, plane = image.row, image.plane
    if kind == LAYERS:
        plane = band_rows * row
        values = workspace.band - band.top * row * 4
        prim_ids = values + image.layers * plane * 4
        counts = prim_ids + image.layers * plane * 4
    return Target(values, prim_ids, counts, row, plane, image.layers, image.weights, 0, 0, 0)


@njit(inline="always")
def _clear(kind, lanes, band, target):  # type: ignore[no-untyped-def]
    """Set a band to what it is without a hit, where it will be drawn at once; layers by their counts alone."""
    first, end = band.top * target.row * 4, (band.bottom + 1) * target.row * 4
    if kind == LAYERS:
        for byte in range(first, end, lanes * 4):
            store(repeated(np.uint32(0), lanes), target.counts + byte)
    else:
        start = np.float32(1.0) if kind == TRANSMITTANCE else np.float32(0.0)
        for byte in range(first, end, lanes * 4):
            store(repeated(start, lanes), target.values + byte)


@cache
def gathering_kernel(lanes: int, parallel: bool, kind: int) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes; all three are constants of the compiled code."""
    half = max(lanes // 2, 4)
    has_depth, has_factors = kind in (THICKNESS, LAYERS), kind == TRANSMITTANCE

    @njit
    def gather_cluster(eye, clusters, cluster, width, band, workspace, target):  # type: ignore[no-untyped-def]
        count, prim_ids, vertices, vertex_count = open_cluster(parallel, eye, clusters, cluster, width, band, workspace)
        listed, floats, identities = integers_at(workspace.listed), floats_at(workspace.floats), identities_at(prim_ids)
        for batch in range(0, count, BATCH):
            ordinary = set_up(parallel, width, batch, band, workspace)[1]
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

    @kernel
    def gather_bands(counter_address, eye, clusters, rectangles, order, band_rows, width, height, workspace, block):  # type: ignore[no-untyped-def]
        """Take the hits of all bands, until the shared counter runs past the last.

        rectangles: of `cull_clusters`. order (N,) int64: the clusters that may be seen. block: of a `Target`; all of
        its image is written. What lies in a triangle is decided as in `atra.kernels.raster.drawing`.
        """
        image = target_at(block)
        nothing = np.float32(-np.inf if parallel else 0.0)
        forget_tiles(nothing, band_rows, width, workspace.tiles)  # all of them: nothing ever hides anything
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
                gather_cluster(eye, clusters, here[place], width, band, workspace, target)
            if kind == LAYERS:
                finish_layers(lanes, band.top, band.bottom, width, target, image)

    return gather_bands
