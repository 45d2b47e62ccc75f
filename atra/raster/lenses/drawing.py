"""Drawing through a lens: tile after tile of the image, and in it cluster after cluster, unless what is drawn already
hides it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from atra.all_hits.target_kernels import band_stride
from atra.compiled.intrinsics import fetch_add
from atra.compiled.memory import doubles_at, floats_at, identities_at, integers_at, load, store, store_where
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import (
    arange,
    bits_of,
    larger,
    mask_of,
    rarely,
    rounded,
    smaller,
    splat,
    where,
    widened,
)
from atra.prim_ids import MISS
from atra.raster.culling import TILE, find_farthest, forget_tiles, is_hidden
from atra.raster.drawing import fetch_vertices, open_cluster
from atra.raster.image import EYE_NUMBERS, SPAN, Band, eye_at
from atra.raster.lenses.culling import meets, place_cluster
from atra.raster.lenses.triangles import decided_of_lens, plane_through
from atra.raster.nearer import UNSURE_OF_LENS, Corners, without_farther_of_lens
from atra.raster.set_up import (
    CAP,
    COLUMN,
    FIRST,
    INSIDE,
    LAST,
    LEFT,
    LENS_FARTHEST,
    LENS_SLOPE_X,
    NEARNESS,
    RIGHT,
    ROW,
    SLOPE_Y,
    edges_at,
    rounding_of,
    set_up,
)
from atra.raster.triangles import BATCH, LIST_ROOM

_STALE = 256
"""Triangles listed until it is looked again what hides others."""

_LEVEL = 1e-12
"""Slope of an edge from column to column below which it cuts no row."""


class LensTiles(NamedTuple):
    """What `LensPlanes` says, for kernels. eyes: address of the numbers of each tile's `Eye`; least_depth as there.
    places: address of the places."""

    side: int
    columns: int
    eyes: int
    least_depth: float
    places: int


@njit
def _clear(lanes, side, stride, places, band):  # type: ignore[no-untyped-def]
    """Nothing is drawn yet. Samples without a ray are nearest, so that they count as hidden."""
    none, prim_ids = splat(np.uint32(MISS), lanes), band + side * stride * 4
    zero, nearest = splat(np.float32(0.0), lanes), splat(np.float32(np.inf), lanes)
    for place in range(0, side * stride * 4, lanes * 4):
        at = load(places + place, np.float32(0.0), lanes)
        store(where(at >= at, zero, nearest), band + place)  # NaN is no ray
        store(none, prim_ids + place)


@njit
def _finish(lanes, band, scales, left, top, side, image):  # type: ignore[no-untyped-def]
    """Write a tile to the image, nearness as depth. scales: address of the ray parameters at depth 1."""
    columns, rows = min(side, image.width - left), min(side, image.height - top)
    nothing, nearest = splat(np.float32(np.inf), lanes), splat(np.float32(np.inf), lanes)
    for row in range(rows):
        source, target = row * band.stride * 4, ((top + row) * image.width + left) * 4
        for x in range(0, columns // lanes * lanes * 4, lanes * 4):
            found = load(band.nearness + source + x, np.float32(0.0), lanes)
            scale = load(scales + source + x, np.float32(0.0), lanes)
            store(where(found >= nearest, nothing, scale / found), image.depth + target + x)
            store(load(band.prim_id + source + x, np.uint32(0), lanes), image.prim_id + target + x)
        for x in range(columns // lanes * lanes, columns):
            found, prim_id = floats_at(band.nearness + source)[x], identities_at(band.prim_id + source)[x]
            scale = floats_at(scales + source)[x]
            floats_at(image.depth + target)[x] = np.inf if prim_id == MISS else scale / found
            identities_at(image.prim_id + target)[x] = prim_id


@njit(forceinline=True)
def _limits(values, edge, slack):  # type: ignore[no-untyped-def]
    """Column in row 0, and what each row adds, before which all samples are outside of an edge; and from which on."""
    inside, column = values[(INSIDE + edge) * BATCH], values[(COLUMN + edge) * BATCH]
    across = -1.0 / column if abs(column) > _LEVEL else -1.0 / _LEVEL
    crossing, step = (inside + slack) * across, values[(ROW + edge) * BATCH] * across
    if across < 0.0:
        return crossing, step, np.inf, 0.0
    return -np.inf, 0.0, crossing, step


@njit
def _draw(lanes, numbers, mesh, k, prim_id, packed, is_gentle, side, margin, places, band, memory):  # type: ignore[no-untyped-def]
    """Draw the k-th triangle of a batch, with these corners, with vectors of `lanes`.

    Where a sum is within its rounding of 0, `decided_of_lens` decides; where what is drawn is as near but for float32's
    rounding, `without_farther_of_lens`. Nothing is drawn nearer than the nearest corner, whatever rounding makes of it.
    """
    values, doubles = floats_at(memory.floats + k * 4), doubles_at(memory.doubles + k * 8)
    left, right = int(values[LEFT * BATCH]), int(values[RIGHT * BATCH])
    first, last = int(values[FIRST * BATCH]), int(values[LAST * BATCH])
    along, down = doubles[LENS_SLOPE_X * BATCH], doubles[SLOPE_Y * BATCH]
    (inside0, inside1, inside2), (column0, column1, column2), (row0, row1, row2) = edges_at(values, lanes)
    nearest, farthest = values[CAP * BATCH], values[LENS_FARTHEST * BATCH]
    limit = np.float32(nearest * (1.0 + UNSURE_OF_LENS))
    above = splat(np.float32(1.0 + UNSURE_OF_LENS), lanes)
    below = splat(np.float32(1.0 - UNSURE_OF_LENS), lanes)
    if max(right - left, last - first) > TILE and is_hidden(left, right, first, last, limit, side, memory.tiles):
        return
    prim_ids, rounding = splat(prim_id, lanes), rounding_of(side, margin)
    surely, hardly = splat(rounding, lanes), splat(-rounding, lanes)
    plane, slack = side * band.stride * 4, margin + 2.0 * rounding
    begin, right_most, is_wide = left, right, right - left >= SPAN
    low0 = low1 = low2 = high0 = high1 = high2 = low_step0 = low_step1 = low_step2 = 0.0
    high_step0 = high_step1 = high_step2 = 0.0
    if is_wide:
        low0, low_step0, high0, high_step0 = _limits(values, 0, slack)
        low1, low_step1, high1, high_step1 = _limits(values, 1, slack)
        low2, low_step2, high2, high_step2 = _limits(values, 2, slack)
    nearness, row = doubles[NEARNESS * BATCH] + down * first, values[FIRST * BATCH]
    for y in range(first, last + 1):
        if is_wide:
            low = max(low0 + low_step0 * y, low1 + low_step1 * y, low2 + low_step2 * y, left)
            high = min(high0 + high_step0 * y, high1 + high_step1 * y, high2 + high_step2 * y, right)
            begin, right_most = int(low) // lanes * lanes, int(high)
        for start in range(begin, right_most + 1, lanes):
            base = start if lanes == SPAN else start // SPAN * SPAN if is_wide else left
            byte = (y * band.stride + start) * 4
            here = nearness + along * base
            steps = arange(np.float32(start - base), lanes)
            right_by = load(places + byte, np.float32(0.0), lanes)
            down_by = load(places + plane + byte, np.float32(0.0), lanes)
            i, j = arange(np.float32(start), lanes) + right_by, splat(row, lanes) + down_by
            inside = smaller(
                smaller((inside0 + i * column0) + j * row0, (inside1 + i * column1) + j * row1),
                (inside2 + i * column2) + j * row2,
            )
            if is_gentle:
                plain = splat(np.float32(here), lanes) + (steps + right_by) * splat(np.float32(along), lanes)
                found = smaller(splat(nearest, lanes), plain + down_by * splat(np.float32(down), lanes))
            else:
                wide = (arange(float(start - base), lanes) + widened(right_by)) * splat(along, lanes)
                wide = abs(splat(here, lanes) + wide + widened(down_by) * splat(down, lanes))
                found = smaller(larger(rounded(wide), splat(farthest, lanes)), splat(nearest, lanes))
            old = load(band.nearness + byte, np.float32(0.0), lanes)
            drawn = (inside > hardly) & (found * above >= old)
            close = found * below <= old
            if rarely(bits_of(drawn & ((inside <= surely) | close)) != 0):
                exactly = decided_of_lens(memory.points, packed, places + byte, places + plane + byte, start, y, lanes)
                undecided = bits_of(drawn & close) & exactly
                if undecided != 0:
                    exactly = without_farther_of_lens(
                        exactly, undecided, prim_id, band.prim_id + byte, numbers, mesh, start, y,
                        places + byte, places + plane + byte,
                    )  # fmt: skip
                drawn = drawn & mask_of(exactly, lanes)
            store_where(drawn, found, band.nearness + byte)
            store_where(drawn, prim_ids, band.prim_id + byte)
        nearness, row = nearness + down, row + np.float32(1.0)


@njit
def _draw_cluster(lanes, eye, clusters, cluster, side, margin, places, band, memory):  # type: ignore[no-untyped-def]
    """Draw what a cluster has in a tile; returns how many triangles were listed for it."""
    count, prim_ids, vertices, vertex_count = open_cluster(
        True, False, margin, eye, clusters, cluster, side, band, memory
    )
    listed, identities = integers_at(memory.listed), identities_at(prim_ids)
    mesh = Corners(clusters.mesh_vertices, clusters.mesh_faces)
    for batch in range(0, count, BATCH):
        may_be_seen, ordinary = set_up(True, False, True, True, margin, side, batch, band, memory)
        for k in range(min(BATCH, count - batch)):
            if not (may_be_seen >> k) & 1:
                continue
            packed, is_seen, is_gentle = listed[batch + k], True, True
            if not (ordinary >> k) & 1:
                is_seen, is_gentle = plane_through(eye, vertices, vertex_count, packed, k, margin, memory)
            if is_seen:
                prim_id = identities[packed >> 48]
                _draw(lanes, eye.position, mesh, k, prim_id, packed, is_gentle, side, margin, places, band, memory)
    return count


@njit
def _draw_tile(  # type: ignore[no-untyped-def]
    lanes, tile, tiles, cones, margin, balls, order, boxes, clusters, image, memory
):  # fmt: skip
    """Draw one tile, with the clusters that its cone meets."""
    side, stride = tiles.side, band_stride(tiles.side)
    numbers = tiles.eyes + tile * EYE_NUMBERS * 8
    eye = eye_at(numbers, tiles.least_depth)
    places = tiles.places + tile * 3 * side * stride * 4
    band = Band(memory.band, memory.band + side * stride * 4, stride, 0, side - 1)
    _clear(lanes, side, stride, places, memory.band)
    forget_tiles(np.float32(0.0), side, side, memory.tiles)
    here, count, listed = integers_at(memory.here), 0, 0
    for place in range(len(balls)):
        here[count] = place
        count += meets(balls, place, cones, tile)
    for k in range(count):
        cluster = order[here[k]]
        fetch_vertices(clusters, cluster)
        left, right, top, bottom, bound = place_cluster(boxes, cluster, eye, side, margin, cones[tile, 3])
        if right < left:
            continue
        if listed >= _STALE:
            find_farthest(band, side, memory.tiles)
            listed = 0
        if not is_hidden(left, right, top, bottom, bound, side, memory.tiles):
            listed += _draw_cluster(lanes, eye, clusters, cluster, side, margin, places, band, memory)
    scales = places + 2 * side * stride * 4
    _finish(lanes, band, scales, tile % tiles.columns * side, tile // tiles.columns * side, side, image)


@cache
def lens_drawing_kernel(lanes: int) -> Callable[..., None]:
    """The loop over tiles, with vectors of so many lanes, a constant of the compiled code."""

    @kernel
    def draw_tiles(  # type: ignore[no-untyped-def]
        counter_address, tiles, cones, margins, balls, order, boxes, clusters, image, memory
    ):  # fmt: skip
        """Draw all tiles, until the shared counter runs past the last.

        cones, margins: of `LensPlanes`, with cones in the world's axes. balls, order: of `balls_of`. boxes: of
        `Clusters`. image: written completely.
        Whatever the order, a sample gets the nearest triangle, and of several the lowest prim_id.
        """
        for place in range(LIST_ROOM):  # a batch reads beyond its list, and there has to be the corners of a triangle
            integers_at(memory.listed)[place] = 0
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(cones):
                return
            _draw_tile(lanes, tile, tiles, cones, margins[tile], balls, order, boxes, clusters, image, memory)

    return draw_tiles
