"""Options of ray classification."""

from __future__ import annotations

from dataclasses import dataclass

from atra.errors import InputError
from atra.tracing.options import BvhOptions
from atra.whole_numbers import is_whole_number

LONGEST_LIST = 255
"""More than that is no short list."""

MOST_DIRECTIONS = 1024
"""More than that float32 cannot tell apart well."""

SUBSETS = ("complete", "occupied", "sampled", "hits", "none")
"""Which shafts have lists: all; those of voxels that hold triangles; those that most rays of a sample use; those that
the rays use that are to be traced; none, which leaves the order of rays alone."""

ON_RAYS = ("sampled", "hits", "none")
"""Those that hang on the rays that are to be traced."""

EMPTY = ("miss", "root")
"""What an empty list means: the proof that nothing is hit, or that the ray starts from the root."""


@dataclass(frozen=True)
class ShaftOptions(BvhOptions):
    """Options of `ClassifiedTracer` and `ShaftScene`, beside those of `BvhTracer`.

    cells: voxels; None: as many as `memory` allows. directions: cells along each side of the six faces of a cube.
    memory: of lists and look-up, as a multiple of that of the BVH but at least 64 KiB, if `cells` is None.
    probability: how probable a hit of a node must be for it to be opened. rays: sampled in each shaft. longest: nodes
    of a list. subset: one of SUBSETS. share: of the rays of a sample whose shafts have lists, if `subset` is "sampled".
    empty: one of EMPTY. occlusion: whether a sampled ray ends where it hits something. shaft_order: rays of a batch are
    traced shaft by shaft, and packets start from the list that their rays share.
    Raises InputError, with the value, for cells, directions, rays and longest that are not whole or less than 1,
    longest beyond 255, directions beyond 1,024, a probability or a share outside (0, 1], a memory that is not above 0,
    and unknown words.
    """

    traversal: str = "pop"
    cells: int | None = None
    directions: int = 4
    memory: float = 1.0
    probability: float = 0.5
    rays: int = 20
    longest: int = 31
    subset: str = "complete"
    share: float = 0.9
    empty: str = "miss"
    occlusion: bool = True
    shaft_order: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("cells", "directions", "rays", "longest"):
            value = getattr(self, name)
            if not (name == "cells" and value is None) and not (is_whole_number(value) and value >= 1):
                raise InputError(f"{name} is {value!r}, expected a whole number of at least 1")
        if self.longest > LONGEST_LIST:
            raise InputError(f"longest is {self.longest}, expected at most {LONGEST_LIST}")
        if self.directions > MOST_DIRECTIONS:
            raise InputError(f"directions is {self.directions}, expected at most {MOST_DIRECTIONS:,}")
        for name in ("probability", "share"):
            if not 0 < getattr(self, name) <= 1:
                raise InputError(f"{name} is {getattr(self, name)!r}, expected more than 0 and at most 1")
        if not 0 < self.memory < float("inf"):
            raise InputError(f"memory is {self.memory!r}, expected more than 0, as a multiple of the BVH's")
        for name, words in (("subset", SUBSETS), ("empty", EMPTY)):
            if getattr(self, name) not in words:
                raise InputError(f"{name} is {getattr(self, name)!r}, expected one of {', '.join(words)}")
