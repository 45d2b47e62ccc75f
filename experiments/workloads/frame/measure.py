"""What measures a frame, beside single rays and packets in the same rounds."""

from __future__ import annotations

from typing import Any

from atra.geometry.mesh import Mesh
from atra.judge.compare import compare
from atra.tracing.budgets import EMBREE_BYTES_PER_COPY, check_needed_bytes
from atra.tracing.tracer import Tracer
from experiments.harness.point import Measured, Point, make_own
from experiments.workloads import rounds
from experiments.workloads.baselines import OWN, SINGLE
from experiments.workloads.images import Images, summed

_BYTES_PER_PIXEL = 8

_ASIDE = (0.25, 0.75)
"""Second place in the pixels whose image is compared: a method that returns its first image again is found by it."""


def make(point: Point, mesh: Mesh) -> Tracer:
    """The point's own method. Raises MemoryBudgetError where its baselines alone need more, and as the tracers do."""
    baselines = len(rounds.baseline_makers())
    pixels = point.width * point.height
    needed = mesh.triangle_count * EMBREE_BYTES_PER_COPY[point.build_quality] + pixels * _BYTES_PER_PIXEL
    what = f"{baselines} baselines of {mesh.triangle_count:,} triangles and {pixels:,} pixels each"
    cure = "use fewer triangles or pixels, or more memory"
    check_needed_bytes(baselines * needed, point.tracing.memory_budget_bytes, what, cure)
    return make_own(point, mesh)


def measure(point: Point) -> Measured:
    """Time frames. Of two images, at the centres of the pixels and beside them, the one with more wrong pixels is
    reported."""
    return rounds.race_baselines(point, _judge)


def _judge(tracers: dict[str, Any], frames: dict[str, rounds.Frames]) -> Images:
    centred = compare(frames[OWN].latest(), frames[SINGLE].latest())
    aside = compare(tracers[OWN].trace(_ASIDE), tracers[SINGLE].trace(_ASIDE))
    return summed([max(centred, aside, key=lambda image: image.pixels_wrong)])
