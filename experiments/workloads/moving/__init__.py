"""Workload `moving`: frames of a moving camera, which include whatever a method or a baseline does for a new eye."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import cycle
from math import cos, pi, sin
from statistics import median
from typing import Any

import numpy as np

from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.judge.compare import compare
from atra.packets.pixel import Pixel, PreparedPixel
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from atra.tracing.tracer import Tracer
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import Tracing
from experiments.harness.options import NoOptions
from experiments.harness.point import Measured, Point, Workload
from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads import rounds
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, TIME_COLUMNS, over, over_own, series
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS, compared
from experiments.workloads.resources import PREPARATION, PREPARATION_COLUMNS, RESOURCE_COLUMNS, RESOURCES, say_ms

STILL, KEPT = "own_still", "packets_kept"
"""Names in the samples: the point's own method again from the same eye; the widest packets over a BVH of the world that
is built once, with less exact images."""


def _headline(record: Record) -> str:
    own, still = (median(record.samples[name]) for name in (OWN, STILL))
    return f"{say_ms(own)} from another eye, {say_ms(still)} from the same"


_own, _still, _kept = series(OWN), series(STILL), series(KEPT)

MOVING = Workload(
    name="moving",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *IMAGE_COLUMNS,
        *PREPARATION_COLUMNS[:2],
        *TIME_COLUMNS,
        *statistics_columns("still_time{}_s", "one frame from the same eye as the one before", _still),
        *statistics_columns("moving_over_still{}", "a frame from another eye / one from the same", over(_own, _still)),
        *statistics_columns("kept_packets_time{}_s", "the widest packets over a BVH of the world, kept", _kept),
        *statistics_columns("speedup_vs_kept_packets{}", "packets over a BVH of the world / this", over_own(_kept)),
        Column("kept_pixels_wrong", WHOLE, "pixels of packets over a BVH of the world without an excuse", over=max),
        Column("kept_depth_error_p999", REAL, "99.9th percentile of the depth errors of packets over a kept BVH"),
    ),
    headline=_headline,
    rays=lambda row: "primary, camera moving",
    package=__name__,
    samples=lambda point: frozenset((OWN, STILL, SINGLE, KEPT)),
    needs=(*RESOURCES, *PIXELS, *PREPARATION[:2]),
    **BESIDE_BASELINES,
)


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


class MovingFrames(rounds.Frames):
    """Moves to the next camera of a path before every frame, round and round."""

    def __init__(self, tracer: Any, path: Sequence[View]) -> None:
        super().__init__(tracer)
        self._path = cycle(path)

    def __call__(self) -> None:
        self._tracer.look(next(self._path))
        super().__call__()


def kept_tracer(mesh: Mesh, camera: View, tracing: Tracing, packet_width: int | None = None) -> Tracer:
    """A tracer of `KeptPackets`; built once, so with medium quality, whatever others use for every frame."""
    method = KeptPackets(packet_width, robust=False)
    return Tracer(mesh, camera, method, threads=tracing.threads, ties=tracing.ties)


def measure(point: Point) -> Measured:
    """Build the point's own method, read the memory, time it from eye to eye against the baselines, and compare the
    last frame. Raises InputError and MemoryBudgetError as the tracers do."""
    small = rounds.shrunk(point)
    rounds.warm_up(point, [*rounds.own_and_baselines(small), lambda mesh, view: kept_tracer(mesh, view, small.tracing)])
    with ExitStack() as stack:
        own, results = rounds.build_own(point, stack)
        camera = own.camera
        tracers = {OWN: own} | rounds.build_baselines(point, own, stack)
        tracers[KEPT] = stack.enter_context(kept_tracer(own.mesh, camera, point.tracing))
        path = eyes_around(camera, own.mesh)
        frames: dict[str, rounds.Frames] = {name: MovingFrames(tracer, path) for name, tracer in tracers.items()}

        def compare_last() -> dict[str, Any]:
            single, kept = frames[SINGLE].latest(), frames[KEPT].latest()
            of_kept = compare(kept, single)
            return compared(frames[OWN].latest(), single) | {
                "plan_time_s": own.plan_time_s,
                "build_time_s": own.build_time_s,
                "kept_pixels_wrong": of_kept.pixels_wrong,
                "kept_depth_error_p999": of_kept.depth_errors.p999,
            }

        return rounds.race(point, frames | {STILL: rounds.Frames(own)}, compare_last, results)
