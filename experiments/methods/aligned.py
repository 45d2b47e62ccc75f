"""Method `aligned`: the paper's, with copies of the triangles per cell or an instance per cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from experiments.drawing.style import BLUE
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import Settings, option
from experiments.methods import options as common

# The tracer is imported when one is made: the help of the command line has no time for it.
if TYPE_CHECKING:
    from atra.geometry.mesh import Mesh
    from atra.geometry.view import View
    from atra.tracing.tracer import Tracer


@dataclass(frozen=True)
class AlignedOptions(Settings):
    """An instance is always the whole mesh, so culling is off where there are any."""

    section = "method"
    split_x: int | None = common.split_x_option()
    split_y: int = common.split_y_option()
    packet_width: int | None = common.packet_width_option()
    robust: bool = common.robust_option()
    packet_rows: int | None = common.packet_rows_option()
    geometry: str = option(
        "copied",
        "copied = a sheared copy of the triangles per cell, instanced = one Embree instance of them per cell",
        choices=("copied", "instanced"),
    )
    culling: bool = option(True, "keep only triangles that a cell's frustum meets")
    reference: str = option(
        "off_axis",
        "reference cell: off_axis = a quarter of the image from its centre, first_cell = as in the paper; the image is "
        "the same",
        choices=("off_axis", "first_cell"),
    )


def _make(mesh: Mesh, view: View, options: AlignedOptions, tracing: Tracing) -> Tracer:
    from atra.alignment.aligned import AlignedTracer

    return AlignedTracer(mesh, view, common.split_of(options), **common.keywords_of(AlignedTracer, options, tracing))


def _resolve(options: AlignedOptions, width: int) -> AlignedOptions:
    resolved = common.resolve_split(options, width)
    return replace(resolved, culling=False) if resolved.geometry == "instanced" else resolved


def _variant(row: Mapping[str, Any]) -> str:
    place = ["reference rays of the first cell"] if row.get("reference") == "first_cell" else []
    if row.get("geometry") == "instanced":
        return ", ".join(["instanced", *place, *common.say_robust(row)])
    culling = row.get("culling")
    culled = [] if culling is None else [f"culling {'on' if culling else 'off'}"]
    return ", ".join([*culled, *place, *common.say_robust(row)])


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
        common.VERIFIED,
    ),
)
