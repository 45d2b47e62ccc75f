"""Options of rays of one's own."""

from __future__ import annotations

from dataclasses import dataclass

from atra.tracing.options import EmbreeKeywords, EmbreeOptions, option

PRECISIONS = ("exact", "watertight", "fast")
"""How the hits of rays of one's own are found."""


class RayKeywords(EmbreeKeywords, total=False):
    precision: str


@dataclass(frozen=True)
class RayOptions(EmbreeOptions):
    """Options of `RayScene`; `packet_width` and `build_quality` are for "watertight" and "fast", which ask Embree.
    Without a `packet_width` only rays that are alike go in packets, and others are traced one by one, which is faster.

    With "fast" rays also slip past meshes far from the world's origin, where float32 is coarse: of 200,000 rays in a
    closed box that lies a hundred times its size away 2 are lost, at a thousand times 43.
    """

    precision: str = option(
        "exact",
        "exact: hits are those of the rays and vertices as stored, decided without rounding; watertight: Embree's "
        "robust arithmetic, no ray slips through between two triangles; fast: Embree's fast arithmetic",
        choices=PRECISIONS,
    )
