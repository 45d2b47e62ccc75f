"""Layers: the hits of each pixel, taken in any order, sorted when all are there and written to where they belong."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.gathering.lanes import chosen, is_below
from atra.kernels.gathering.taking import is_nearer
from atra.kernels.gathering.target import target_at
from atra.kernels.intrinsics import fetch_add
from atra.kernels.raster.memory import load, store, stream
from atra.kernels.raster.vectors import bits_of, repeated
from atra.prim_ids import MISS

_ROWS = 8
"""Rows a thread takes at a time."""


@njit
def _sort(lanes, pixel, target):  # type: ignore[no-untyped-def]
    """Sort the layers of `lanes` pixels; returns how many of them hold a hit. Lanes with fewer have anything there."""
    counts = load(target.counts + pixel * 4, np.uint32(0), lanes)
    farthest, nobody = repeated(np.float32(np.inf), lanes), repeated(np.uint32(MISS), lanes)
    plane = target.plane * 4
    for layer in range(target.layers):
        has_hit = is_below(repeated(np.uint32(layer), lanes), counts)
        if bits_of(has_hit) == 0:
            return layer
        place = pixel * 4 + layer * plane
        depth = chosen(has_hit, load(target.values + place, np.float32(0.0), lanes), farthest)
        prim_id = chosen(has_hit, load(target.prim_ids + place, np.uint32(0), lanes), nobody)
        for _ in range(layer):
            before = load(target.values + place - plane, np.float32(0.0), lanes)
            before_id = load(target.prim_ids + place - plane, np.uint32(0), lanes)
            nearer = is_nearer(depth, prim_id, before, before_id)
            if bits_of(nearer) == 0:
                break
            store(chosen(nearer, before, depth), target.values + place)
            store(chosen(nearer, before_id, prim_id), target.prim_ids + place)
            depth, prim_id = chosen(nearer, depth, before), chosen(nearer, prim_id, before_id)
            place -= plane
        store(depth, target.values + place)
        store(prim_id, target.prim_ids + place)
    return target.layers


@njit
def _write(lanes, numbers, address, is_aligned):  # type: ignore[no-untyped-def]
    if is_aligned:
        stream(numbers, address)
    else:
        store(numbers, address)


@njit
def finish_layers(lanes, top, bottom, width, taken, image):  # type: ignore[no-untyped-def]
    """Sort the rows top ... bottom of a `Target` of layers, `taken`, and write them to another, `image`, or the same;
    past the caches where its rows begin at cache lines. What no hit was taken for becomes none."""
    farthest, nobody = repeated(np.float32(np.inf), lanes), repeated(np.uint32(MISS), lanes)
    is_aligned = (image.values | image.prim_ids | image.counts | image.row * 4) % (lanes * 4) == 0
    for y in range(top, bottom + 1):
        most = 0
        for x in range(0, width, lanes):
            most = max(most, _sort(lanes, y * taken.row + x, taken))
            counts = load(taken.counts + (y * taken.row + x) * 4, np.uint32(0), lanes)
            _write(lanes, counts, image.counts + (y * image.row + x) * 4, is_aligned)
        for layer in range(image.layers):
            for x in range(0, width, lanes):
                place = (y * taken.row + x + layer * taken.plane) * 4
                target = (y * image.row + x + layer * image.plane) * 4
                depth, prim_id = farthest, nobody
                if layer < most:
                    counts = load(taken.counts + (y * taken.row + x) * 4, np.uint32(0), lanes)
                    has_hit = is_below(repeated(np.uint32(layer), lanes), counts)
                    depth = chosen(has_hit, load(taken.values + place, np.float32(0.0), lanes), farthest)
                    prim_id = chosen(has_hit, load(taken.prim_ids + place, np.uint32(0), lanes), nobody)
                _write(lanes, depth, image.values + target, is_aligned)
                _write(lanes, prim_id, image.prim_ids + target, is_aligned)


@kernel
def finish_image(counter_address, height, width, block):  # type: ignore[no-untyped-def]
    """`finish_layers` of a whole image, where it is."""
    target = target_at(block)
    while True:
        top = fetch_add(counter_address, 1) * _ROWS
        if top >= height:
            return
        finish_layers(16, top, min(top + _ROWS, height) - 1, width, target, target)
