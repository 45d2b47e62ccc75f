"""Options of tracing through the library's own BVH."""

from __future__ import annotations

from dataclasses import dataclass

from atra.tracing.options import LANES, ThreadKeywords, ThreadOptions, TieKeywords, TieOptions, option


class BvhKeywords(ThreadKeywords, TieKeywords, total=False):
    packet_width: int
    traversal: str
    robust: bool


@dataclass(frozen=True)
class BvhOptions(ThreadOptions, TieOptions):
    """Options of `BvhTracer` and `BvhScene`. All traversals find the same hits.

    robust: on = the watertight triangle test of Woop, Benthin, Wald 2013, off = a faster test.
    """

    packet_width: int = option(1, "rays in a packet; 1 = single rays", choices=(1, *LANES))
    traversal: str = option(
        "push",
        "when a node's box is tested: push = with its sibling's, nearer first, pop = when it is popped",
        choices=("push", "pop"),
    )
    robust: bool = option(True, "no ray slips through between triangles; off = a faster test")
