"""Workload `build`: time to plan and to build the BVH, beside the build of the plain mesh."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict, replace
from statistics import median
from typing import Any, NotRequired, TypedDict

from experiments.harness.point import Measured, Point, make_own
from experiments.harness.records import Record
from experiments.workloads.build.bvh_cost import cost_of
from experiments.workloads.resources import Resources, say_ms
from experiments.workloads.rounds import build_own, make_single, race, warm_up
from experiments.workloads.typed import Times, series, workload

PLAN, BVH, BASELINE = "plan", "build", "baseline_build"
"""Names in the samples: the point's plan, its BVH build, the BVH build of the plain mesh."""


def _headline(record: Record) -> str:
    return f"plan {say_ms(median(record.samples[PLAN]))}, build {say_ms(median(record.samples[BVH]))}"


class Cost(TypedDict):
    """Surface area cost of the BVH."""

    boxes_entered: NotRequired[float]
    triangles_tested: NotRequired[float]


def _both_over_plain(record: Record) -> Any:
    """Plan and build over the build of the plain mesh, round by round."""
    plan, bvh, plain = (series(name)(record) for name in (PLAN, BVH, BASELINE))
    return None if plan is None or bvh is None or plain is None else (plan + bvh) / plain


BUILD = workload(
    "build", __name__, _headline, Resources,
    Times({"plan_time{}_s": PLAN, "build_time{}_s": BVH, "baseline_build_time{}_s": BASELINE}, judged=BVH),
    Cost, Times({"build_over_plain{}": (BVH, BASELINE), "plan_and_build_over_plain{}": _both_over_plain}),
)  # fmt: skip


def measure(point: Point) -> Measured:
    """Samples of plan and build by the method's own clocks: they know which of its two BVHs is built while it plans,
    and stop to compile."""
    warm_up(point, [make_own, make_single])
    plans: list[float] = []
    builds: list[float] = []
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        baseline = stack.enter_context(make_single(point, own.mesh, own.camera))

        def prepare() -> None:
            own.build()
            plans.append(own.plan_time_s)
            builds.append(own.build_time_s)

        def judge_bvh() -> dict[str, Any]:
            # The same in every process, and takes long.
            cost = cost_of(own, point.build_quality) if point.process == 0 else None
            return {} if cost is None else asdict(cost)

        raced = race(point, {BVH: prepare, BASELINE: baseline.build}, judge_bvh, results)
    warmup = len(plans) - results["rounds"]
    return replace(
        raced,
        warmup_samples=raced.warmup_samples | {PLAN: plans[:warmup], BVH: builds[:warmup]},
        samples=raced.samples | {PLAN: plans[warmup:], BVH: builds[warmup:]},
    )
