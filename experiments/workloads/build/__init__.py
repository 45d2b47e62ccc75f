"""Workload `build`: time to plan and to build the BVH, beside the build of the plain mesh."""

from __future__ import annotations

from statistics import median
from typing import Any

from experiments.harness.column import REAL, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.results.statistics import Series, statistics_columns
from experiments.workloads.baselines import series
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_ms

PLAN, BVH, BASELINE = "plan", "build", "baseline_build"
"""Names in the samples: the point's plan, its BVH build, the BVH build of the plain mesh."""


def _headline(record: Record) -> str:
    return f"plan {say_ms(median(record.samples[PLAN]))}, build {say_ms(median(record.samples[BVH]))}"


def _over(*names: str) -> Series:
    """A record -> the ratios of a sum of series and the build of the plain mesh, round by round."""

    def ratios(record: Record) -> Any:
        parts = [series(name)(record) for name in (*names, BASELINE)]
        return None if any(part is None for part in parts) else sum(parts[:-1]) / parts[-1]

    return ratios


BUILD = Workload(
    name="build",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *statistics_columns("plan_time{}_s", "plan: culling and shear", series(PLAN)),
        *statistics_columns("build_time{}_s", "BVH build", series(BVH)),
        *statistics_columns("baseline_build_time{}_s", "BVH build of the plain mesh", series(BASELINE)),
        Column("boxes_entered", REAL, "boxes of the BVH that a random ray enters"),
        Column("triangles_tested", REAL, "triangles that a random ray is tested with"),
        *statistics_columns("build_over_plain{}", "BVH build / that of the plain mesh, in the same rounds", _over(BVH)),
        *statistics_columns(
            "plan_and_build_over_plain{}", "plan and build / BVH build of the plain mesh", _over(PLAN, BVH)
        ),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((PLAN, BVH, BASELINE)),
    judged=BVH,
    needs=RESOURCES,
)
