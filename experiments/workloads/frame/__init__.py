"""Workload `frame`: time of a frame, beside single rays and packets in the same rounds."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np

from atra.geometry.mesh import Mesh
from atra.tracing.budgets import EMBREE_BYTES_PER_COPY, check_needed_bytes
from experiments.harness.method import AnyTracer
from experiments.harness.options import NoOptions
from experiments.harness.point import Measured, Point, Workload, make_own
from experiments.harness.records import Record
from experiments.workloads import rounds
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, TIME_COLUMNS
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS, compared
from experiments.workloads.resources import PREPARATION, PREPARATION_COLUMNS, RESOURCE_COLUMNS, RESOURCES


def _headline(record: Record) -> str:
    own, single = np.asarray(record.samples[OWN]), np.asarray(record.samples[SINGLE])
    return f"{np.median(own) * 1e3:.1f} ms, {np.median(single / own):.2f}x rtcIntersect1"


FRAME = Workload(
    name="frame",
    options=NoOptions,
    columns=(*RESOURCE_COLUMNS, *IMAGE_COLUMNS, *PREPARATION_COLUMNS, *TIME_COLUMNS),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, SINGLE)),
    needs=(*RESOURCES, *PIXELS, *PREPARATION),
    rays=lambda row: "primary",
    want="nearest",
    **BESIDE_BASELINES,
)


_BYTES_PER_PIXEL = 8


def make(point: Point, mesh: Mesh) -> AnyTracer:
    """The point's own method. Raises MemoryBudgetError where its baselines alone need more, and as the tracers do."""
    baselines = 1 + len(rounds.expert_packet_widths())
    pixels = point.width * point.height
    needed = mesh.triangle_count * EMBREE_BYTES_PER_COPY[point.build_quality] + pixels * _BYTES_PER_PIXEL
    what = f"{baselines} baselines of {mesh.triangle_count:,} triangles and {pixels:,} pixels each"
    cure = "use fewer triangles or pixels, or more memory"
    check_needed_bytes(baselines * needed, point.tracing.memory_budget_bytes, what, cure)
    return make_own(point, mesh)


def measure(point: Point) -> Measured:
    """Build the point's own method, read the memory, time it against the baselines round by round, and plan and build
    it again for more samples of these. Raises InputError and MemoryBudgetError as the tracers do."""
    rounds.warm_up(point, rounds.own_and_baselines(rounds.shrunk(point)))
    with ExitStack() as stack:
        tracers, results = rounds.build_with_baselines(point, stack)
        own, frames = tracers[OWN], {name: rounds.Frames(tracer) for name, tracer in tracers.items()}

        def compare() -> dict[str, Any]:
            images = compared(frames[OWN].latest(), frames[SINGLE].latest())
            return images | rounds.plan_and_build_again(own)

        return rounds.race(point, frames, compare, results)
