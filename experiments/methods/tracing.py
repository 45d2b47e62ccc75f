"""Point -> tracer: its own method, which may be a peer, and the baselines it is measured against."""

from __future__ import annotations

from typing import Any

from atra.embree.library import load_library
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracers import AlignedTracer, PixelTracer, TiledTracer, Tracer, VisibleFirstTracer
from experiments.harness.configuration import Method
from experiments.harness.point import Point
from experiments.methods.peers import PEERS, make_peer


def make_tracer(point: Point, mesh: Mesh, camera: View, split: tuple[int, int] | None = None) -> Tracer:
    """The point's own method; nothing is planned or built yet. split: in place of the point's.

    Raises InputError and MemoryBudgetError as the tracers do.
    """
    split = split or (point.split_x, point.split_y)
    method = Method(point.method)
    if method.value in PEERS:
        return make_peer(method.value, mesh, camera, point.threads)
    if method is Method.pixel:
        return make_pixel_tracer(point, mesh, camera, point.packet_width)
    if method is Method.aligned:
        return AlignedTracer(mesh, camera, split, **aligned_options(point))
    if method is Method.visible_first:
        return VisibleFirstTracer(mesh, camera, split, packet_rows=point.packet_rows, **_cell_options(point))
    return TiledTracer(mesh, camera, split, **_cell_options(point))


def aligned_options(point: Point) -> dict[str, Any]:
    """What the point asks of an `AlignedTracer`, or a `FramesTracer`, beside what is traced and its cells."""
    own = {"culling": point.culling, "geometry": point.geometry, "packet_rows": point.packet_rows}
    return own | _cell_options(point)


def _cell_options(point: Point) -> dict[str, Any]:
    """Those of every method with cells."""
    own = {"packet_width": point.packet_width, "memory_budget_bytes": point.memory_budget_bytes}
    return own | _common_options(point)


def _common_options(point: Point) -> dict[str, Any]:
    """Those of every method of ours."""
    return {"threads": point.threads, "build_quality": point.build_quality, "ties": point.ties}


def make_pixel_tracer(point: Point, mesh: Mesh, camera: View, packet_width: int | None) -> PixelTracer:
    """One ray per pixel, with the point's threads and build quality. packet_width 1 is the paper's baseline."""
    return PixelTracer(mesh, camera, packet_width=packet_width, **_common_options(point))


def expert_packet_widths() -> tuple[int, ...]:
    """Packets an expert would try: of every native width from 8 on, or where there is none the widest."""
    native = load_library().native_packet_widths
    return tuple(width for width in native if width >= 8) or native[-1:]
