"""Method `raster`: triangles drawn onto the pixels their rays meet; clusters of them are built once per mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.instruction_sets import LANE_COUNTS
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.frames import FrameMemory
from atra.raster.image import Eye
from atra.raster.tracer import PreparedRaster, Raster
from atra.tracing.tracer import Tracer
from experiments.drawing.style import BLACK
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.options import MethodOptions

CLUSTERS = ("hidden", "outside", "none")
"""Clusters that are not drawn."""


@dataclass(frozen=True)
class RasterOptions(MethodOptions):
    """What its parts gain."""

    lanes: int | None = option(
        None,
        "pixels drawn at once; null = as many as this machine's widest vectors hold; no image differs",
        choices=LANE_COUNTS,
        null="native",
    )
    left_out: str = option(
        "hidden",
        "clusters that are not drawn: hidden = those outside of the view or a band, or hidden by what is drawn; "
        "outside = the former alone; none = every band looks at every triangle",
        choices=CLUSTERS,
    )


class WithoutOcclusion(FrameMemory):
    """Clusters come nearest first, and none counts as hidden."""

    def order(self) -> NDArray[np.int64]:
        order = super().order()
        self.bounds[:] = np.inf
        return order


class WithoutClusters(FrameMemory):
    """Every cluster may show its triangles anywhere."""

    def cull(self, eye: Eye, camera: View, band_rows: int, pool: WorkerPool) -> None:
        self.rectangles[:] = 0, camera.width - 1, 0, camera.height - 1
        self.bounds[:] = np.inf


_MEMORIES = dict(zip(CLUSTERS, (FrameMemory, WithoutOcclusion, WithoutClusters), strict=True))


@dataclass(frozen=True)
class _Ablated(Raster):
    """The rasteriser without a part. memory_type: what culls its clusters."""

    memory_type: type[FrameMemory] = FrameMemory

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedRaster:
        prepared = super().prepare(mesh, camera, pool)
        memory = prepared.memory
        prepared.memory = self.memory_type(memory.clusters, memory.rectangles, memory.bounds)
        return prepared


def _make(mesh: Mesh, view: View, options: RasterOptions, tracing: Tracing) -> Tracer:
    method = _Ablated(options.lanes, _MEMORIES[options.left_out])
    return Tracer(mesh, view, method, threads=tracing.threads, ties=tracing.ties)


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
