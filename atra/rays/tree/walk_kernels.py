"""The walk of rays through a tree of eight children per node, near children first; what is done at leaves is given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from atra.compiled.intrinsics import address_at, float_at, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import prefetch, store
from atra.compiled.store import njit
from atra.compiled.vectors import splat
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS, FIRSTS, WIDE_BYTES

LEAF = 1
"""Added to the address of a leaf on the stack; all addresses are even. A leaf's address is that of its first number in
its parent node."""

DONE = np.float32(-np.inf)
"""Where rays end that need no more leaves."""


@njit(forceinline=True)
def put(memory, place, node, entry):  # type: ignore[no-untyped-def]
    """Put a node or leaf, which rays enter at `entry`, in a place on the stack."""
    store(splat(np.int64(node), 1), memory.stack + 8 * place)
    store(splat(np.float32(entry), 1), memory.reached + 4 * place)


@njit(forceinline=True)
def _put_in_order(memory, lowest, top, node, entry):  # type: ignore[no-untyped-def]
    """Put a node on the stack between those from `lowest` on: the farthest stands lowest."""
    while top > lowest:
        before = float_at(memory.reached + 4 * (top - 1))
        if not before < entry:
            break
        put(memory, top, address_at(memory.stack + 8 * (top - 1)), before)
        top -= 1
    put(memory, top, node, entry)


@njit(forceinline=True)
def hold(memory, place, leaf):  # type: ignore[no-untyped-def]
    """Put a leaf in a place among those that wait to be met."""
    store(splat(np.int64(leaf), 1), memory.leaves + 8 * place)


@njit(forceinline=True)
def first_block(tree, leaf):  # type: ignore[no-untyped-def]
    """The address of a leaf's first block."""
    return tree.blocks + np.int64(int32_at(leaf + FIRSTS)) * BLOCK_BYTES


@njit(forceinline=True)
def _child_of(tree, at):  # type: ignore[no-untyped-def]
    """What a child at an address in its parent is on the stack; its memory is prefetched."""
    if int32_at(at + BLOCK_COUNTS):
        to = first_block(tree, at)
        prefetch(to)
        prefetch(to + 64)
        prefetch(to + 128)
        return at + LEAF
    to = tree.nodes + np.int64(int32_at(at + FIRSTS)) * WIDE_BYTES
    prefetch(to)
    prefetch(to + 64)
    prefetch(to + 128)
    prefetch(to + 192)
    return to


def walk_of(enter: Callable[..., Any], meet: Callable[..., Any], in_order: bool, held: int = 0) -> Any:
    """The compiled walk of one ray, or of several together.

    enter(node, query) -> (bits of the children that a ray may enter, where at the earliest).
    meet(tree, leaf, query, ahead, state, given) -> (query, ahead, state) does what is wanted of a leaf. in_order: the
    nearer of a node's children come first, and those beyond `ahead` never; otherwise a node's leaves come first. held:
    leaves that are held back, so that each has time to be prefetched.
    """

    @njit(forceinline=True)
    def walk(tree, memory, top, leaves, query, ahead, state, given):  # type: ignore[no-untyped-def]
        """The state after all that waits: on the stack, whose top is given, and so many leaves in `memory.leaves`.

        query: what box tests need of the rays. ahead: float32, where they end. given: what `meet` needs.
        """
        while True:
            leaf = np.int64(0)
            while top > 0 and leaves <= held:
                top -= 1
                if in_order and float_at(memory.reached + 4 * top) > ahead:
                    continue
                node = address_at(memory.stack + 8 * top)
                if in_order and node & LEAF:
                    leaf = node - LEAF
                    break
                bits, entry = enter(node, query)
                lowest = top
                if in_order:
                    store(entry, memory.entries)
                while bits:
                    child = 4 * first_bit(bits)
                    bits &= bits - 1
                    to = _child_of(tree, node + child)
                    if in_order:
                        _put_in_order(memory, lowest, top, to, float_at(memory.entries + child))
                        top += 1
                    elif to & LEAF:
                        hold(memory, leaves, to - LEAF)
                        leaves += 1
                    else:
                        store(splat(to, 1), memory.stack + 8 * top)
                        top += 1
            if leaf == 0 and leaves == 0:
                return state
            while leaf or leaves > 0:
                if not in_order:
                    leaves -= 1
                    leaf = address_at(memory.leaves + 8 * leaves)
                query, ahead, state = meet(tree, leaf, query, ahead, state, given)
                if ahead == DONE:
                    return state
                leaf = np.int64(0)

    return walk
