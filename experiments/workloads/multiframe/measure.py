"""Time of several frames together: one pass for all, beside one tracer a frame and the baselines frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import compare
from atra.tracers import FramesTracer, Tracer
from atra.tracers.base import Prepared
from experiments.harness.point import Point
from experiments.methods.cells import AlignedCellOptions
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.workloads.baselines import OWN, PACKETS, SINGLE
from experiments.workloads.images import counts, depth_errors
from experiments.workloads.multiframe import SEPARATE, SEPARATE_VISIBLE
from experiments.workloads.multiframe.together import make_together
from experiments.workloads.rounds import (
    Frames,
    build_own,
    expert_packet_widths,
    make_single,
    measured,
    plan_and_build_again,
    shrunk,
    timed_rounds,
    warm_up,
)
from experiments.workloads.workload import Measured, make_own

Make = Callable[[Mesh, View], Tracer]


class SeparateFrames(Prepared):
    """One tracer a frame, one frame after the other: what all frames together are measured against.

    plan_time_s, build_time_s, embree_bytes: sums over the frames.
    """

    def __init__(self, tracers: Sequence[Tracer]) -> None:
        self.tracers = tuple(tracers)

    @property
    def build_time_s(self) -> float:
        return sum(tracer.build_time_s for tracer in self.tracers)

    @property
    def embree_bytes(self) -> int:
        return sum(tracer.embree_bytes for tracer in self.tracers)

    def trace(self, out: list[Hits] | None = None) -> list[Hits]:
        """All frames, in order. out: an earlier result that is no longer needed."""
        if out is None:
            return [tracer.trace() for tracer in self.tracers]
        return [tracer.trace(out=hits) for tracer, hits in zip(self.tracers, out, strict=True)]

    def close(self) -> None:
        for tracer in self.tracers:
            tracer.close()

    def _prepare(self) -> None:
        for tracer in self.tracers:
            tracer.plan()
            tracer.build()


def separate_makers(point: Point) -> dict[str, Make]:
    """How one frame is traced alone with the point's split, by name in the samples. Each frame alone has the whole of
    the point's memory budget."""
    own = point.options
    visible = AlignedCellOptions(own.split_x, own.split_y, own.packet_width, own.packet_rows)
    return {
        SEPARATE: lambda mesh, view: make_own(point, mesh, view),
        SEPARATE_VISIBLE: lambda mesh, view: VISIBLE_FIRST.make(mesh, view, visible, point.tracing),
    }


def _single(point: Point, packet_width: int, mesh: Mesh, view: View) -> Tracer:
    return make_single(point, mesh, view, packet_width)


def measure(point: Point) -> Measured:
    """All frames together, timed in rounds with one tracer a frame of every other way, and compared frame by frame."""
    packets = expert_packet_widths()
    small = shrunk(point)
    warm_up(
        point,
        [
            lambda mesh, view: make_together(small, mesh, view),
            *(partial(_single, small, width) for width in (1, *packets)),
            *separate_makers(small).values(),
        ],
    )
    with ExitStack() as stack:
        own, results = build_own(point, stack, lambda mesh, camera: make_together(point, mesh, camera))

        def for_each_frame(make: Make) -> SeparateFrames:
            pairs = zip(own.meshes, own.alignment.cameras, strict=True)
            return stack.enter_context(SeparateFrames([make(mesh, camera) for mesh, camera in pairs]))

        tracers: dict[str, FramesTracer | SeparateFrames] = {OWN: own}
        for name, width in ((SINGLE, 1), *((PACKETS[width], width) for width in packets)):
            tracers[name] = for_each_frame(partial(_single, point, width))
        tracers |= {name: for_each_frame(make) for name, make in separate_makers(point).items()}
        results |= {
            "baseline_build_time_s": float(tracers[SINGLE].build_time_s),
            "separate_embree_bytes": int(tracers[SEPARATE].embree_bytes),
        }
        images = {name: Frames(tracer) for name, tracer in tracers.items()}
        timed = timed_rounds(point, {name: one.trace for name, one in images.items()})
        pairs = zip(images[OWN].latest(), images[SINGLE].latest(), strict=True)
        agreements = [compare(hits.mesh, hits.camera, hits, reference) for hits, reference in pairs]
        results |= counts(agreements) | depth_errors(agreements) | plan_and_build_again(own)
    return measured(results, timed)
