"""Method `tiles`: the cells' culling without alignment, one scene a cell."""

from __future__ import annotations

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.drawing.style import ORANGE
from experiments.harness.method import Method, Style, Tracing
from experiments.methods.culled.tracer import TiledTracer
from experiments.methods.options import CellOptions, resolve_split, say_robust


def _make(mesh: Mesh, view: View, options: CellOptions, tracing: Tracing) -> TiledTracer:
    return TiledTracer(mesh, view, options.split, **options.keywords(tracing))


TILES = Method(
    "tiles",
    "culled tiles",
    Style(ORANGE, "s"),
    CellOptions,
    _make,
    __name__,
    resolve_split,
    variant=lambda row: ", ".join(say_robust(row)),
)
