"""Workload `build`: time to plan and to build the BVH, beside the build of the plain mesh."""

from __future__ import annotations

from statistics import median

from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import series
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_ms
from experiments.workloads.workload import NoOptions, Workload

PLAN, BVH, BASELINE = "plan", "build", "baseline_build"
"""Names in the samples: the point's plan, its BVH build, the BVH build of the plain mesh."""


def _headline(record: Record) -> str:
    return f"plan {say_ms(median(record.samples[PLAN]))}, build {say_ms(median(record.samples[BVH]))}"


BUILD = Workload(
    name="build",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *statistics_columns("plan_time{}_s", "plan: culling and shear", series(PLAN)),
        *statistics_columns("build_time{}_s", "BVH build", series(BVH)),
        *statistics_columns("baseline_build_time{}_s", "BVH build of the plain mesh", series(BASELINE)),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((PLAN, BVH, BASELINE)),
    judged=BVH,
    needs=RESOURCES,
)
