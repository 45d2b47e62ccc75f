"""Plan and build again and again, and the BVH of the plain mesh beside it."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict

from atra.tracing.base import EmbreeTracer
from experiments.harness.point import Measured, Point, make_own
from experiments.workloads.build import BASELINE, BVH, PLAN
from experiments.workloads.rounds import build_own, make_single, measured, shrunk, timed_rounds, warm_up


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
        if point.process == 0 and isinstance(own, EmbreeTracer):  # the same in every process, and takes long
            cost = own.bvh_cost()
            results |= {} if cost is None else asdict(cost)
    warmup = len(plans) - timed.rounds
    for samples, chosen in ((timed.warmup, slice(warmup)), (timed.samples, slice(warmup, None))):
        samples |= {PLAN: tuple(plans[chosen]), BVH: tuple(builds[chosen])}
    return measured(results, timed)
