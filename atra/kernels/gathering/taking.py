"""Taking: a hit becomes part of what is gathered, each reduction in its own way, as vectors of pixels."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.gathering.lanes import chosen, either, is_below, load_rows, one_more, store_rows
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
def _take_layer(lanes, nx, taken, depth, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """In its place among the layers: what was there and is farther moves on, until no lane holds anything more."""
    row = target.row * 4
    count = target.counts + pixel * 4
    store_rows(one_more(taken, load_rows(count, row, np.uint32(0), lanes, nx)), count, row, nx)
    nothing = repeated(np.float32(np.inf), lanes)
    place = pixel * 4
    moving, moving_id = chosen(taken, depth, nothing), repeated(prim_id, lanes)
    for _ in range(target.layers):
        old = load_rows(target.values + place, row, np.float32(0.0), lanes, nx)
        old_id = load_rows(target.prim_ids + place, row, np.uint32(0), lanes, nx)
        equal = (old <= moving) & (moving <= old) & (nothing > moving)
        nearer = either(old > moving, equal & is_below(moving_id, old_id))
        if bits_of(nearer) != 0:
            store_rows(chosen(nearer, moving, old), target.values + place, row, nx)
            store_rows(chosen(nearer, moving_id, old_id), target.prim_ids + place, row, nx)
            moving, moving_id = chosen(nearer, old, moving), chosen(nearer, old_id, moving_id)
            if bits_of(nothing > moving) == 0:
                break
        place += target.plane * 4


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
