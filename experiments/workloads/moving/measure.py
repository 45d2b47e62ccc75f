"""Time of frames from another eye each: the point's own method and the baselines, round by round."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from itertools import cycle
from typing import Any

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.judge.compare import compare
from experiments.harness.point import Measured, Point, make_own
from experiments.workloads.baselines import OWN, PACKETS, SINGLE
from experiments.workloads.images import counts, depth_errors
from experiments.workloads.moving import KEPT, STILL
from experiments.workloads.moving.kept import KeptPackets
from experiments.workloads.moving.path import eyes_around
from experiments.workloads.rounds import (
    Frames,
    build_own,
    expert_packet_widths,
    make_single,
    measured,
    shrunk,
    timed_rounds,
    warm_up,
)


class MovingFrames(Frames):
    """Looks through the next camera of a path, from the first on and round and round, before every frame."""

    def __init__(self, tracer: Any, path: Sequence[View]) -> None:
        super().__init__(tracer)
        self._path = cycle(path)

    def trace(self) -> None:
        self._tracer.look(next(self._path))
        super().trace()


def _make_kept(point: Point, mesh: Mesh, view: View) -> KeptPackets:
    """Of medium quality, whatever the others build anew every frame: it is built once."""
    return KeptPackets(mesh, view, **point.tracing.ours | {"build_quality": "medium"})


def measure(point: Point) -> Measured:
    """Build the point's own method, read the memory, time it from eye to eye against the baselines, and compare the
    last frame. Raises InputError and MemoryBudgetError as the tracers do."""
    small, packets = shrunk(point), expert_packet_widths()
    warm_up(
        point,
        [
            lambda mesh, view: make_own(small, mesh, view),
            *(lambda mesh, view, width=width: make_single(small, mesh, view, width) for width in (1, *packets)),
            lambda mesh, view: _make_kept(small, mesh, view),
        ],
    )
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        camera = own.camera
        tracers = {OWN: own, SINGLE: stack.enter_context(make_single(point, own.mesh, camera))}
        for width in packets:
            tracers[PACKETS[width]] = stack.enter_context(make_single(point, own.mesh, camera, width))
        tracers[KEPT] = stack.enter_context(_make_kept(point, own.mesh, camera))
        path = eyes_around(camera, own.mesh)
        images: dict[str, Frames] = {name: MovingFrames(tracer, path) for name, tracer in tracers.items()}
        calls = {name: one.trace for name, one in images.items()} | {STILL: Frames(own).trace}
        timed = timed_rounds(point, calls)
        single, kept = images[SINGLE].latest(), images[KEPT].latest()
        agreements = [compare(own.mesh, single.camera, images[OWN].latest(), single)]
        of_kept = compare(own.mesh, single.camera, kept, single)
        results |= (
            counts(agreements)
            | depth_errors(agreements)
            | {
                "plan_time_s": own.plan_time_s,
                "build_time_s": own.build_time_s,
                "kept_pixels_wrong": of_kept.pixels_wrong,
                "kept_depth_error_p999": of_kept.depth_errors.p999,
            }
        )
    return measured(results, timed)
