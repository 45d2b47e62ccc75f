"""Method `aligned`: the paper's, with copies of the triangles per cell or an instance per cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from atra.alignment.aligned import AlignedTracer
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.drawing.style import BLUE
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.cells import VERIFIED, AlignedCellOptions, resolve_split
from experiments.methods.common_options import say_robust


class Geometry(Enum):
    """copied = a sheared copy of the triangles per cell; instanced = an Embree instance per cell, which cannot cull."""

    copied = "copied"
    instanced = "instanced"


class Reference(Enum):
    """off_axis = a quarter of the image from its centre; first_cell = the paper's."""

    off_axis = "off_axis"
    first_cell = "first_cell"


@dataclass(frozen=True)
class AlignedOptions(AlignedCellOptions):
    """culling: each copy keeps only what its cell's frustum meets; an instance is always the whole mesh."""

    geometry: Geometry = option(Geometry.copied, "copied = a sheared copy of the triangles per cell; or instanced")
    culling: bool = option(True, "each cell's copy keeps only what its frustum meets")
    reference: Reference = option(Reference.off_axis, "where the rays that are shot lie; first_cell = as in the paper")


def tracer_options(options: AlignedOptions, tracing: Tracing) -> dict[str, Any]:
    """What an `AlignedTracer`, or a `FramesTracer`, takes beside what is traced, its cells and where its rays lie."""
    return {
        "culling": options.culling,
        "geometry": options.geometry.value,
        "packet_width": options.packet_width,
        "packet_rows": options.packet_rows,
        "memory_budget_bytes": tracing.memory_budget_bytes,
        **tracing.ours | {"robust": options.robust},
    }


def _make(mesh: Mesh, view: View, options: AlignedOptions, tracing: Tracing) -> AlignedTracer:
    given = tracer_options(options, tracing)
    return AlignedTracer(mesh, view, options.split, reference=options.reference.value, **given)


def _resolve(options: AlignedOptions, width: int) -> AlignedOptions:
    resolved = resolve_split(options, width)
    return replace(resolved, culling=False) if resolved.geometry is Geometry.instanced else resolved


def _variant(row: Mapping[str, Any]) -> str:
    place = ["reference rays of the first cell"] if row.get("reference") == Reference.first_cell.value else []
    if row.get("geometry") == Geometry.instanced.value:
        return ", ".join(["instanced", *place, *say_robust(row)])
    culling = row.get("culling")
    culled = [] if culling is None else [f"culling {'on' if culling else 'off'}"]
    return ", ".join([*culled, *place, *say_robust(row)])


ALIGNED = Method(
    "aligned",
    "aligned",
    Style(BLUE, "o"),
    AlignedOptions,
    _make,
    __name__,
    _resolve,
    _variant,
    counters=(
        Column("triangles_left_out", WHOLE, "triangles left to the second pass, as no copy may show them"),
        VERIFIED,
    ),
)
