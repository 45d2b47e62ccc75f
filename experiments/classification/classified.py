"""Method `classified`: each ray starts from the nodes that rays of its shaft may meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.classification.own_bvh import BVH_BYTES, traversal_option, width_option
from experiments.classification.shafts.eye import EyeTracer
from experiments.classification.shafts.options import SUBSETS, ShaftOptions
from experiments.classification.shafts.scene import ShaftScene
from experiments.classification.shafts.tracer import ClassifiedTracer
from experiments.drawing.style import SKY
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.options import MethodOptions, robust_option, say_robust

EYE = "eye"
"""Subset of shafts: those of an image, one for each tile."""

_PLAIN = ("packet_width", "traversal", "robust", "ray_order")
"""Options that are called as in the library; the others are options of shafts here."""


@dataclass(frozen=True)
class ClassifiedOptions(MethodOptions):
    """Packets are for batches of rays."""

    packet_width: int = width_option()
    traversal: str = traversal_option("pop")
    robust: bool = robust_option("no ray slips through between triangles; off = a faster test")
    ray_order: str = option(
        "image",
        "order of a batch: image = as given, shaft = shaft by shaft, in packets that share a list",
        choices=("image", "shaft"),
    )
    shaft_cells: int | None = option(None, "number of voxels; null = as many as the memory allows", null="by memory")
    shaft_directions: int = option(4, "cells along each side of a cube's faces")
    shaft_memory: float = option(
        1.0, "memory of look-up and lists if cells is null, at least 64 KiB", unit="times the BVH's"
    )
    shaft_probability: float = option(0.5, "hit probability from which a node is opened")
    shaft_rays: int = option(20, "rays sampled in each shaft")
    shaft_list: int = option(31, "most nodes of a list")
    shaft_subset: str = option("complete", "which shafts have lists", choices=(*SUBSETS, EYE))
    shaft_share: float = option(0.9, "fraction of a sample's rays whose shafts get lists, for subset sampled")
    shaft_empty: str = option(
        "miss", "what an empty list means: miss = a proven miss, root = start at the root", choices=("miss", "root")
    )
    shaft_occlusion: bool = option(True, "sampled rays end at their first hit")

    def keywords(self, tracing: Tracing) -> dict[str, Any]:
        """What the tracer takes beside what is traced."""
        own = {name if name in _PLAIN else name.removeprefix("shaft_"): value for name, value in vars(self).items()}
        own["longest"] = own.pop("list")
        if self.shaft_subset == EYE:
            own["subset"] = ShaftOptions.subset
        return own | {"threads": tracing.threads, "ties": tracing.ties}


def _make(mesh: Mesh, view: View, options: ClassifiedOptions, tracing: Tracing) -> Tracer:
    make: Any = EyeTracer if options.shaft_subset == EYE else ClassifiedTracer
    return make(mesh, view, **options.keywords(tracing))  # type: ignore[no-any-return]


def _make_rays(mesh: Mesh, options: ClassifiedOptions, tracing: Tracing) -> ShaftScene:
    if options.shaft_subset == EYE:
        raise InputError("shaft_subset is eye, whose shafts are parts of an image; expected another one for a batch")
    return ShaftScene(mesh, **options.keywords(tracing))


def _variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    words = []
    for field in fields(ClassifiedOptions):
        usual = field.metadata["null"] if field.default is None else field.default
        value = row.get(field.name)
        if field.name not in ("packet_width", "robust") and value not in (None, usual):
            words.append(f"{field.name.removeprefix('shaft_').replace('_', ' ')} {value}")
    return ", ".join(words + say_robust(row))


SHAFT_COLUMNS = (
    BVH_BYTES,
    Column("shafts", WHOLE, "shafts, with a list or without"),
    Column("shafts_built", WHOLE, "shafts with a list"),
    Column("lists_unique", WHOLE, "lists that are stored"),
    Column("list_length_mean", REAL, "nodes of a shaft's list"),
    Column("list_length_max", WHOLE, "nodes of the longest list"),
    Column("entry_height_mean", REAL, "levels below a node that stands in a list"),
    Column("root_height", WHOLE, "levels below the root"),
    Column("lookup_bytes", WHOLE, "memory by which a shaft's list is found"),
    Column("list_bytes", WHOLE, "memory of lists"),
    Column("shaft_build_time_s", REAL, "building lists, finding the resolution included"),
)

CLASSIFIED = Method(
    "classified",
    "classified rays",
    Style(SKY, "X"),
    ClassifiedOptions,
    _make,
    __name__,
    variant=_variant,
    counters=SHAFT_COLUMNS,
    make_rays=_make_rays,
)
