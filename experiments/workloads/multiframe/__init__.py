"""Workload `multiframe`: several frames from one set of rays, beside frame by frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from atra.alignment.frames import FramesTracer
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import compare
from atra.tracing.lifetime import Lifetime
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.method import AnyTracer
from experiments.harness.options import Settings, option
from experiments.harness.point import Measured, Point, Workload, make_own
from experiments.harness.records import Record
from experiments.methods.aligned import ALIGNED
from experiments.methods.aligned_cells import AlignedCellOptions
from experiments.methods.raster import RASTER
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.statistics import Series, statistics_columns
from experiments.workloads import rounds
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, PACKETS, SINGLE, TIME_COLUMNS, over_own, series
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS, counts, depth_errors
from experiments.workloads.multiframe.motion import MOTIONS, make_together
from experiments.workloads.resources import PREPARATION, RESOURCE_COLUMNS, RESOURCES

SEPARATE, SEPARATE_VISIBLE, SEPARATE_RASTER = "separate", "visible_first", "rasteriser"
"""Names in the samples: one aligned tracer a frame, one visible-first tracer a frame, and one rasteriser a frame."""


@dataclass(frozen=True)
class MultiframeOptions(Settings):
    """Raises InputError for fewer than two frames, and for two eyes of any other number."""

    frames: int = option(2, "images traced together; times, bytes and pixels are of all of them")
    motion: str = option(
        "eyes", "how they differ: eyes, walk (the camera moves) or turn (the mesh turns)", choices=MOTIONS
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frames < 2:
            raise InputError(f"workload.frames is {self.frames}, expected at least 2")
        if self.motion == "eyes" and self.frames != 2:
            raise InputError(
                f"workload.frames is {self.frames} with workload.motion=eyes, expected 2: one for each eye"
            )


def _headline(record: Record) -> str:
    own, single, separate = (np.asarray(record.samples[name]) for name in (OWN, SINGLE, SEPARATE))
    ratio = f"{np.median(single / own):.2f}x rtcIntersect1, {np.median(separate / own):.2f}x separate frames"
    return f"{np.median(own) * 1e3:.1f} ms, {ratio}"


def _problem(point: Point) -> str | None:
    if point.method.name == ALIGNED.name:
        return None
    return (
        f"workload=multiframe with method={point.method.name}, which traces one frame; use method={ALIGNED.name}, "
        "which is measured beside every other way"
    )


def _separate_columns(name: str, over: str, ratios: Callable[[Series], Series]) -> tuple[Column, ...]:
    """Statistics of every way with a tracer a frame. name: with {} where the way's stands."""
    return tuple(
        column
        for way, sample, tracer in (
            ("separate", SEPARATE, "aligned tracer"),
            ("visible_first", SEPARATE_VISIBLE, "visible-first tracer"),
            ("rasteriser", SEPARATE_RASTER, "rasteriser"),
        )
        for column in statistics_columns(name.format(way), f"one {tracer} a frame{over}", ratios(series(sample)))
    )


MULTIFRAME = Workload(
    name="multiframe",
    options=MultiframeOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *IMAGE_COLUMNS,
        Column("plan_time_s", REAL, "plan of all frames together"),
        Column("build_time_s", REAL, "BVH build of all frames together"),
        Column("baseline_build_time_s", REAL, "BVH builds of the plain meshes, frame by frame"),
        *TIME_COLUMNS,
        *_separate_columns("{}_render_time{{}}_s", "", lambda read: read),
        *_separate_columns("speedup_vs_{}{{}}", " / this", over_own),
        Column("separate_embree_bytes", WHOLE, "Embree's memory for one aligned tracer a frame"),
    ),
    headline=_headline,
    package=__name__,
    samples=lambda point: frozenset((OWN, SINGLE, SEPARATE, SEPARATE_VISIBLE, SEPARATE_RASTER)),
    needs=(*RESOURCES, *PIXELS, *PREPARATION),
    problem=_problem,
    **BESIDE_BASELINES,
)


Make = Callable[[Mesh, View], AnyTracer]


@dataclass(frozen=True)
class SeparateImages:
    """Images of all frames, in order."""

    images: tuple[Hits, ...]


class SeparateFrames(Lifetime):
    """One tracer a frame, one after the other; all times and numbers are sums over the frames."""

    def __init__(self, tracers: Sequence[AnyTracer]) -> None:
        super().__init__()
        self.tracers = tuple(tracers)
        first = self.tracers[0]
        self.mesh, self.camera = first.mesh, first.camera
        self.packet_width, self.threads = first.packet_width, first.threads
        self.views = tuple(view for tracer in self.tracers for view in tracer.views)

    @property
    def triangle_count(self) -> int:
        return sum(tracer.triangle_count for tracer in self.tracers)

    @property
    def embree_bytes(self) -> int:
        return sum(tracer.embree_bytes for tracer in self.tracers)

    @property
    def counters(self) -> Mapping[str, float]:
        total: Counter[str] = Counter()
        for tracer in self.tracers:
            total.update(tracer.counters)
        return total

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: SeparateImages | None = None) -> SeparateImages:
        """All frames, in order. out: an earlier result that is no longer needed."""
        earlier = (None,) * len(self.tracers) if out is None else out.images
        pairs = zip(self.tracers, earlier, strict=True)
        return SeparateImages(tuple(tracer.trace(offset, hits) for tracer, hits in pairs))

    def _build(self) -> tuple[float, float]:
        for tracer in self.tracers:
            tracer.build()
        plan_time_s = sum(tracer.plan_time_s for tracer in self.tracers)
        return plan_time_s, sum(tracer.build_time_s for tracer in self.tracers)

    def _release(self) -> None:
        for tracer in self.tracers:
            tracer.close()


def make(point: Point, mesh: Mesh) -> FramesTracer:
    """All frames of the point, traced together."""
    return make_together(point, mesh, point.camera)


def separate_makers(point: Point) -> dict[str, Make]:
    """Makers of tracers of one frame, by name in the samples, with the point's split where there are cells.

    Each frame may use the whole memory budget.
    """
    own = point.options
    names = "split_x", "split_y", "packet_width", "packet_rows", "robust"
    visible = AlignedCellOptions(**{name: getattr(own, name) for name in names})
    return {
        SEPARATE: lambda mesh, view: make_own(point, mesh, view),
        SEPARATE_VISIBLE: lambda mesh, view: VISIBLE_FIRST.make(mesh, view, visible, point.tracing),
        SEPARATE_RASTER: lambda mesh, view: RASTER.make(mesh, view, RASTER.options(), point.tracing),
    }


def _single(point: Point, packet_width: int, mesh: Mesh, view: View) -> AnyTracer:
    return rounds.make_single(point, mesh, view, packet_width)


def measure(point: Point) -> Measured:
    """All frames together, timed in rounds with one tracer a frame of every other way, and compared frame by frame."""
    packets = rounds.expert_packet_widths()
    small = rounds.shrunk(point)
    rounds.warm_up(
        point,
        [
            lambda mesh, view: make_together(small, mesh, view),
            *(partial(_single, small, width) for width in (1, *packets)),
            *separate_makers(small).values(),
        ],
    )
    with ExitStack() as stack:
        own, results = rounds.build_own(point, stack, lambda mesh, camera: make_together(point, mesh, camera))

        def for_each_frame(make: Make) -> SeparateFrames:
            return stack.enter_context(SeparateFrames([make(mesh, view) for mesh, view in own.views]))

        tracers: dict[str, Any] = {OWN: own}
        for name, width in ((SINGLE, 1), *((PACKETS[width], width) for width in packets)):
            tracers[name] = for_each_frame(partial(_single, point, width))
        tracers |= {name: for_each_frame(make) for name, make in separate_makers(point).items()}
        results |= {
            "baseline_build_time_s": float(tracers[SINGLE].build_time_s),
            "separate_embree_bytes": int(tracers[SEPARATE].embree_bytes),
        }
        frames = {name: rounds.Frames(tracer) for name, tracer in tracers.items()}

        def compare_all() -> dict[str, Any]:
            pairs = zip(frames[OWN].latest().images, frames[SINGLE].latest().images, strict=True)
            agreements = [compare(hits, reference) for hits, reference in pairs]
            return counts(agreements) | depth_errors(agreements) | rounds.plan_and_build_again(own)

        return rounds.race(point, frames, compare_all, results)
