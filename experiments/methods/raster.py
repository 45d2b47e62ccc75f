"""Method `raster`: triangles drawn onto the pixels their rays meet; clusters of them are built once per mesh."""

from __future__ import annotations

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer
from experiments.drawing.style import BLACK
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import NoOptions


def _make(mesh: Mesh, view: View, options: NoOptions, tracing: Tracing) -> Tracer:
    return RasterTracer(mesh, view, threads=tracing.threads, ties=tracing.ties)


RASTER = Method(
    "raster", "rasteriser", Style(BLACK, "*"), NoOptions, _make, __name__,
    counters=(Column("scratch_bytes", WHOLE, "memory that frames share: projected corners, lists of triangles"),),
)  # fmt: skip
