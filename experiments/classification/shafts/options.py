"""Options of ray classification."""

from __future__ import annotations

from dataclasses import dataclass

from atra.errors import InputError
from atra.tracing.options import option, option_of
from atra.whole_numbers import is_whole_number
from experiments.classification.bvh.options import BvhKeywords, BvhOptions

LONGEST_LIST = 255
"""Most nodes of a list."""

MOST_DIRECTIONS = 1024
"""Most cells along a side of a cube's face; float32 cannot tell more apart well."""

SUBSETS = ("complete", "occupied", "sampled", "hits", "none")
"""Which shafts have lists: all; those of voxels that hold triangles; those that most rays of a sample use; those that
the rays to trace use; none, where only the order of rays is wanted."""

OF_RAYS = ("sampled", "hits")
"""Subsets that depend on the rays to trace."""


class ShaftKeywords(BvhKeywords, total=False):
    ray_order: str
    cells: int | None
    directions: int
    memory: float
    probability: float
    rays: int
    longest: int
    subset: str
    share: float
    empty: str
    occlusion: bool


@dataclass(frozen=True)
class ShaftOptions(BvhOptions):
    """Options of `ClassifiedTracer` and `ShaftScene`, beside those of `BvhTracer`.

    Raises InputError, with the value, for cells, directions, rays and longest that are not whole or below 1, longest
    above 255, directions above 1,024, a probability or share outside (0, 1], and a memory not above 0.
    """

    traversal: str = option_of(BvhOptions, "traversal", default="pop")
    ray_order: str = option(
        "image",
        "order of a batch: image = as given, shaft = shaft by shaft, in packets that share a list",
        choices=("image", "shaft"),
    )
    cells: int | None = option(None, "number of voxels; null = as many as the memory allows", null="by memory")
    directions: int = option(4, "cells along each side of a cube's faces")
    memory: float = option(1.0, "memory of look-up and lists if cells is null, at least 64 KiB", unit="times the BVH's")
    probability: float = option(0.5, "hit probability from which a node is opened")
    rays: int = option(20, "rays sampled in each shaft")
    longest: int = option(31, "most nodes of a list")
    subset: str = option("complete", "which shafts have lists", choices=SUBSETS)
    share: float = option(0.9, "fraction of a sample's rays whose shafts get lists, for subset sampled")
    empty: str = option(
        "miss", "what an empty list means: miss = a proven miss, root = start at the root", choices=("miss", "root")
    )
    occlusion: bool = option(True, "sampled rays end at their first hit")

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
