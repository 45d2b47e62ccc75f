"""Method `bvh`: one ray per pixel through our own binary BVH; what lists of nodes are held against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from atra.bvh.scene import BvhScene
from atra.bvh.tracer import BvhTracer
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.drawing.style import SKY
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.common_options import check_packet_width, robust_option, say_robust


class Traversal(Enum):
    """When the box of a node is tested: before it is put on the stack, or when it is taken from there."""

    push = "push"
    pop = "pop"


@dataclass(frozen=True)
class BvhOptions:
    """packet_width: 1 = single rays."""

    packet_width: int = option(1, "rays in a packet; 1 = single rays")
    traversal: Traversal = option(Traversal.push, "when a node's box is tested: push or pop")
    robust: bool = robust_option()

    def __post_init__(self) -> None:
        check_packet_width(self.packet_width)


BVH_BYTES = Column("bvh_bytes", WHOLE, "nodes and triangles of our own BVH")


def _make(mesh: Mesh, view: View, options: BvhOptions, tracing: Tracing) -> BvhTracer:
    return BvhTracer(
        mesh, view, packet_width=options.packet_width, traversal=options.traversal.value, threads=tracing.threads,
        ties=tracing.ties, robust=options.robust,
    )  # fmt: skip


def _make_rays(mesh: Mesh, options: BvhOptions, tracing: Tracing) -> BvhScene:
    return BvhScene(
        mesh, packet_width=options.packet_width, traversal=options.traversal.value, threads=tracing.threads,
        robust=options.robust,
    )  # fmt: skip


def variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    words = ["tested when popped"] if row.get("traversal") == Traversal.pop.value else []
    return ", ".join(words + say_robust(row))


BVH = Method(
    "bvh", "own BVH", Style(SKY, "P"), BvhOptions, _make, __name__, variant=variant, counters=(BVH_BYTES,),
    make_rays=_make_rays
)  # fmt: skip
