"""Kernels of layers: sort each pixel's hits, which were taken in any order, and write them to the image."""

from __future__ import annotations

import numpy as np

from atra.all_hits.keys_kernels import depths_of, keys_of, load_keys, prim_ids_of, sort_few, store_keys
from atra.all_hits.target_kernels import target_at
from atra.compiled.intrinsics import fetch_add
from atra.compiled.lanes import highest, is_below
from atra.compiled.memory import load, store, stream
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import bits_of, splat, where
from atra.prim_ids import MISS

_LANES = 16
"""Pixels sorted at once; their numbers fill a cache line."""

_ROWS = 8
"""Rows a thread takes at a time."""


@njit
def _sort_many(counts, most, values, prim_ids, plane, kept):  # type: ignore[no-untyped-def]
    """Insertion sort of layers. Addresses as for `sort_few`."""
    nothing = keys_of(splat(np.float32(np.inf), _LANES), splat(np.uint32(MISS), _LANES))
    for layer in range(most):
        place = layer * plane
        has_hit = is_below(splat(np.uint32(layer), _LANES), counts)
        depths = load(values + place, np.float32(0.0), _LANES)
        keys = where(has_hit, keys_of(depths, load(prim_ids + place, np.uint32(0), _LANES)), nothing)
        if layer >= kept:
            place = (kept - 1) * plane
            farthest = load_keys(values + place, prim_ids + place, _LANES)
            nearer = is_below(keys, farthest)
            if bits_of(nearer) == 0:
                continue
            keys = where(nearer, keys, farthest)
        while place > 0:
            before = load_keys(values + place - plane, prim_ids + place - plane, _LANES)
            nearer = is_below(keys, before)
            if bits_of(nearer) == 0:
                break
            store_keys(where(nearer, before, keys), values + place, prim_ids + place)
            keys = where(nearer, keys, before)
            place -= plane
        store_keys(keys, values + place, prim_ids + place)


@njit
def _sort(pixel, target, kept):  # type: ignore[no-untyped-def]
    """Sort the layers of _LANES pixels so that the first `kept` hold the keys of their nearest hits; returns how many
    layers hold any."""
    counts = load(target.counts + pixel * 4, np.uint32(0), _LANES)
    values, prim_ids, plane = target.values + pixel * 4, target.prim_ids + pixel * 4, target.plane * 4
    most, layers = min(highest(counts), target.layers), target.layers
    if most <= 2 <= layers:
        sort_few(values, prim_ids, plane, counts, 2, 2)
    elif most <= 4 <= layers:
        sort_few(values, prim_ids, plane, counts, 4, 4)
    elif most <= 8 <= layers:
        sort_few(values, prim_ids, plane, counts, 8, 8)
    elif most <= 16 <= layers and kept <= 8:
        sort_few(values, prim_ids, plane, counts, 16, 8)
    else:
        _sort_many(counts, most, values, prim_ids, plane, kept)
    return min(most, kept)


@njit
def _write(numbers, address, is_aligned):  # type: ignore[no-untyped-def]
    if is_aligned:
        stream(numbers, address)
    else:
        store(numbers, address)


@njit
def finish_layers(top, bottom, width, taken, image):  # type: ignore[no-untyped-def]
    """Sort the rows top ... bottom of a `Target` of layers and write them to `image`, which may be the same. Layers
    beyond a pixel's hits become misses. Rows aligned to cache lines are written past the caches."""
    farthest, nobody = splat(np.float32(np.inf), _LANES), splat(np.uint32(MISS), _LANES)
    is_aligned = (image.values | image.prim_ids | image.counts | image.row * 4) % (_LANES * 4) == 0
    for y in range(top, bottom + 1):
        for x in range(0, width, _LANES):
            pixel, target = y * taken.row + x, (y * image.row + x) * 4
            most, until = _sort(pixel, taken, image.layers), image.layers
            if image.is_known:
                earlier = highest(load(image.counts + target, np.uint32(0), _LANES))
                until = max(most, min(earlier, image.layers))
            _write(load(taken.counts + pixel * 4, np.uint32(0), _LANES), image.counts + target, is_aligned)
            for layer in range(until):
                depth, prim_id = farthest, nobody
                if layer < most:
                    place = (pixel + layer * taken.plane) * 4
                    keys = load_keys(taken.values + place, taken.prim_ids + place, _LANES)
                    depth, prim_id = depths_of(keys), prim_ids_of(keys)
                _write(depth, image.values + target, is_aligned)
                _write(prim_id, image.prim_ids + target, is_aligned)
                target += image.plane * 4


@njit
def finish_numbers(top, bottom, width, taken, image):  # type: ignore[no-untyped-def]
    """Write the rows top ... bottom of a `Target` of one number per pixel to another, as `finish_layers` does."""
    is_aligned = (image.values | image.row * 4) % (_LANES * 4) == 0
    for y in range(top, bottom + 1):
        for x in range(0, width, _LANES):
            numbers = load(taken.values + (y * taken.row + x) * 4, np.uint32(0), _LANES)
            _write(numbers, image.values + (y * image.row + x) * 4, is_aligned)


@kernel
def finish_image(counter_address, height, width, block):  # type: ignore[no-untyped-def]
    """`finish_layers` for a whole image, in place."""
    target = target_at(block)
    while True:
        top = fetch_add(counter_address, 1) * _ROWS
        if top >= height:
            return
        finish_layers(top, min(top + _ROWS, height) - 1, width, target, target)
