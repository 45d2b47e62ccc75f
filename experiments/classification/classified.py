"""Method `classified`: each ray starts from the nodes that rays of its shaft may meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.classification.options import ClassifiedOptions
from experiments.classification.own_bvh import BVH_BYTES, series_of
from experiments.classification.shafts.scene import ShaftScene
from experiments.classification.tracer import BvhTracer
from experiments.drawing.style import SKY
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import Method, Style, Tracing


def _make(mesh: Mesh, view: View, options: ClassifiedOptions, tracing: Tracing) -> Tracer:
    return BvhTracer(mesh, view, options, threads=tracing.threads, ties=tracing.ties)


def _make_rays(mesh: Mesh, options: ClassifiedOptions, tracing: Tracing) -> ShaftScene:
    return ShaftScene(mesh, options, tracing.threads)


def _variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    words = []
    for field in fields(ClassifiedOptions):
        usual = field.metadata["null"] if field.default is None else field.default
        value = row.get(field.name)
        if value not in (None, usual):
            words.append(f"{field.name.removeprefix('shaft_').replace('_', ' ')} {value}")
    return ", ".join(words)


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
    words=series_of("classified rays"),
)
