"""Drawing: band after band of the image, and in it cluster after cluster, unless what is drawn already hides it.

A band is so many rows that its part of the image stays in the cache of the thread that draws it. It decides alone
which clusters it needs, so that threads wait for each other once a frame only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.all_hits.target_kernels import band_stride
from atra.compiled.intrinsics import fetch_add
from atra.compiled.lanes import first_bit
from atra.compiled.memory import floats_at, identities_at, integers_at, load, prefetch, store, stream
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import rarely, splat
from atra.prim_ids import MISS
from atra.raster.clusters import CLUSTER
from atra.raster.culling import find_farthest, forget_tiles, is_hidden
from atra.raster.image import CACHE_LINE, Band
from atra.raster.narrow import decide_narrow, draw_narrow
from atra.raster.set_up import LEFT, RIGHT, set_up
from atra.raster.spans import draw_spans
from atra.raster.triangles import BATCH, LIST_ROOM, list_one_by_one, list_triangles, project_vertices

STALE = 16
"""Triangles listed, for each row of a band, until tiles are looked at again."""


@njit
def clear(lanes, nothing, rows, stride, width, band):  # type: ignore[no-untyped-def]
    """Nothing is drawn yet, and what lies beyond the image is nearest, so that it counts as hidden."""
    none, prim_ids = splat(np.uint32(MISS), lanes), band + rows * stride * 4
    for place in range(0, rows * stride, lanes):
        store(splat(nothing, lanes), band + place * 4)
        store(none, prim_ids + place * 4)
    for row in range(rows):
        for column in range(width, stride):
            floats_at(band)[row * stride + column] = np.inf


@njit
def finish(lanes, parallel, nothing, band, image):  # type: ignore[no-untyped-def]
    """Write the rows of a band to the image, nearness as depth, and leave nothing behind for the next band."""
    zero, one = splat(np.float32(0.0), lanes), splat(np.float32(1.0), lanes)
    farthest, none = splat(nothing, lanes), splat(np.uint32(MISS), lanes)
    whole = image.width // lanes * lanes
    is_aligned = (image.depth | image.prim_id | image.width * 4) % (lanes * 4) == 0
    for y in range(band.top, band.bottom + 1):
        nearness = band.nearness + (y - band.top) * band.stride * 4
        prim_id = band.prim_id + (y - band.top) * band.stride * 4
        target = y * image.width * 4
        for x in range(0, whole * 4, lanes * 4):
            found, prim_ids = load(nearness + x, np.float32(0.0), lanes), load(prim_id + x, np.uint32(0), lanes)
            depths = zero - found if parallel else one / found
            if is_aligned:
                stream(depths, image.depth + target + x)
                stream(prim_ids, image.prim_id + target + x)
            else:
                store(depths, image.depth + target + x)
                store(prim_ids, image.prim_id + target + x)
            store(farthest, nearness + x)
            store(none, prim_id + x)
        for x in range(whole, image.width):
            found = floats_at(nearness)[x]
            depth = np.float32(0.0) - found if parallel else np.float32(1.0) / found if found != 0.0 else np.inf
            floats_at(image.depth + target)[x], floats_at(nearness)[x] = depth, nothing
            identities_at(image.prim_id + target)[x] = identities_at(prim_id)[x]
            identities_at(prim_id)[x] = MISS


@njit
def list_clusters(order, rectangles, band, here):  # type: ignore[no-untyped-def]
    """List those of `order` whose rectangle meets the band, at an address of int64; returns how many."""
    list_, place = integers_at(here), 0
    for cluster in order:
        list_[place] = cluster
        place += (rectangles[cluster, 2] <= band.bottom) & (rectangles[cluster, 3] >= band.top)
    return place


@njit(forceinline=True)
def fetch_vertices(clusters, cluster):  # type: ignore[no-untyped-def]
    """Ask for the vertices of a cluster that may be drawn next."""
    firsts = integers_at(clusters.firsts)
    for place in range(firsts[cluster] * 12, firsts[cluster + 1] * 12, CACHE_LINE):
        prefetch(clusters.vertices + place)


@njit(forceinline=True)
def open_cluster(lens, parallel, margin, eye, clusters, cluster, width, band, memory):  # type: ignore[no-untyped-def]
    """List what a cluster may have in a band. Returns how many triangles, the addresses of its prim_ids and its
    vertices, and how many those are. lens, margin: as for `list_one_by_one`."""
    start, firsts = cluster * CLUSTER, integers_at(clusters.firsts)
    corners, prim_ids = clusters.corners + start * 8, clusters.prim_ids + start * 4
    for line in range(0, CLUSTER * 8, CACHE_LINE):
        prefetch(corners + line)
    for line in range(0, CLUSTER * 4, CACHE_LINE):
        prefetch(prim_ids + line)
    vertices, vertex_count = clusters.vertices + firsts[cluster] * 12, firsts[cluster + 1] - firsts[cluster]
    in_front = project_vertices(parallel, vertices, vertex_count, vertex_count, eye, memory.points)
    triangles = min(CLUSTER, clusters.triangles - start)
    if lens:
        count = list_one_by_one(True, corners, triangles, memory.points, margin, width, band, memory.listed)
    else:
        count = list_triangles(parallel, in_front, corners, triangles, memory.points, width, band, memory.listed)
    return count, prim_ids, vertices, vertex_count


@njit
def _draw_cluster(lanes, half, parallel, eye, clusters, cluster, width, band, memory):  # type: ignore[no-untyped-def]
    """Draw what a cluster has in a band; returns how many triangles were listed for it."""
    count, prim_ids, vertices, vertex_count = open_cluster(
        False, parallel, 0.0, eye, clusters, cluster, width, band, memory
    )
    listed, floats, identities = integers_at(memory.listed), floats_at(memory.floats), identities_at(prim_ids)
    for batch in range(0, count, BATCH):
        # np.bool_ of a constant is none for Numba: `set_up` is compiled once, for drawing and for all hits.
        may_be_seen, ordinary = set_up(
            False, np.bool_(parallel), np.bool_(True), np.bool_(True), 0.0, width, batch, band, memory
        )
        left = may_be_seen & ((1 << min(BATCH, count - batch)) - 1)
        while left != 0:  # by the bits that are set: a branch for each triangle would often be mispredicted
            k = first_bit(left)
            left &= left - 1
            packed = listed[batch + k]
            prim_id = identities[packed >> 48]
            if not (ordinary >> k) & 1:
                draw_spans(lanes, parallel, eye, clusters, vertices, vertex_count, prim_id, packed, width, band, memory)
                continue
            if floats[RIGHT * BATCH + k] - floats[LEFT * BATCH + k] < half:
                undecided = draw_narrow(half, parallel, False, eye, clusters, prim_id, packed, k, band, memory)
            else:
                undecided = draw_narrow(lanes, parallel, False, eye, clusters, prim_id, packed, k, band, memory)
            if rarely(undecided):
                decide_narrow(parallel, eye, clusters, prim_id, packed, k, band, memory)
    return count


@cache
def drawing_kernel(lanes: int, parallel: bool) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes, both constants of the compiled code."""
    half = max(lanes // 2, 4)

    @kernel
    def draw_bands(counter_address, eye, clusters, rectangles, bounds, order, band_rows, doubled, image, memory):  # type: ignore[no-untyped-def]
        """Draw all bands, until the shared counter runs past the last: `doubled` ones of 2 band_rows, then others.

        rectangles, bounds: of `cull_clusters`. order (N,) int64: the clusters to be drawn unless they are hidden, the
        nearest first. image: written completely.
        Whatever the order, a sample gets the nearest triangle, and of several the lowest prim_id.
        """
        stride, nothing = band_stride(image.width), np.float32(-np.inf if parallel else 0.0)
        most_rows = 2 * band_rows if doubled > 0 else band_rows
        clear(lanes, nothing, most_rows, stride, image.width, memory.band)
        for place in range(LIST_ROOM):  # a batch reads beyond its list, and there has to be the corners of a triangle
            integers_at(memory.listed)[place] = 0
        while True:
            number = fetch_add(counter_address, 1)
            rows = 2 * band_rows if number < doubled else band_rows
            top = (number + min(number, doubled)) * band_rows
            if top >= image.height:
                return
            bottom = min(top + rows, image.height) - 1
            band = Band(memory.band, memory.band + most_rows * stride * 4, stride, top, bottom)
            forget_tiles(nothing, rows, image.width, memory.tiles)
            here, count = integers_at(memory.here), list_clusters(order, rectangles, band, memory.here)
            listed = 0
            for place in range(count):
                cluster = here[place]
                if place + 1 < count:
                    fetch_vertices(clusters, here[place + 1])
                if listed >= STALE * rows:
                    find_farthest(band, image.width, memory.tiles)
                    listed = 0
                left, right = rectangles[cluster, 0], rectangles[cluster, 1]
                top = max(rectangles[cluster, 2], band.top) - band.top
                bottom = min(rectangles[cluster, 3], band.bottom) - band.top
                if not is_hidden(left, right, top, bottom, bounds[cluster], image.width, memory.tiles):
                    listed += _draw_cluster(lanes, half, parallel, eye, clusters, cluster, image.width, band, memory)
            finish(lanes, parallel, nothing, band, image)

    return draw_bands
