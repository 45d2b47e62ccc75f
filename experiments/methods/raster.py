"""Method `raster`: triangles drawn onto the pixels their rays meet; clusters of them are built once per mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.frames import Scratch
from atra.raster.image import Eye
from atra.raster.tracer import RasterTracer
from atra.tracing import options as library
from atra.tracing.options import option
from experiments.drawing.style import BLACK
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.methods.options import MethodOptions, options_of

CLUSTERS = ("hidden", "outside", "none")
"""Clusters that are not drawn."""


@options_of(library.RasterOptions)
class RasterOptions(MethodOptions):
    """What its parts gain."""

    left_out: str = option(
        "hidden",
        "clusters that are not drawn: hidden = those outside of the view or a band, or hidden by what is drawn; "
        "outside = the former alone; none = every band looks at every triangle",
        choices=CLUSTERS,
    )


class WithoutOcclusion(Scratch):
    """Clusters come nearest first, and none counts as hidden."""

    def order(self) -> NDArray[np.int64]:
        found = super().order()
        self.bounds[:] = np.inf
        return found


class WithoutClusters(Scratch):
    """Every cluster may show its triangles anywhere."""

    def cull(self, eye: Eye, camera: View, band_rows: int, pool: WorkerPool) -> None:
        self.rectangles[:] = 0, camera.width - 1, 0, camera.height - 1
        self.bounds[:] = np.inf


_SCRATCHES = dict(zip(CLUSTERS[1:], (WithoutOcclusion, WithoutClusters), strict=True))


class CulledOtherwise(RasterTracer):
    """The rasteriser with another scratch. scratch_type: what culls its clusters, set before it is built."""

    scratch_type: type[Scratch] = Scratch

    def _build(self) -> float:
        taken_s = super()._build()
        assert self._scratch is not None
        self._scratch = self.scratch_type(self._scratch.clusters, self._scratch.rectangles, self._scratch.bounds)
        return taken_s


def _make(mesh: Mesh, view: View, options: RasterOptions, tracing: Tracing) -> RasterTracer:
    if options.left_out not in _SCRATCHES:
        return RasterTracer(mesh, view, **options.keywords(tracing))
    tracer = CulledOtherwise(mesh, view, **options.keywords(tracing))
    tracer.scratch_type = _SCRATCHES[options.left_out]
    return tracer


def _variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    said = {"outside": "without occlusion", "none": "without clusters"}.get(str(row.get("left_out")))
    lanes = row.get("lanes")
    return ", ".join(filter(None, [said, None if lanes in (None, "native") else f"{lanes} lanes"]))


RASTER = Method(
    "raster",
    "rasteriser",
    Style(BLACK, "*"),
    RasterOptions,
    _make,
    __name__,
    variant=_variant,
    counters=(Column("scratch_bytes", WHOLE, "what frames share: projected corners, lists of triangles"),),
)
