"""Method `bvh`: one ray per pixel through our own binary BVH; what lists of nodes are held against."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.classification.bvh import options as library
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.tracer import BvhTracer
from experiments.drawing.style import SKY
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.methods.options import MethodOptions, options_of, say_robust


@options_of(library.BvhOptions)
class BvhOptions(MethodOptions):
    """Options of single rays and packets through our BVH."""


BVH_BYTES = Column("bvh_bytes", WHOLE, "nodes and triangles of our own BVH")


def _make(mesh: Mesh, view: View, options: BvhOptions, tracing: Tracing) -> BvhTracer:
    return BvhTracer(mesh, view, **options.keywords(tracing))


def _make_rays(mesh: Mesh, options: BvhOptions, tracing: Tracing) -> BvhScene:
    return BvhScene(mesh, **options.keywords(tracing))


def variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    words = ["tested when popped"] if row.get("traversal") == "pop" else []
    return ", ".join(words + say_robust(row))


BVH = Method(
    "bvh", "own BVH", Style(SKY, "P"), BvhOptions, _make, __name__, variant=variant, counters=(BVH_BYTES,),
    make_rays=_make_rays,
)  # fmt: skip
