"""Workload `views`: a mesh seen by many cameras, or a batch of rays, from the first call to the last result; by the
point's method and, in the same rounds, by the library with default options."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from statistics import median

from atra.errors import InputError
from atra.tracing.options import option
from experiments.harness.column import REAL, Column
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.methods import METHODS
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, over, series

LIBRARY = "library"
"""Name in the samples of `atra.render_views` or `atra.RayScene.intersect`."""


class Job(Enum):
    """views: all images of cameras around the point's, with all that is built for them. camera_rays, random_rays: one
    call with as many rays as the image has pixels, of the camera or random in the mesh; building is not counted."""

    views = "views"
    camera_rays = "camera_rays"
    random_rays = "random_rays"


@dataclass(frozen=True)
class ViewsOptions:
    """Raises InputError for no views."""

    job: Job = option(Job.views, "what is asked for: views, camera_rays or random_rays")
    views: int = option(20, "cameras, where views are asked for")

    def __post_init__(self) -> None:
        if self.views < 1:
            raise InputError(f"workload.views is {self.views}, expected a whole number of at least 1")


_own, _library = series(OWN), series(LIBRARY)
_gain = over(_own, _library)


def _headline(record: Record) -> str:
    own, library = (median(record.samples[name]) for name in (OWN, LIBRARY))
    return f"{own:.3f} s; the library {library:.3f} s, {median(_gain(record)):.2f}x as fast"


def _problem(point: Point) -> str | None:
    job = point.workload_options.job
    if job is Job.views or not point.method.is_ours:
        return None
    others = ", ".join(method.name for method in METHODS if not method.is_ours)
    return (
        f"method={point.method.name} with workload.job={job.value}, expected a tracer of others beside ours: {others}"
    )


VIEWS = Workload(
    name="views",
    options=ViewsOptions,
    columns=(
        *statistics_columns("job_time{}_s", "all views, or all rays, by the method", _own),
        *statistics_columns("library_time{}_s", "the same by the library, called without options", _library),
        *statistics_columns("library_gain{}", "the method's time / the library's, in the same rounds", _gain),
        Column("ids_equal", REAL, "least share of pixels, or rays, with the same triangle", over=min),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, LIBRARY)),
    judged=OWN,
    needs=("ids_equal",),
    problem=_problem,
)  # fmt: skip
