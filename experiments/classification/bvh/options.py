"""Options of tracing through the library's own BVH."""

from __future__ import annotations

from dataclasses import dataclass

from atra.choices import check_choice, check_flags
from atra.compiled.instruction_sets import LANE_COUNTS, chosen_instruction_set
from atra.compiled.threads import resolve_threads
from atra.tracing.tracer import TIES


@dataclass(frozen=True)
class BvhOptions:
    """Options of `BvhTracer` and `BvhScene`. All traversals find the same hits.

    packet_width: 1 = single rays. traversal: when a node's box is tested: push = with its sibling's, nearer first, pop
    = when it is popped. robust: on = the watertight triangle test of Woop, Benthin, Wald 2013, off = a faster test.
    Raises InputError, with the value.
    """

    threads: int | None = None
    ties: str = "lowest"
    packet_width: int = 1
    traversal: str = "push"
    robust: bool = True

    def __post_init__(self) -> None:
        resolve_threads(self.threads)
        chosen_instruction_set()
        check_choice("ties", self.ties, TIES)
        check_choice("packet_width", self.packet_width, (1, *LANE_COUNTS))
        check_choice("traversal", self.traversal, ("push", "pop"))
        check_flags(robust=self.robust)
