"""Workload `moving`: frames of a moving camera, which include whatever a method or a baseline does for a new eye."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import cos, pi, sin
from statistics import median
from typing import Any, TypedDict

import numpy as np

from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.judge.compare import compare
from atra.packets.pixel import Pixel, PreparedPixel
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from atra.tracing.tracer import Tracer
from experiments.harness.method import Tracing
from experiments.harness.point import Measured, Point
from experiments.harness.records import Record
from experiments.workloads import rounds
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE
from experiments.workloads.images import Images, summed
from experiments.workloads.resources import Prepared, Resources, say_ms
from experiments.workloads.typed import Times, Worst, workload

STILL, KEPT = "own_still", "packets_kept"
"""Names in the samples: the point's own method again from the same eye; the widest packets over a BVH of the world that
is built once, with less exact images."""


def _headline(record: Record) -> str:
    own, still = (median(record.samples[name]) for name in (OWN, STILL))
    return f"{say_ms(own)} from another eye, {say_ms(still)} from the same"


class Kept(TypedDict):
    """The last image of packets that keep their BVH."""

    kept_pixels_wrong: Worst
    kept_depth_error_p999: float


MOVING = workload(
    "moving", __name__, _headline, Resources, Images, Prepared, BESIDE_BASELINES,
    Times({
        "still_time{}_s": STILL,
        "moving_over_still{}": (OWN, STILL),
        "kept_packets_time{}_s": KEPT,
        "speedup_vs_kept_packets{}": (KEPT, OWN),
    }),
    Kept,
    rays=lambda row: "primary, camera moving",
)  # fmt: skip


EYES, RADIUS = 16, 1 / 400
"""Number of eyes on the circle, and its radius as a share of the scene's diagonal: 3 cm in a room of 13 m."""


def eyes_around(camera: View, mesh: Mesh) -> tuple[View, ...]:
    """EYES cameras that look the same way as `camera`, on a circle around it and across its view; none is `camera`."""
    radius = RADIUS * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    right, down, _ = camera.axes
    ways = [radius * (cos(2 * pi * place / EYES) * right + sin(2 * pi * place / EYES) * down) for place in range(EYES)]
    return tuple(
        replace(camera, eye=tuple(np.add(camera.eye, way)), target=tuple(np.add(camera.target, way)))  # type: ignore[type-var]
        for way in ways
    )


@dataclass(frozen=True)
class KeptPackets(Pixel):
    """Packets per pixel over a BVH of the world, which serves every eye; rays start at the eye, rounded to float32.

    Less exact than `Pixel`: docs/methods.md says why. The view must be wide enough for rays in the world's axes.
    """

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedPixel:
        """Build a BVH of the mesh in the world's axes."""
        return _PreparedKept(self, mesh, camera, pool)


class _PreparedKept(PreparedPixel):
    def plan_geometry(self, mesh: Mesh, camera: View) -> AlignedGeometry:
        forward = tuple(camera.axes[2].tolist())
        return plan_plain_geometry(mesh, replace(camera, eye=(0.0, 0.0, 0.0), target=forward))  # type: ignore[type-var]

    def take_camera(self, camera: View) -> None:
        super().take_camera(camera)
        for workspace in self.workspaces:
            workspace.set_origin(camera.eye)

    def still_serves(self, camera: View) -> bool:
        self.take_camera(camera)
        return True


def kept_tracer(mesh: Mesh, camera: View, tracing: Tracing, packet_width: int | None = None) -> Tracer:
    """A tracer of `KeptPackets`; built once, so with medium quality, whatever others use for every frame."""
    method = KeptPackets(packet_width, robust=False)
    return Tracer(mesh, camera, method, threads=tracing.threads, ties=tracing.ties)


def measure(point: Point) -> Measured:
    """Build the point's own method, read the memory, time it from eye to eye against the baselines, and compare the
    last frame. Raises InputError and MemoryBudgetError as the tracers do."""

    def make_kept(point: Point, mesh: Mesh, view: View) -> Tracer:
        return kept_tracer(mesh, view, point.tracing)

    rounds.warm_up(point, [*rounds.own_and_baselines(), make_kept])
    with ExitStack() as stack:
        tracers, results = rounds.build_with_baselines(point, stack)
        own = tracers[OWN]
        tracers[KEPT] = stack.enter_context(make_kept(point, own.mesh, own.camera))
        path = eyes_around(own.camera, own.mesh)
        frames = {name: rounds.Frames(tracer, path) for name, tracer in tracers.items()}

        def compare_last() -> dict[str, Any]:
            single = frames[SINGLE].latest()
            of_own, of_kept = (compare(frames[name].latest(), single) for name in (OWN, KEPT))
            kept = Kept(kept_pixels_wrong=of_kept.pixels_wrong, kept_depth_error_p999=of_kept.depth_errors.p999)
            prepared = Prepared(plan_time_s=own.plan_time_s, build_time_s=own.build_time_s)
            return {**summed([of_own]), **prepared, **kept}

        return rounds.race(point, frames | {STILL: rounds.Frames(own)}, compare_last, results)
