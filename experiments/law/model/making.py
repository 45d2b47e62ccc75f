"""The tracer of a choice."""

from __future__ import annotations

from typing import Any

from atra.alignment.aligned import AlignedTracer
from atra.alignment.visible_first import VisibleFirstTracer
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.packets.pixel import PixelTracer
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer
from experiments.classification.bvh.tracer import BvhTracer
from experiments.law.model.choice import Choice
from experiments.methods.culled.tracer import TiledTracer


def tracer_of(choice: Choice, mesh: Mesh, camera: View, *, threads: int | None = None, ties: str = "lowest") -> Tracer:
    """The tracer of a choice, not yet built. threads, ties: as for tracers.

    Raises InputError as its constructor does, and for classified rays, which are no candidates.
    """
    options: dict[str, Any] = {"threads": threads, "ties": ties}
    if choice.method == "raster":
        return RasterTracer(mesh, camera, **options)
    if choice.method == "pixel":
        return PixelTracer(mesh, camera, packet_width=choice.packet_width, **options)
    if choice.method == "bvh":
        return BvhTracer(mesh, camera, packet_width=choice.packet_width, **options)
    options |= {"packet_width": choice.packet_width}
    if choice.method == "tiles":
        return TiledTracer(mesh, camera, choice.split, **options)
    if choice.method == "visible_first":
        return VisibleFirstTracer(mesh, camera, choice.split, **options)  # type: ignore[arg-type]
    if choice.method == "aligned":
        return AlignedTracer(mesh, camera, choice.split, culling=choice.culling, **options)
    if choice.method == "instanced":
        return AlignedTracer(mesh, camera, choice.split, geometry="instanced", culling=False, **options)
    raise InputError(f"method is {choice.method!r}, which is no candidate")
