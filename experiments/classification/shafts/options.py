"""Options of ray classification."""

from __future__ import annotations

from dataclasses import dataclass

from atra.choices import check_choice, check_flags
from atra.errors import InputError
from atra.whole_numbers import is_whole_number
from experiments.classification.bvh.options import BvhOptions

LONGEST_LIST = 255
"""Most nodes of a list."""

MOST_DIRECTIONS = 1024
"""Most cells along a side of a cube's face; float32 cannot tell more apart well."""

SUBSETS = ("complete", "occupied", "sampled", "hits", "none")
"""Which shafts have lists: all; those of voxels that hold triangles; those that most rays of a sample use; those that
the rays to trace use; none, where only the order of rays is wanted."""

OF_RAYS = ("sampled", "hits")
"""Subsets that depend on the rays to trace."""


@dataclass(frozen=True)
class ShaftOptions(BvhOptions):
    """Options of `ClassifiedTracer` and `ShaftScene`, beside those of `BvhTracer`.

    ray_order: of a batch: as given, or shaft by shaft, in packets that share a list. cells: number of voxels; None = as
    many as the memory allows. directions: cells along each side of a cube's faces. memory: of look-up and lists where
    cells is None, in sizes of the BVH, at least 64 KiB. probability: of a hit, from which a node is opened. rays:
    sampled in each shaft. longest: most nodes of a list. subset: shafts that have lists (`SUBSETS`). share: of a
    sample's rays whose shafts get lists, for subset sampled. empty: what an empty list means, a proven miss, or the
    root. occlusion: sampled rays end at their first hit.
    Raises InputError, with the value, for cells, directions, rays and longest that are not whole or below 1, longest
    above 255, directions above 1,024, a probability or share outside (0, 1], and a memory not above 0.
    """

    traversal: str = "pop"
    ray_order: str = "image"
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

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("ray_order", self.ray_order, ("image", "shaft"))
        check_choice("subset", self.subset, SUBSETS)
        check_choice("empty", self.empty, ("miss", "root"))
        check_flags(occlusion=self.occlusion)
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
