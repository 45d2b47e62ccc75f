"""Workload `multiframe`: several frames from one set of rays, beside frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, TypedDict

from atra.alignment.frames import FramesTracer
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.judge.compare import compare
from atra.tracing.tracer import Tracer
from experiments.harness.options import Settings, option
from experiments.harness.point import Measured, Point, make_own
from experiments.methods.aligned import ALIGNED
from experiments.methods.raster import RASTER
from experiments.methods.visible_first import VISIBLE_FIRST, VisibleFirstOptions
from experiments.workloads import rounds
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, say_gains
from experiments.workloads.images import Images, summed
from experiments.workloads.multiframe.motion import MOTIONS, make_together
from experiments.workloads.resources import Preparation, Resources
from experiments.workloads.typed import Times, workload


@dataclass(frozen=True)
class MultiframeOptions(Settings):
    """Raises InputError for fewer than two frames, and for two eyes of any other number."""

    frames: int = option(2, "images traced together; times, bytes and pixels are of all of them")
    motion: str = option(
        "eyes", "motion between frames: eyes, walk (the camera moves) or turn (the mesh turns)", choices=MOTIONS
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frames < 2:
            raise InputError(f"workload.frames is {self.frames}, expected at least 2")
        if self.motion == "eyes" and self.frames != 2:
            raise InputError(
                f"workload.frames is {self.frames} with workload.motion=eyes, expected 2: one for each eye"
            )


_headline = partial(say_gains, rtcIntersect1=SINGLE, separate_frames="separate")


def _problem(point: Point) -> str | None:
    if point.method.name == ALIGNED.name:
        return None
    return (
        f"workload=multiframe with method={point.method.name}, which traces one frame; use method={ALIGNED.name}, "
        "which is measured beside every other way"
    )


class SeparateBytes(TypedDict):
    """Memory of one aligned tracer a frame."""

    separate_embree_bytes: int


def make(point: Point, mesh: Mesh) -> FramesTracer:
    """All frames of the point, traced together."""
    return make_together(point, mesh, point.camera)


def _visible(point: Point, mesh: Mesh, view: View) -> Tracer:
    """The visible-first tracer of one frame, with the point's split."""
    names = "split_x", "split_y", "packet_width", "packet_rows", "robust"
    options = VisibleFirstOptions(**{name: getattr(point.options, name) for name in names})
    return VISIBLE_FIRST.make(mesh, view, options, point.tracing)


def _raster(point: Point, mesh: Mesh, view: View) -> Tracer:
    return RASTER.make(mesh, view, RASTER.options(), point.tracing)


WAYS: dict[str, rounds.MakeTracer] = {"separate": make_own, "visible_first": _visible, "rasteriser": _raster}
"""Ways with a tracer a frame, as columns and samples call them -> what makes one."""

MULTIFRAME = workload(
    "multiframe", __name__, _headline, Resources, Images, Preparation, BESIDE_BASELINES,
    Times(
        {f"{way}_render_time{{}}_s": way for way in WAYS} | {f"speedup_vs_{way}{{}}": (way, OWN) for way in WAYS}
    ),
    SeparateBytes,
    options=MultiframeOptions, problem=_problem,
    told=("render_time_s", *(f"speedup_vs_{way}" for way in (*WAYS, "packets")), "pixels_wrong"),
)  # fmt: skip


def measure(point: Point) -> Measured:
    """All frames together, timed in rounds with one tracer a frame of every other way, and compared frame by frame.
    Each frame may use the whole memory budget."""
    one_frame = rounds.baseline_makers() | WAYS
    rounds.warm_up(point, [make_together, *one_frame.values()])
    with ExitStack() as stack:
        own, results = rounds.build_own(point, stack)
        tracers = {
            name: [stack.enter_context(make_one(point, mesh, view)) for mesh, view in own.views]
            for name, make_one in one_frame.items()
        }
        results["baseline_build_time_s"] = sum(tracer.build_time_s for tracer in tracers[SINGLE])
        results["separate_embree_bytes"] = sum(tracer.embree_bytes for tracer in tracers["separate"])
        together = rounds.Frames(own)
        frames = {name: [rounds.Frames(tracer) for tracer in of_frames] for name, of_frames in tracers.items()}

        def compare_all() -> dict[str, Any]:
            pairs = zip(together.latest().images, frames[SINGLE], strict=True)
            images = summed([compare(hits, reference.latest()) for hits, reference in pairs])
            return {**images, **rounds.plan_and_build_again(own)}

        one_by_one = {name: partial(_each, of_frames) for name, of_frames in frames.items()}
        return rounds.race(point, {OWN: together, **one_by_one}, compare_all, results)


def _each(frames: Sequence[rounds.Frames]) -> None:
    for frame in frames:
        frame()
