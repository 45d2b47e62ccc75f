"""Workload `memory`: what one method takes alone, with nothing else in the process."""

from __future__ import annotations

from contextlib import ExitStack

from experiments.harness.options import NoOptions
from experiments.harness.point import Measured, Point, Workload, make_own
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_memory
from experiments.workloads.rounds import build_own, measured, shrunk, warm_up

MEMORY = Workload(
    name="memory", options=NoOptions, columns=RESOURCE_COLUMNS, headline=say_memory, package=__name__, needs=RESOURCES
)


def measure(point: Point) -> Measured:
    """What the process and Embree hold once the method is built."""
    small = shrunk(point)
    warm_up(point, [lambda mesh, view: make_own(small, mesh, view)])
    with ExitStack() as stack:
        _, results = build_own(point, stack)
    return measured(results)
