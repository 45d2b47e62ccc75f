"""Workload `surface`: frames with barycentric weights and normals, which Embree returns with every packet and aligned
tracers compute on demand."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from statistics import median

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import RayGrid, TracedImage
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.packets.pixel import Pixel, PreparedPixel
from atra.tracing.rays import image_ray_grid
from atra.tracing.tracer import Tracer
from experiments.harness.method import Tracing
from experiments.harness.point import Measured, Point, make_own
from experiments.harness.records import Record
from experiments.workloads.baselines import OWN
from experiments.workloads.resources import Resources, say_ms
from experiments.workloads.rounds import Frames, build_own, make_single, race, warm_up
from experiments.workloads.surface.surface_kernels import Surface, surface_kernel
from experiments.workloads.typed import Times, workload

OWN_SURFACE, PLAIN_PACKETS, PACKETS_SURFACE = "own_surface", "packets", "packets_surface"
"""Names in the samples: the point's own method and then u, v and normals on demand; packets per pixel without them, and
with those that Embree returns stored beside."""


def _headline(record: Record) -> str:
    own, surface = (median(record.samples[name]) for name in (OWN, OWN_SURFACE))
    packets, stored = (median(record.samples[name]) for name in (PLAIN_PACKETS, PACKETS_SURFACE))
    return f"{say_ms(own)}, with u, v and normals {say_ms(surface)}; packets {say_ms(packets)} and {say_ms(stored)}"


SURFACE = workload(
    "surface", __name__, _headline, Resources,
    Times({
        "render_time{}_s": OWN,
        "surface_time{}_s": OWN_SURFACE,
        "packets_time{}_s": PLAIN_PACKETS,
        "packets_surface_time{}_s": PACKETS_SURFACE,
        "surface_over_frame{}": (OWN_SURFACE, OWN),
        "packets_surface_over_frame{}": (PACKETS_SURFACE, PLAIN_PACKETS),
        "speedup_vs_packets_with_surface{}": (PACKETS_SURFACE, OWN_SURFACE),
    }, judged=OWN_SURFACE),
)  # fmt: skip


class SurfacePackets(Pixel):
    """Packets per pixel that also store u, v and normals.

    Ties are resolved in `prim_id` only: where triangles tie, u, v and normals may belong to another one.
    """

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedSurface:
        """Build as `Pixel` does."""
        return PreparedSurface(self, mesh, camera, pool)


class PreparedSurface(PreparedPixel):
    """surface: u, v and normals of the last frame, undefined where nothing is hit."""

    def take_camera(self, camera: View) -> None:
        super().take_camera(camera)
        size = camera.height, camera.width
        self.surface = Surface(np.empty(size, np.float32), np.empty(size, np.float32), np.empty((*size, 3), np.float32))

    def draw(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        shape, workspaces = self.method.packet_shape, self.workspaces
        tiles, scene, surface = self.tiles, self.scene.address, self.surface
        rays, image = RayGrid(*image_ray_grid(self.camera, offset, shape)), TracedImage(depth, prim_id)
        kernel = surface_kernel(*shape)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, workspaces[worker].packet, rays, tiles, image, surface)

        self.pool.run(work)


def surface_tracer(mesh: Mesh, camera: View, tracing: Tracing) -> Tracer:
    """A tracer of `SurfacePackets` in the widest packets, whose `prepared` holds the surface."""
    method = SurfacePackets(build_quality=tracing.build_quality, robust=False)
    return Tracer(mesh, camera, method, threads=tracing.threads, ties=tracing.ties)


def measure(point: Point) -> Measured:
    """Raises InputError and MemoryBudgetError as the tracers do."""

    def make_packets(point: Point, mesh: Mesh, view: View) -> Tracer:
        return surface_tracer(mesh, view, point.tracing)

    warm_up(point, [make_own, partial(make_single, packet_width=None), make_packets])
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        plain = stack.enter_context(make_single(point, own.mesh, own.camera, None))
        storing = stack.enter_context(make_packets(point, own.mesh, own.camera))
        tracers = {OWN: own, PLAIN_PACKETS: plain, PACKETS_SURFACE: storing}
        demanded = Frames(own)

        def trace_and_ask() -> None:
            demanded()
            surface_of(demanded.latest())

        trace_and_ask()  # compiles what computes them
        frames = {name: Frames(tracer) for name, tracer in tracers.items()}
        return race(point, {**frames, OWN_SURFACE: trace_and_ask}, results=results)


def surface_of(hits: Hits) -> tuple[NDArray[np.float32], ...]:
    """u, v and unit normal of every pixel, computed by as many threads as have traced."""
    return hits.u, hits.v, hits.normals
