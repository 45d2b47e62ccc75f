"""Workload `build`: time to plan and to build the BVH, beside the build of the plain mesh."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict
from statistics import median
from typing import Any

from experiments.harness.column import REAL, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Measured, Point, Workload, make_own
from experiments.harness.records import Record
from experiments.results.statistics import Series, statistics_columns
from experiments.workloads.baselines import series
from experiments.workloads.build.bvh_cost import cost_of
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_ms
from experiments.workloads.rounds import build_own, make_single, measured, shrunk, timed_rounds, warm_up

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
    package=__name__,
    samples=lambda point: frozenset((PLAN, BVH, BASELINE)),
    judged=BVH,
    needs=RESOURCES,
)


def measure(point: Point) -> Measured:
    """Samples of plan and build by the method's own clocks: they know which of its two BVHs is built while it plans,
    and stop to compile."""
    small = shrunk(point)
    warm_up(point, [lambda mesh, view: make_own(small, mesh, view), lambda mesh, view: make_single(small, mesh, view)])
    plans: list[float] = []
    builds: list[float] = []
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        baseline = stack.enter_context(make_single(point, own.mesh, own.camera))

        def prepare() -> None:
            own.build()
            plans.append(own.plan_time_s)
            builds.append(own.build_time_s)

        timed = timed_rounds(point, {BVH: prepare, BASELINE: baseline.build})
        if point.process == 0:  # the same in every process, and takes long
            cost = cost_of(own, point.build_quality)
            results |= {} if cost is None else asdict(cost)
    warmup = len(plans) - timed.rounds
    for samples, chosen in ((timed.warmup, slice(warmup)), (timed.samples, slice(warmup, None))):
        samples |= {PLAN: tuple(plans[chosen]), BVH: tuple(builds[chosen])}
    return measured(results, timed)
