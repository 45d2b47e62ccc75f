"""Method `classified`: each ray starts from the nodes that rays of its shaft may meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

from atra.bvh.tracer import BvhTracer
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.shafts.eye import EyeTracer
from atra.shafts.options import ShaftOptions
from atra.shafts.scene import ShaftScene
from atra.shafts.tracer import ClassifiedTracer
from experiments.drawing.style import SKY
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.bvh import BVH_BYTES, Traversal
from experiments.methods.common_options import check_packet_width, robust_option, say_robust


class Subset(Enum):
    """Which shafts have lists; those of an eye are of images, one for each tile."""

    complete = "complete"
    occupied = "occupied"
    sampled = "sampled"
    hits = "hits"
    eye = "eye"
    none = "none"


class Empty(Enum):
    """What an empty list means."""

    miss = "miss"
    root = "root"


class RayOrder(Enum):
    """In which order a batch is traced."""

    image = "image"
    shaft = "shaft"


@dataclass(frozen=True)
class ClassifiedOptions:
    """packet_width: 1 = single rays; packets are for batches of rays. shaft_cells: None = as many as memory allows."""

    packet_width: int = option(1, "rays in a packet; 1 = single rays")
    traversal: Traversal = option(Traversal.pop, "when a node's box is tested: push or pop")
    robust: bool = robust_option()
    ray_order: RayOrder = option(RayOrder.image, "in which order a batch is traced: image or shaft")
    shaft_cells: int | None = option(None, "voxels; null = as many as shaft_memory allows", "by memory")
    shaft_directions: int = option(4, "cells along each side of a cube's faces")
    shaft_memory: float = option(1.0, "of look-up and lists, as a multiple of the BVH's")
    shaft_probability: float = option(0.5, "how probable a hit must be for a node to be opened")
    shaft_rays: int = option(20, "sampled in each shaft")
    shaft_list: int = option(31, "nodes of a list")
    shaft_subset: Subset = option(Subset.complete, "which shafts have lists")
    shaft_share: float = option(0.9, "of a sample's rays whose shafts have lists, where the subset is sampled")
    shaft_empty: Empty = option(Empty.miss, "what an empty list means: miss or root")
    shaft_occlusion: bool = option(True, "what a sampled ray hits hides what lies behind")

    def __post_init__(self) -> None:
        check_packet_width(self.packet_width)

    def library(self, tracing: Tracing) -> ShaftOptions:
        """The library's value for them."""
        return ShaftOptions(
            threads=tracing.threads,
            ties=tracing.ties,
            packet_width=self.packet_width,
            robust=self.robust,
            traversal=self.traversal.value,
            cells=self.shaft_cells,
            directions=self.shaft_directions,
            memory=self.shaft_memory,
            probability=self.shaft_probability,
            rays=self.shaft_rays,
            longest=self.shaft_list,
            subset="complete" if self.shaft_subset is Subset.eye else self.shaft_subset.value,
            share=self.shaft_share,
            empty=self.shaft_empty.value,
            occlusion=self.shaft_occlusion,
            shaft_order=self.ray_order is RayOrder.shaft,
        )


def _make(mesh: Mesh, view: View, options: ClassifiedOptions, tracing: Tracing) -> BvhTracer:
    make = EyeTracer if options.shaft_subset is Subset.eye else ClassifiedTracer
    return make(mesh, view, options.library(tracing))


def _make_rays(mesh: Mesh, options: ClassifiedOptions, tracing: Tracing) -> ShaftScene:
    if options.shaft_subset is Subset.eye:
        raise InputError("shaft_subset is eye, whose shafts are parts of an image; expected another one for a batch")
    return ShaftScene(mesh, options.library(tracing))


def _variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    words = []
    for field in fields(ClassifiedOptions):
        usual = field.metadata.get("null") if field.default is None else getattr(field.default, "value", field.default)
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
