"""Point -> tracer: its own method, which may be a peer, and the two baselines it is measured against."""

from __future__ import annotations

from atra.errors import InputError
from atra.mesh import Mesh
from atra.tracers import AlignedTracer, PixelTracer, TiledTracer, Tracer, VisibleFirstTracer
from atra.view import View
from experiments.configuration import Method
from experiments.peers import PEERS, make_peer
from experiments.point import Point

_EXPERT_WIDTH = 8


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
        return AlignedTracer(
            mesh,
            camera,
            split=split,
            culling=point.culling,
            geometry=point.geometry,
            packet_width=point.packet_width,
            packet_rows=point.packet_rows,
            threads=point.threads,
            build_quality=point.build_quality,
            ties=point.ties,
            memory_budget_bytes=point.memory_budget_bytes,
        )
    if method is Method.visible_first:
        return VisibleFirstTracer(
            mesh,
            camera,
            split=split,
            packet_width=point.packet_width,
            packet_rows=point.packet_rows,
            threads=point.threads,
            build_quality=point.build_quality,
            ties=point.ties,
            memory_budget_bytes=point.memory_budget_bytes,
        )
    return TiledTracer(
        mesh,
        camera,
        split=split,
        packet_width=point.packet_width,
        threads=point.threads,
        build_quality=point.build_quality,
        ties=point.ties,
        memory_budget_bytes=point.memory_budget_bytes,
    )


def make_pixel_tracer(point: Point, mesh: Mesh, camera: View, packet_width: int | None) -> PixelTracer:
    """One ray per pixel, with the point's threads and build quality. packet_width 1 is the paper's baseline."""
    return PixelTracer(
        mesh,
        camera,
        packet_width=packet_width,
        threads=point.threads,
        build_quality=point.build_quality,
        ties=point.ties,
    )


def make_packet_tracer(point: Point, mesh: Mesh, camera: View) -> PixelTracer:
    """The expert's baseline: packets of 8, or where those are not native the widest that are."""
    try:
        return make_pixel_tracer(point, mesh, camera, _EXPERT_WIDTH)
    except InputError:
        return make_pixel_tracer(point, mesh, camera, None)
