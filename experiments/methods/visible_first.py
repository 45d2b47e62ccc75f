"""Method `visible_first`: aligned rays for what is visible, the rest ruled out tile by tile."""

from __future__ import annotations

from dataclasses import dataclass

from atra.alignment.visible_first import VisibleFirstTracer
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.drawing.style import VERMILLION
from experiments.harness.column import REAL, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import Settings
from experiments.methods import options as common


@dataclass(frozen=True)
class VisibleFirstOptions(Settings):
    """Cells and packets."""

    section = "method"
    split_x: int | None = common.split_x_option()
    split_y: int = common.split_y_option()
    packet_width: int | None = common.packet_width_option()
    robust: bool = common.robust_option()
    packet_rows: int | None = common.packet_rows_option()


def _make(mesh: Mesh, view: View, options: VisibleFirstOptions, tracing: Tracing) -> Tracer:
    return VisibleFirstTracer(
        mesh, view, common.split_of(options), **common.keywords_of(VisibleFirstTracer, options, tracing)
    )


VISIBLE_FIRST = Method(
    "visible_first",
    "visible-first",
    Style(VERMILLION, "D"),
    VisibleFirstOptions,
    _make,
    __name__,
    common.resolve_split,
    variant=lambda row: ", ".join(common.say_robust(row)),
    counters=(common.VERIFIED, Column("probe_time_s", REAL, "the probe, part of the plan")),
)
