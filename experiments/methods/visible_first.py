"""Method `visible_first`: aligned rays for what is visible, the rest ruled out tile by tile."""

from __future__ import annotations

from atra.alignment.visible_first import VisibleFirstTracer
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.drawing.style import VERMILLION
from experiments.harness.column import REAL, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.methods.options import VERIFIED, AlignedCellOptions, keywords_of, resolve_split, say_robust


def _make(mesh: Mesh, view: View, options: AlignedCellOptions, tracing: Tracing) -> Tracer:
    return VisibleFirstTracer(mesh, view, options.split, **keywords_of(VisibleFirstTracer, options, tracing))


VISIBLE_FIRST = Method(
    "visible_first",
    "visible-first",
    Style(VERMILLION, "D"),
    AlignedCellOptions,
    _make,
    __name__,
    resolve_split,
    variant=lambda row: ", ".join(say_robust(row)),
    counters=(VERIFIED, Column("probe_time_s", REAL, "the probe, part of the plan")),
)
