"""Method `bvh`: one ray per pixel through our own binary BVH; what lists of nodes are held against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.classification.bvh import options as library
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.tracer import BvhTracer
from experiments.drawing.style import SKY
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import LANES, Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.options import MethodOptions, keywords_of, robust_option, say_robust


def traversal_option(default: str) -> Any:
    """The option `traversal`: the order of tests in our BVH."""
    return option(
        default,
        "when a node's box is tested: push = with its sibling's, nearer first, pop = when it is popped",
        choices=("push", "pop"),
    )


def width_option() -> Any:
    """The option `packet_width` of our BVH."""
    return option(1, "rays in a packet; 1 = single rays", choices=(1, *LANES))


@dataclass(frozen=True)
class BvhOptions(MethodOptions):
    """Options of single rays and packets through our BVH."""

    packet_width: int = width_option()
    traversal: str = traversal_option("push")
    robust: bool = robust_option("no ray slips through between triangles; off = a faster test")


BVH_BYTES = Column("bvh_bytes", WHOLE, "nodes and triangles of our own BVH")


def _make(mesh: Mesh, view: View, options: BvhOptions, tracing: Tracing) -> Tracer:
    return BvhTracer(mesh, view, **keywords_of(library.BvhOptions, options, tracing))


def _make_rays(mesh: Mesh, options: BvhOptions, tracing: Tracing) -> BvhScene:
    return BvhScene(mesh, **keywords_of(library.BvhOptions, options, tracing))


def variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    words = ["tested when popped"] if row.get("traversal") == "pop" else []
    return ", ".join(words + say_robust(row))


BVH = Method(
    "bvh", "own BVH", Style(SKY, "P"), BvhOptions, _make, __name__, variant=variant, counters=(BVH_BYTES,),
    make_rays=_make_rays,
)  # fmt: skip
