"""Method `classified`: each ray starts from the nodes that rays of its shaft may meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.options import option_of
from experiments.classification.bvh.tracer import BvhTracer
from experiments.classification.own_bvh import BVH_BYTES
from experiments.classification.shafts.eye import EyeTracer
from experiments.classification.shafts.options import SUBSETS, ShaftOptions
from experiments.classification.shafts.scene import ShaftScene
from experiments.classification.shafts.tracer import ClassifiedTracer
from experiments.drawing.style import SKY
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.methods.options import MethodOptions, options_of, say_robust

EYE = "eye"
"""Subset of shafts: those of an image, one for each tile."""

_PLAIN = ("packet_width", "traversal", "robust", "ray_order")
"""Options that are called as in the library; the others are options of shafts here."""

_NAMES = {one.name: f"shaft_{one.name}" for one in fields(ShaftOptions) if one.name not in _PLAIN}


@options_of(ShaftOptions, _NAMES | {"longest": "shaft_list"})
class ClassifiedOptions(MethodOptions):
    """Packets are for batches of rays."""

    shaft_subset: str = option_of(ShaftOptions, "subset", choices=(*SUBSETS, EYE))

    def keywords(self, tracing: Tracing, kind: Any = None) -> dict[str, Any]:
        given = super().keywords(tracing, kind)
        return given | ({"subset": ShaftOptions.subset} if self.shaft_subset == EYE else {})


def _make(mesh: Mesh, view: View, options: ClassifiedOptions, tracing: Tracing) -> BvhTracer:
    make = EyeTracer if options.shaft_subset == EYE else ClassifiedTracer
    return make(mesh, view, **options.keywords(tracing))


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
