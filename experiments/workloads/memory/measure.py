"""Build the one method and nothing else."""

from __future__ import annotations

from contextlib import ExitStack

from experiments.harness.point import Measured, Point, make_own
from experiments.workloads.rounds import build_own, measured, shrunk, warm_up


def measure(point: Point) -> Measured:
    """What the process and Embree hold once the method is built."""
    small = shrunk(point)
    warm_up(point, [lambda mesh, view: make_own(small, mesh, view)])
    with ExitStack() as stack:
        _, results = build_own(point, stack)
    return measured(results)
