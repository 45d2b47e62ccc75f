"""Workload `memory`: what one method takes alone, with nothing else in the process."""

from __future__ import annotations

from contextlib import ExitStack

from experiments.harness.point import Measured, Point, make_own
from experiments.workloads.resources import Resources, say_memory
from experiments.workloads.rounds import build_own, warm_up
from experiments.workloads.typed import workload

MEMORY = workload("memory", __name__, say_memory, Resources)


def measure(point: Point) -> Measured:
    """What the process and Embree hold once the method is built."""
    warm_up(point, [make_own])
    with ExitStack() as stack:
        _, results = build_own(point, stack)
    return Measured(results)
