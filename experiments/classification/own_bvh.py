"""Method `bvh`: one ray per pixel through our own binary BVH; what lists of nodes are held against."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.options import BvhOptions
from experiments.classification.tracer import BvhTracer
from experiments.drawing.style import SKY
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing

BVH_BYTES = Column("bvh_bytes", WHOLE, "nodes and triangles of our own BVH")


def _make(mesh: Mesh, view: View, options: BvhOptions, tracing: Tracing) -> Tracer:
    return BvhTracer(mesh, view, options, threads=tracing.threads, ties=tracing.ties)


def _make_rays(mesh: Mesh, options: BvhOptions, tracing: Tracing) -> BvhScene:
    return BvhScene(mesh, options, tracing.threads)


def variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    return "tested when popped" if row.get("traversal") == "pop" else ""


def series_of(label: str) -> Callable[[int | None], str]:
    """`Method.words`: rays are single, but older tables have packets."""

    def words(packet_width: int | None) -> str:
        if packet_width is None:
            return label
        return f"{label}, single rays" if packet_width == 1 else f"{label}, packets of {packet_width}"

    return words


BVH = Method(
    "bvh", "own BVH", Style(SKY, "P"), BvhOptions, _make, __name__, variant=variant, counters=(BVH_BYTES,),
    make_rays=_make_rays, words=series_of("own BVH"),
)  # fmt: skip
