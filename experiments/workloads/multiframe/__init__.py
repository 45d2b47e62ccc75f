"""Workload `multiframe`: several frames from one set of rays, beside frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from atra.errors import InputError
from atra.tracing.options import option
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.methods.aligned import ALIGNED
from experiments.results.statistics import Series, statistics_columns
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, TIME_COLUMNS, over_own, series
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS
from experiments.workloads.resources import PREPARATION, RESOURCE_COLUMNS, RESOURCES

SEPARATE, SEPARATE_VISIBLE, SEPARATE_RASTER = "separate", "visible_first", "rasteriser"
"""Names in the samples: one aligned tracer a frame, one visible-first tracer a frame, and one rasteriser a frame."""


class Motion(Enum):
    """How the frames of a point differ (`motion.frames_of`)."""

    eyes = "eyes"
    walk = "walk"
    turn = "turn"


@dataclass(frozen=True)
class MultiframeOptions:
    """Raises InputError for fewer than two frames, and for two eyes of any other number."""

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
        Column("separate_embree_bytes", WHOLE, "what Embree holds for one aligned tracer a frame"),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, SINGLE, SEPARATE, SEPARATE_VISIBLE, SEPARATE_RASTER)),
    needs=(*RESOURCES, *PIXELS, *PREPARATION),
    problem=_problem,
    **BESIDE_BASELINES,
)
