"""Taking: a hit becomes part of what is gathered, each reduction in its own way, as vectors of pixels."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.gathering.lanes import (
    chosen,
    either,
    first_bit,
    is_below,
    is_same,
    load_rows,
    one_more,
    store_rows,
    uint32_at,
)
from atra.kernels.raster.vectors import bits_of, repeated

COUNT, THICKNESS, TRANSMITTANCE, LAYERS = range(4)
"""Kinds of reduction: constants of compiled code, so that each has its own."""


@njit(inline="always")
def _take_count(lanes, nx, taken, pixel, target):  # type: ignore[no-untyped-def]
    """One more for every hit."""
    place, row = target.values + pixel * 4, target.row * 4
    store_rows(one_more(taken, load_rows(place, row, np.uint32(0), lanes, nx)), place, row, nx)


@njit(inline="always")
def _take_thickness(lanes, nx, taken, depth, weight, pixel, target):  # type: ignore[no-untyped-def]
    """The depths at which rays leave, less those at which they enter."""
    place, row = target.values + pixel * 4, target.row * 4
    old = load_rows(place, row, np.float32(0.0), lanes, nx)
    store_rows(chosen(taken, old + repeated(weight, lanes) * depth, old), place, row, nx)


@njit(inline="always")
def _take_factor(lanes, nx, taken, weight, pixel, target):  # type: ignore[no-untyped-def]
    """The product of the factors."""
    place, row = target.values + pixel * 4, target.row * 4
    old = load_rows(place, row, np.float32(0.0), lanes, nx)
    store_rows(chosen(taken, old * repeated(weight, lanes), old), place, row, nx)


@njit(inline="always")
def is_nearer(depth, prim_id, other, other_id):  # type: ignore[no-untyped-def]
    """The mask where a hit comes before another one in the order of layers."""
    same = (depth <= other) & (other <= depth)
    return either(other > depth, same & is_below(prim_id, other_id))


@njit(inline="always")
def _replace_farthest(lanes, nx, taken, depth, prim_ids, pixel, target):  # type: ignore[no-untyped-def]
    """In place of the farthest hit of the layers, all of which are taken, where it is nearer than that."""
    row, plane, place = target.row * 4, target.plane * 4, pixel * 4
    last = load_rows(target.values + place, row, np.float32(0.0), lanes, nx)
    last_id = load_rows(target.prim_ids + place, row, np.uint32(0), lanes, nx)
    where = repeated(np.uint32(0), lanes)
    for layer in range(1, target.layers):
        other = load_rows(target.values + place + layer * plane, row, np.float32(0.0), lanes, nx)
        other_id = load_rows(target.prim_ids + place + layer * plane, row, np.uint32(0), lanes, nx)
        nearer = is_nearer(last, last_id, other, other_id)
        last, last_id = chosen(nearer, other, last), chosen(nearer, other_id, last_id)
        where = chosen(nearer, repeated(np.uint32(layer), lanes), where)
    replaced = taken & is_nearer(depth, prim_ids, last, last_id)
    if bits_of(replaced) != 0:
        for layer in range(target.layers):
            here = replaced & is_same(where, repeated(np.uint32(layer), lanes))
            _put(lanes, nx, here, depth, np.float32(0.0), target.values + place + layer * plane, row)
            _put(lanes, nx, here, prim_ids, np.uint32(0), target.prim_ids + place + layer * plane, row)


@njit(inline="always")
def _put(lanes, nx, mask, numbers, zero, place, row):  # type: ignore[no-untyped-def]
    """Store the lanes of a mask; zero: of the numbers' type."""
    old = load_rows(place, row, zero, lanes, nx)
    store_rows(chosen(mask, numbers, old), place, row, nx)


@njit(inline="always")
def _take_layer(lanes, nx, taken, depth, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Behind the hits that are there already, in no order; `sort_layers` sorts them when all are taken."""
    row = target.row * 4
    counts = target.counts + pixel * 4
    before, prim_ids = load_rows(counts, row, np.uint32(0), lanes, nx), repeated(prim_id, lanes)
    left = bits_of(taken)
    while left != 0:
        lane = first_bit(left)
        layer = np.int64(uint32_at(counts + lane // nx * row + lane % nx * 4))
        if layer < target.layers:
            here = taken & is_same(before, repeated(np.uint32(layer), lanes))
            place = (pixel + layer * target.plane) * 4
            _put(lanes, nx, here, depth, np.float32(0.0), target.values + place, row)
            _put(lanes, nx, here, prim_ids, np.uint32(0), target.prim_ids + place, row)
        else:
            here = taken & is_below(repeated(np.uint32(target.layers - 1), lanes), before)
            _replace_farthest(lanes, nx, here, depth, prim_ids, pixel, target)
        left &= ~bits_of(here)
    store_rows(one_more(taken, before), counts, row, nx)


@njit(inline="always")
def take(kind, lanes, nx, taken, depth, weight, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Take a hit of the `lanes` pixels, in rows of nx, where the mask `taken` is True; the first is `pixel`.

    depth: float32 vector. weight: float32, of the triangle `prim_id`: its factor, or 1 where rays leave through it and
    -1 where they enter.
    """
    if kind == COUNT:
        _take_count(lanes, nx, taken, pixel, target)
    elif kind == THICKNESS:
        _take_thickness(lanes, nx, taken, depth, weight, pixel, target)
    elif kind == TRANSMITTANCE:
        _take_factor(lanes, nx, taken, weight, pixel, target)
    else:
        _take_layer(lanes, nx, taken, depth, prim_id, pixel, target)
