"""The nearest hit of one ray, or whether it hits anything, decided without rounding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import address_at, float_at, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import store
from atra.compiled.store import float_part, njit
from atra.compiled.vectors import splat
from atra.prim_ids import MISS
from atra.rays.all_hits.boxes_kernels import box_ray, child_node, entered, entered_at, first_block, shortened, start_of
from atra.rays.all_hits.crossings_kernels import candidates, crossing_of, is_before, line_of, parameter, prim_id_of
from atra.rays.all_hits.memory import LEAF
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS

NO_HIT = np.uint32(MISS)

_CLOSE = 2.0**-27
"""Largest error of a parameter, as a share of it, that leaves it right to a unit of float32."""


@njit(forceinline=True)
def finished(t, error, block, k, o, d, exact):  # type: ignore[no-untyped-def]
    """The parameter of a hit, right to a unit of float32."""
    return t if error <= _CLOSE * t else parameter(block, k, o, d, exact)


@njit(forceinline=True)
def is_nearer(t, error, block, k, nearest, nearest_error, other, m, o, d, exact):  # type: ignore[no-untyped-def]
    """Whether a hit comes before the nearest so far, by their parameters, or without rounding where these do not tell.

    other: the block of the nearest hit, 0: there is none.
    """
    gap, errors = t - nearest, error + nearest_error
    return other == 0 or gap < -errors or (not gap > errors and is_before(block, k, other, m, o, d, exact))


class Memory(NamedTuple):
    """Addresses of a thread's memory: of `Found.exact`, `areas`, `entries`, `stack` and `reached`. A function that is
    given arrays in their place takes longer to be called than to visit a node."""

    exact: int
    areas: int
    entries: int
    stack: int
    reached: int


@njit(forceinline=True)
def memory_of(found):  # type: ignore[no-untyped-def]
    """The `Memory` of `Found`."""
    return Memory(
        found.exact.ctypes.data, found.areas.ctypes.data, found.entries.ctypes.data, found.stack.ctypes.data,
        found.reached.ctypes.data,
    )  # fmt: skip


@njit(forceinline=True)
def put(memory, place, node, entry):  # type: ignore[no-untyped-def]
    """Put a node, which the ray enters at `entry`, in a place on the stack."""
    store(splat(np.int64(node), 1), memory.stack + 8 * place)
    store(splat(np.float32(entry), 1), memory.reached + 4 * place)


@njit(forceinline=True)
def put_in_order(memory, lowest, top, node, entry):  # type: ignore[no-untyped-def]
    """Put a node on the stack, whose top it raises, between those from `lowest` on: the farthest stands lowest."""
    while top > lowest:
        before = float_at(memory.reached + 4 * (top - 1))
        if not before < entry:
            break
        put(memory, top, address_at(memory.stack + 8 * (top - 1)), before)
        top -= 1
    put(memory, top, node, entry)


@float_part
def nearest_alone(tree, o, d, tnear, tfar, memory, touches):  # type: ignore[no-untyped-def]
    """(t, prim_id) of the nearest hit of a ray; inf and `MISS` where there is none.

    o, d, tnear, tfar: of `scaled_ray`. touches: as for `crossing`.
    """
    exact, areas, entries = memory.exact, memory.areas, memory.entries
    is_near, s = start_of(o, d, tnear, tree.sphere)
    if not (is_near and tnear < tfar and s < tfar):
        return np.inf, NO_HIT
    nearest, nearest_error, hit_block, hit_k = tfar, 0.0, np.int64(0), np.int64(0)
    ray, line = box_ray(o, d, s, tfar, tree.sphere), line_of(o, d, tree.sphere)
    put(memory, 0, tree.nodes, -np.inf)
    top, limit = 1, np.float32(np.inf)
    while top > 0:
        top -= 1
        if float_at(memory.reached + 4 * top) > limit:
            continue
        node = address_at(memory.stack + 8 * top)
        if node & LEAF:
            block = node - LEAF
            maybe, sure = candidates(block, line, areas)
            while maybe:
                k = first_bit(maybe)
                maybe &= maybe - 1
                is_sure, ends = sure >> k & 1, (tnear, tfar)
                sign, t, error, _, _ = crossing_of(block, k, is_sure, line, areas, (o, d), ends, exact, touches)
                if sign == 0:
                    continue
                if is_nearer(t, error, block, k, nearest, nearest_error, hit_block, hit_k, o, d, exact):
                    nearest, nearest_error, hit_block, hit_k = t, error, block, k
                    ray, limit = shortened(ray, s, t + error)
            continue
        bits = entered_at(node, ray, entries)
        first = top
        while bits:
            child = 4 * first_bit(bits)
            bits &= bits - 1
            entry = float_at(entries + child)
            blocks = np.int64(int32_at(node + BLOCK_COUNTS + child))
            to = first_block(tree, node, child) + LEAF if blocks else child_node(tree, node, child)
            for _ in range(max(blocks, 1)):
                put_in_order(memory, first, top, to, entry)
                to += BLOCK_BYTES
                top += 1
    if hit_block == 0:
        return np.inf, NO_HIT
    return finished(nearest, nearest_error, hit_block, hit_k, o, d, exact), prim_id_of(hit_block, hit_k)


@float_part
def is_hit_alone(tree, o, d, tnear, tfar, memory, touches):  # type: ignore[no-untyped-def]
    """Whether a ray hits anything. Arguments as for `nearest_alone`.

    A node's leaves are tested before its other children are entered: one hit is enough.
    """
    is_near, s = start_of(o, d, tnear, tree.sphere)
    if not (is_near and tnear < tfar and s < tfar):
        return False
    ray, line = box_ray(o, d, s, tfar, tree.sphere), line_of(o, d, tree.sphere)
    top, node = 0, np.int64(tree.nodes)
    while True:
        bits, leaves = entered(node, ray), np.int64(0)
        while bits:
            k = first_bit(bits)
            bits &= bits - 1
            if int32_at(node + BLOCK_COUNTS + 4 * k):
                leaves |= np.int64(1) << k
                first_block(tree, node, 4 * k)
            else:
                store(splat(child_node(tree, node, 4 * k), 1), memory.stack + 8 * top)
                top += 1
        while leaves:
            child = 4 * first_bit(leaves)
            leaves &= leaves - 1
            block = first_block(tree, node, child)
            for _ in range(int32_at(node + BLOCK_COUNTS + child)):
                if is_crossed(block, line, (o, d), (tnear, tfar), memory, touches):
                    return True
                block += BLOCK_BYTES
        if top == 0:
            return False
        top -= 1
        node = address_at(memory.stack + 8 * top)


@njit(forceinline=True)
def is_crossed(block, line, ray, ends, memory, touches):  # type: ignore[no-untyped-def]
    """Whether a ray crosses a triangle of a block."""
    maybe, sure = candidates(block, line, memory.areas)
    while maybe:
        k = first_bit(maybe)
        maybe &= maybe - 1
        crossing = crossing_of(block, k, sure >> k & 1, line, memory.areas, ray, ends, memory.exact, touches)
        if crossing[0] != 0:
            return True
    return False
