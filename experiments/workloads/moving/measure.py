"""Time of frames from another eye each: the point's own method and the baselines, round by round."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import cycle
from math import cos, pi, sin
from typing import Any

import numpy as np

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.judge.compare import compare
from atra.packets.pixel import PixelTracer
from atra.tracing.base import Views
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from experiments.harness.point import Measured, Point
from experiments.workloads.baselines import OWN, SINGLE
from experiments.workloads.images import counts, depth_errors
from experiments.workloads.moving import KEPT, STILL
from experiments.workloads.rounds import (
    Frames,
    build_baselines,
    build_own,
    measured,
    own_and_baselines,
    shrunk,
    timed_rounds,
    warm_up,
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


class KeptPackets(PixelTracer):
    """Packets per pixel over a BVH of the world, which serves every eye; rays start at the eye, rounded to float32.

    Less exact than `PixelTracer`: docs/methods.md says why. The view must be wide enough for rays in the world's axes.
    """

    def _plan_geometry(self) -> AlignedGeometry:
        forward = tuple(self.camera.axes[2].tolist())
        return plan_plain_geometry(self.mesh, replace(self.camera, eye=(0.0, 0.0, 0.0), target=forward))  # type: ignore[type-var]

    def _show_views(self, views: Views) -> None:
        super()._show_views(views)
        for workspace in self._workspaces:
            workspace.set_origin(self.camera.eye)

    def _look(self, camera: View) -> bool:
        self._show(self.mesh, camera)
        if self._is_built:
            self._plan_ties()
        return True


class MovingFrames(Frames):
    """Moves to the next camera of a path before every frame, round and round."""

    def __init__(self, tracer: Any, path: Sequence[View]) -> None:
        super().__init__(tracer)
        self._path = cycle(path)

    def trace(self) -> None:
        self._tracer.look(next(self._path))
        super().trace()


def _make_kept(point: Point, mesh: Mesh, view: View) -> KeptPackets:
    """Built once, so with medium quality, whatever the others use for every frame."""
    return KeptPackets(mesh, view, **point.tracing.ours | {"build_quality": "medium"})


def measure(point: Point) -> Measured:
    """Build the point's own method, read the memory, time it from eye to eye against the baselines, and compare the
    last frame. Raises InputError and MemoryBudgetError as the tracers do."""
    small = shrunk(point)
    warm_up(point, [*own_and_baselines(small), lambda mesh, view: _make_kept(small, mesh, view)])
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        camera = own.camera
        tracers = {OWN: own} | build_baselines(point, own, stack)
        tracers[KEPT] = stack.enter_context(_make_kept(point, own.mesh, camera))
        path = eyes_around(camera, own.mesh)
        images: dict[str, Frames] = {name: MovingFrames(tracer, path) for name, tracer in tracers.items()}
        calls = {name: one.trace for name, one in images.items()} | {STILL: Frames(own).trace}
        timed = timed_rounds(point, calls)
        single, kept = images[SINGLE].latest(), images[KEPT].latest()
        agreements = [compare(own.mesh, single.camera, images[OWN].latest(), single)]
        of_kept = compare(own.mesh, single.camera, kept, single)
        results |= counts(agreements) | depth_errors(agreements)
        results |= {
            "plan_time_s": own.plan_time_s,
            "build_time_s": own.build_time_s,
            "kept_pixels_wrong": of_kept.pixels_wrong,
            "kept_depth_error_p999": of_kept.depth_errors.p999,
        }
    return measured(results, timed)
