"""The loop of `atra.raster.drawing` with a clock around each of its stages, and what it counts."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.all_hits.target_kernels import band_stride
from atra.compiled.intrinsics import fetch_add, ticks
from atra.compiled.memory import floats_at, identities_at, integers_at, stream
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import rarely, splat
from atra.raster.clusters import CLUSTER
from atra.raster.culling import find_farthest, forget_tiles, is_hidden
from atra.raster.drawing import STALE, clear, fetch_vertices, finish, list_clusters
from atra.raster.image import Band
from atra.raster.narrow import decide_narrow, decided, draw_narrow
from atra.raster.set_up import (
    COLUMN,
    FIRST,
    INSIDE,
    LAST,
    LEFT,
    RIGHT,
    ROUNDING,
    ROW,
    set_up,
)
from atra.raster.spans import draw_spans
from atra.raster.triangles import BATCH, LIST_ROOM, list_triangles, project_vertices

BANDS, TILES, HIDDEN, PROJECT, LIST, SET_UP, NARROW, SPANS, OUTPUT, DOUBTS = range(10)
"""Places of stages."""

STAGES = (
    "bands and their clusters", "depth tiles", "hidden clusters", "projection", "triangles that hold samples",
    "triangle set-up", "narrow triangles", "spans", "output", "exact doubts",
)  # fmt: skip

TIMED, HOT, COUNTED = range(3)
"""What a frame is drawn for. TIMED: the time of each stage. HOT: the time of each once more, at once, with all in the
first cache and all branches learned; triangles are drawn where everything is nearer. COUNTED: counts."""

_TIMES = 4
"""How often a hot stage is done; only the last counts."""


@njit(forceinline=True)
def _draw_batch(  # type: ignore[no-untyped-def]
    lanes, half, eye, clusters, cluster, batch, count, seen, ordinary, width, band, workspace
):  # fmt: skip
    """The drawing of a batch; returns the ticks that spans took. cluster: its vertices, their number, its prim_ids."""
    listed, floats, identities = (
        integers_at(workspace.listed), floats_at(workspace.floats), identities_at(cluster[2]),
    )  # fmt: skip
    taken = 0
    for k in range(min(BATCH, count - batch)):
        if not (seen >> k) & 1:
            continue
        packed = listed[batch + k]
        prim_id = identities[packed >> 48]
        if not (ordinary >> k) & 1:
            start = ticks()
            draw_spans(lanes, False, eye, clusters, cluster[0], cluster[1], prim_id, packed, width, band, workspace)
            taken += ticks() - start
            continue
        if floats[RIGHT * BATCH + k] - floats[LEFT * BATCH + k] < half:
            in_doubt = draw_narrow(half, False, False, eye, clusters, prim_id, packed, k, band, workspace)
        else:
            in_doubt = draw_narrow(lanes, False, False, eye, clusters, prim_id, packed, k, band, workspace)
        if rarely(in_doubt):
            decide_narrow(False, eye, clusters, prim_id, packed, k, band, workspace)
    return taken


@njit
def _count_batch(lanes, half, batch, count, seen, ordinary, band, workspace, counts):  # type: ignore[no-untyped-def]
    """Add up what is drawn of a batch: triangles, spans, rows, lanes, pixels of boxes, rows that `decided` decides."""
    values = floats_at(workspace.floats)
    for k in range(min(BATCH, count - batch)):
        if (seen >> k) & 1 and not (ordinary >> k) & 1:
            counts[SPANS] += 1
        elif (seen >> k) & 1:
            counts[NARROW] += 1
            across = int(values[RIGHT * BATCH + k] - values[LEFT * BATCH + k]) + 1
            down = int(values[LAST * BATCH + k] - values[FIRST * BATCH + k]) + 1
            wide = half if across <= half else lanes
            counts[10] += down
            counts[11] += down * -(-across // wide) * wide
            counts[12] += down * across
            for row in range(down):
                least = np.float32(np.inf)
                for column in range(across):
                    inside = np.float32(np.inf)
                    for edge in range(3):
                        inside = min(
                            inside,
                            values[(INSIDE + edge) * BATCH + k]
                            + np.float32(row) * values[(ROW + edge) * BATCH + k]
                            + np.float32(column) * values[(COLUMN + edge) * BATCH + k],
                        )
                    least = min(least, abs(inside))
                counts[DOUBTS] += least <= values[ROUNDING * BATCH + k]


@cache
def watched_kernel(lanes: int) -> Callable[..., None]:
    """The loop over bands of a pinhole camera, with vectors of so many lanes."""
    half = max(lanes // 2, 4)

    @kernel
    def draw(  # type: ignore[no-untyped-def]
        counter_address, eye, clusters, rectangles, bounds, order, band_rows, doubled, image, workspace, purpose,
        nearer, took, counts,
    ):  # fmt: skip
        """As `drawing_kernel`. nearer: address of a band of +inf, and of another. took: ticks of each stage. counts:
        what each handles, and after those rows, lanes and box pixels of narrow triangles."""
        stride, nothing, width = band_stride(image.width), np.float32(0.0), image.width
        most_rows = 2 * band_rows if doubled > 0 else band_rows
        clear(lanes, nothing, most_rows, stride, width, workspace.band)
        for place in range(LIST_ROOM):
            integers_at(workspace.listed)[place] = 0
        times = _TIMES if purpose == HOT else 1
        while True:
            number = fetch_add(counter_address, 1)
            rows = 2 * band_rows if number < doubled else band_rows
            top = (number + min(number, doubled)) * band_rows
            if top >= image.height:
                return
            bottom = min(top + rows, image.height) - 1
            band = Band(workspace.band, workspace.band + most_rows * stride * 4, stride, top, bottom)
            nowhere = Band(nearer, nearer + most_rows * stride * 4, stride, top, bottom)
            start = ticks()
            forget_tiles(nothing, rows, width, workspace.tiles)
            here, count = integers_at(workspace.here), list_clusters(order, rectangles, band, workspace.here)
            took[BANDS] += ticks() - start
            counts[BANDS] += len(order)
            unseen = 0
            for place in range(count):
                cluster = here[place]
                if place + 1 < count:
                    fetch_vertices(clusters, here[place + 1])
                if unseen >= STALE * rows:
                    spent = 0
                    for _ in range(times):
                        start = ticks()
                        find_farthest(band, width, workspace.tiles)
                        spent = ticks() - start
                    took[TILES] += spent
                    counts[TILES] += rows * width
                    unseen = 0
                first, last = max(rectangles[cluster, 2], top) - top, min(rectangles[cluster, 3], bottom) - top
                left, right, hides, spent = rectangles[cluster, 0], rectangles[cluster, 1], False, 0
                for _ in range(times):
                    start = ticks()
                    hides = is_hidden(left, right, first, last, bounds[cluster], width, workspace.tiles)
                    spent = ticks() - start
                took[HIDDEN] += spent
                counts[HIDDEN] += 1
                if hides:
                    continue
                firsts = integers_at(clusters.firsts)
                vertices, vertex_count = clusters.vertices + firsts[cluster] * 12, firsts[cluster + 1] - firsts[cluster]
                triangles = min(CLUSTER, clusters.triangles - cluster * CLUSTER)
                corners, prim_ids = clusters.corners + cluster * CLUSTER * 8, clusters.prim_ids + cluster * CLUSTER * 4
                in_front = False
                for _ in range(times):
                    start = ticks()
                    in_front = project_vertices(
                        np.bool_(False), vertices, vertex_count, vertex_count, eye, workspace.points
                    )
                    spent = ticks() - start
                took[PROJECT] += spent
                counts[PROJECT] += vertex_count
                found = 0
                for _ in range(times):
                    start = ticks()
                    found = list_triangles(
                        np.bool_(False), in_front, corners, triangles, workspace.points, width, band, workspace.listed
                    )
                    spent = ticks() - start
                took[LIST] += spent
                counts[LIST] += triangles
                counts[SET_UP] += found
                unseen += found
                whose = vertices, vertex_count, prim_ids
                for batch in range(0, found, BATCH):
                    seen = ordinary = 0
                    for _ in range(times):
                        start = ticks()
                        seen, ordinary = set_up(
                            False, np.bool_(False), np.bool_(True), np.bool_(True), 0.0, width, batch, band, workspace
                        )
                        spent = ticks() - start
                    took[SET_UP] += spent
                    if purpose == COUNTED:
                        _count_batch(lanes, half, batch, found, seen, ordinary, band, workspace, counts)
                    where, on_spans = band, 0
                    if purpose == HOT:
                        where = nowhere
                    for _ in range(times):
                        start = ticks()
                        on_spans = _draw_batch(
                            lanes, half, eye, clusters, whose, batch, found, seen, ordinary, width, where, workspace
                        )
                        spent = ticks() - start
                    took[NARROW] += spent - on_spans
                    took[SPANS] += on_spans
                    if purpose == HOT:
                        _draw_batch(
                            lanes, half, eye, clusters, whose, batch, found, seen, ordinary, width, band, workspace
                        )
            start = ticks()
            finish(lanes, np.bool_(False), nothing, band, image)
            took[OUTPUT] += ticks() - start
            counts[OUTPUT] += (bottom + 1 - top) * width

    return draw


@kernel
def decide_often(points, packed, lanes, exact, times):  # type: ignore[no-untyped-def]
    """Ticks of so many rows of samples that are decided exactly."""
    start, bits = ticks(), 0
    for time in range(times):
        bits ^= decided(points, packed, 0, time & 7, lanes, lanes, exact)
    return ticks() - start, bits


@kernel
def stream_often(address, size, times):  # type: ignore[no-untyped-def]
    """Ticks of writing `size` bytes past the caches so often. Address and size: multiples of 64."""
    start = ticks()
    for _ in range(times):
        for place in range(address, address + size, 64):
            stream(splat(np.float32(0.0), 16), place)
    return ticks() - start
