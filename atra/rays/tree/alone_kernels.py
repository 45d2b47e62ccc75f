"""One ray in the walk through the tree: what it needs of boxes and triangles, and how it meets a leaf."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from atra.compiled.intrinsics import int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.store import njit
from atra.rays.tree.boxes_kernels import ahead_of, margin_of, query_alone
from atra.rays.tree.crossings_kernels import candidates, crossing_of, line_of
from atra.rays.tree.walk_kernels import DONE, first_block
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS


class Alone(NamedTuple):
    """A ray that goes through the tree alone.

    ray: origin and direction. ends: tnear and tfar. start: where it starts again. margin: of boxes. line: of `line_of`.
    areas, exact: addresses of memory. touches: as for `crossing`.
    """

    ray: tuple[tuple[float, ...], tuple[float, ...]]
    ends: tuple[float, float]
    start: float
    margin: float
    line: Any
    areas: int
    exact: int
    touches: bool


@njit(forceinline=True)
def alone_of(tree, o, d, tnear, tfar, s, memory, touches):  # type: ignore[no-untyped-def]
    """(query, ahead, `Alone`) of a ray of `scaled_ray` that starts again at s."""
    margin = margin_of(o, tree.sphere)
    ahead, line = ahead_of(s, tfar, margin), line_of(o, d, tree.sphere)
    alone = Alone((o, d), (tnear, tfar), s, margin, line, memory.areas, memory.exact, touches)
    return query_alone(o, d, s, ahead, margin), ahead, alone


def meet_of(take: Callable[..., Any]) -> Any:
    """How a ray meets a leaf: take(block, k, crossing, query, ahead, state, alone) -> (query, ahead, state) is called
    for each crossing."""

    @njit(forceinline=True)
    def meet(tree, leaf, query, ahead, state, alone):  # type: ignore[no-untyped-def]
        block = first_block(tree, leaf)
        for _ in range(int32_at(leaf + BLOCK_COUNTS)):
            maybe, sure = candidates(block, alone.line, alone.areas)
            while maybe:
                k = first_bit(maybe)
                maybe &= maybe - 1
                crossing = crossing_of(
                    block, k, sure >> k & 1, alone.line, alone.areas, alone.ray, alone.ends, alone.exact, alone.touches
                )
                if crossing[0] != 0:
                    query, ahead, state = take(block, k, crossing, query, ahead, state, alone)
                    if ahead == DONE:
                        return query, ahead, state
            block += BLOCK_BYTES
        return query, ahead, state

    return meet
