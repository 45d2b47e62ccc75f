"""Workload `multiframe`: several frames from one set of rays, beside frame by frame."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from atra.errors import InputError
from atra.tracing.options import option
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.methods.aligned import ALIGNED
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, PACKETS, SINGLE, TIME_COLUMNS, over_own, series, single_over_packets
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES

SEPARATE, SEPARATE_VISIBLE, SEPARATE_RASTER = "separate", "visible_first", "rasteriser"
"""Names in the samples: one aligned tracer a frame, one visible-first tracer a frame, and one rasteriser a frame."""


class Motion(Enum):
    """How the frames of a point differ: eyes = two eyes side by side; walk = the camera moves, turns and zooms a
    little every frame; turn = the camera stands still and the mesh turns (`motion.frames_of`)."""

    eyes = "eyes"
    walk = "walk"
    turn = "turn"


@dataclass(frozen=True)
class MultiframeOptions:
    """frames: traced together in one pass. motion: what makes them of one view. Raises InputError for fewer than two
    frames, and for two eyes of any other number."""

    frames: int = option(2, "images traced together; times, bytes and pixels are of all of them")
    motion: Motion = option(Motion.eyes, "how they differ: eyes, walk (the camera moves) or turn (the mesh turns)")

    def __post_init__(self) -> None:
        if self.frames < 2:
            raise InputError(f"workload.frames is {self.frames}, expected at least 2")
        if self.motion is Motion.eyes and self.frames != 2:
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
        *statistics_columns("separate_render_time{}_s", "one aligned tracer a frame", series(SEPARATE)),
        *statistics_columns(
            "visible_first_render_time{}_s", "one visible-first tracer a frame", series(SEPARATE_VISIBLE)
        ),
        *statistics_columns("rasteriser_render_time{}_s", "one rasteriser a frame", series(SEPARATE_RASTER)),
        *statistics_columns("speedup_vs_separate{}", "one aligned tracer a frame / this", over_own(series(SEPARATE))),
        *statistics_columns(
            "speedup_vs_visible_first{}", "one visible-first tracer a frame / this", over_own(series(SEPARATE_VISIBLE))
        ),
        *statistics_columns(
            "speedup_vs_rasteriser{}", "one rasteriser a frame / this", over_own(series(SEPARATE_RASTER))
        ),
        Column("separate_embree_bytes", WHOLE, "what Embree holds for one aligned tracer a frame"),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, SINGLE, SEPARATE, SEPARATE_VISIBLE, SEPARATE_RASTER)),
    optional=frozenset(PACKETS.values()),
    judged=OWN,
    canary=single_over_packets,
    needs=(*RESOURCES, *PIXELS, "plan_time_s", "build_time_s", "baseline_build_time_s"),
    problem=_problem,
)
