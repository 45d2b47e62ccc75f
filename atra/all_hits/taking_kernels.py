"""Taking a hit: each reduction's update of the target, for a vector of pixels."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import uint32_at
from atra.compiled.lanes import (
    first_bit,
    is_below,
    is_from,
    is_same,
    load_rows,
    one_more,
    store_rows,
    store_rows_where,
)
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, rarely, splat, where

COUNT, THICKNESS, TRANSMITTANCE, LAYERS = range(4)
"""Kinds of reduction; constants in compiled code, so that each has kernels of its own."""


@njit(forceinline=True)
def is_nearer(depth, prim_id, other, other_id):  # type: ignore[no-untyped-def]
    """Mask: the hit comes before another one in the order of layers."""
    same = (depth <= other) & (other <= depth)
    return (other > depth) | (same & is_below(prim_id, other_id))


@njit(forceinline=True)
def _put(lanes, nx, mask, depth, prim_ids, place, target):  # type: ignore[no-untyped-def]
    """Store the lanes of a mask in a layer, `place` bytes behind the first layer's first pixel."""
    store_rows_where(mask, depth, target.values + place, target.row * 4, nx)
    store_rows_where(mask, prim_ids, target.prim_ids + place, target.row * 4, nx)


@njit(forceinline=True)
def _put_last(lanes, nx, mask, depth, prim_ids, pixel, target):  # type: ignore[no-untyped-def]
    """Insert a hit into full layers, which drops the farthest; the farthest of the rest ends in the last layer."""
    row, place = target.row * 4, pixel * 4
    for _ in range(target.layers - 1):
        other = load_rows(target.values + place, row, np.float32(0.0), lanes, nx)
        other_id = load_rows(target.prim_ids + place, row, np.uint32(0), lanes, nx)
        nearer = mask & is_nearer(depth, prim_ids, other, other_id)
        if bits_of(nearer) != 0:
            store_rows(where(nearer, depth, other), target.values + place, row, nx)
            store_rows(where(nearer, prim_ids, other_id), target.prim_ids + place, row, nx)
            depth, prim_ids = where(nearer, other, depth), where(nearer, other_id, prim_ids)
        place += target.plane * 4
    _put(lanes, nx, mask, depth, prim_ids, place, target)


@njit(forceinline=True)
def _put_next(lanes, nx, free, bits, before, depth, prim_ids, pixel, target):  # type: ignore[no-untyped-def]
    """Append a hit in those pixels of `bits` that hold as many hits as the first of them; returns the remaining bits.
    Without bits it stores nothing."""
    lane = first_bit(bits | 1 << lanes - 1)
    count = uint32_at(target.counts + (pixel + lane // nx * target.row + lane % nx) * 4)
    layer = min(np.int64(count), target.layers - 1)
    put = free & is_same(before, splat(np.uint32(layer), lanes))
    _put(lanes, nx, put, depth, prim_ids, (pixel + layer * target.plane) * 4, target)
    return bits & ~bits_of(put)


@njit(forceinline=True)
def _take_layer(lanes, nx, taken, depth, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Append the hit unsorted; layers are sorted at the end. Full layers keep the farthest hit last; farther ones only
    count."""
    row, last = target.row * 4, splat(np.uint32(target.layers - 1), lanes)
    counts = target.counts + pixel * 4
    before, prim_ids = load_rows(counts, row, np.uint32(0), lanes, nx), splat(prim_id, lanes)
    full, free = taken & is_from(before, last), taken & is_below(before, last)
    if rarely(bits_of(full) != 0):
        place = (pixel + (target.layers - 1) * target.plane) * 4
        farthest = load_rows(target.values + place, row, np.float32(0.0), lanes, nx)
        farthest_id = load_rows(target.prim_ids + place, row, np.uint32(0), lanes, nx)
        full = full & (is_same(before, last) | is_nearer(depth, prim_ids, farthest, farthest_id))
        if bits_of(full) != 0:
            _put_last(lanes, nx, full, depth, prim_ids, pixel, target)
    # Usually one call is enough, as pixels have equally many hits; a check beforehand would be slower.
    left = _put_next(lanes, nx, free, bits_of(free), before, depth, prim_ids, pixel, target)
    while left != 0:
        left = _put_next(lanes, nx, free, left, before, depth, prim_ids, pixel, target)
    store_rows(one_more(taken, before), counts, row, nx)


@njit(forceinline=True)
def take(kind, lanes, nx, taken, depth, weight, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Take a hit in the pixels of mask `taken`: `lanes` pixels in rows of nx, the first is `pixel`.

    depth: float32 vector. weight: float32 of the triangle: its factor, or 1 where rays leave through it and -1 where
    they enter.
    """
    place, row = target.values + pixel * 4, target.row * 4
    if kind == COUNT:
        store_rows(one_more(taken, load_rows(place, row, np.uint32(0), lanes, nx)), place, row, nx)
    elif kind == THICKNESS:
        old = load_rows(place, row, np.float32(0.0), lanes, nx)
        store_rows(where(taken, old + splat(weight, lanes) * depth, old), place, row, nx)
    elif kind == TRANSMITTANCE:
        old = load_rows(place, row, np.float32(0.0), lanes, nx)
        store_rows(where(taken, old * splat(weight, lanes), old), place, row, nx)
    else:
        _take_layer(lanes, nx, taken, depth, prim_id, pixel, target)
