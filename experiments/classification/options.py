"""Options of our own BVH and of classified rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from atra.errors import InputError
from experiments.harness.options import Settings, check_whole_number, option, whole

SUBSETS = ("complete", "occupied", "sampled", "hits", "none")
"""Which shafts have lists: all; those of voxels that hold triangles; those that most rays of a sample use; those that
the rays to trace use; none, where only the order of rays is wanted."""

OF_RAYS = ("sampled", "hits")
"""Subsets that depend on the rays to trace."""


def _traversal(default: str) -> Any:
    return option(
        default,
        "when a node's box is tested: push = with its sibling's, nearer first, pop = when it is popped",
        choices=("push", "pop"),
    )


@dataclass(frozen=True)
class BvhOptions(Settings):
    """Options of rays through our BVH. All find the same hits."""

    section = "method"
    traversal: str = _traversal("push")


@dataclass(frozen=True)
class ClassifiedOptions(BvhOptions):
    """Options of rays that start from the lists of their shafts.

    Raises InputError, with the value, for a probability or share outside (0, 1], and a memory not above 0, too.
    """

    traversal: str = _traversal("pop")
    ray_order: str = option(
        "image",
        "order of a batch: image = as given, shaft = shaft by shaft",
        choices=("image", "shaft"),
    )
    shaft_cells: int | None = option(None, "number of voxels; null = as many as the memory allows", null="by memory")
    shaft_directions: int = whole(4, "cells along each side of a cube's faces", 1, 1024)
    shaft_memory: float = option(
        1.0, "memory of look-up and lists if cells is null, at least 64 KiB", unit="times the BVH's"
    )
    shaft_probability: float = option(0.5, "hit probability from which a node is opened")
    shaft_rays: int = whole(20, "rays sampled in each shaft", 1)
    shaft_list: int = whole(31, "most nodes of a list", 1, 255)
    shaft_subset: str = option("complete", "which shafts have lists", choices=SUBSETS)
    shaft_share: float = option(0.9, "fraction of a sample's rays whose shafts get lists, for subset sampled")
    shaft_occlusion: bool = option(True, "sampled rays end at their first hit")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shaft_cells is not None:
            check_whole_number("method.shaft_cells", self.shaft_cells, 1)
        for name in ("shaft_probability", "shaft_share"):
            if not 0 < getattr(self, name) <= 1:
                raise InputError(f"method.{name} is {getattr(self, name)!r}, expected more than 0 and at most 1")
        if not 0 < self.shaft_memory < float("inf"):
            raise InputError(f"method.shaft_memory is {self.shaft_memory!r}, expected a finite number above 0")
