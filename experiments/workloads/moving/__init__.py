"""Workload `moving`: frames of a moving camera, which include whatever a method or a baseline does for a new eye."""

from __future__ import annotations

from statistics import median

from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, TIME_COLUMNS, over, over_own, series
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS
from experiments.workloads.resources import PREPARATION, PREPARATION_COLUMNS, RESOURCE_COLUMNS, RESOURCES, say_ms

STILL, KEPT = "own_still", "packets_kept"
"""Names in the samples: the point's own method again from the same eye; the widest packets over a BVH of the world that
is built once, with less exact images."""


def _headline(record: Record) -> str:
    own, still = (median(record.samples[name]) for name in (OWN, STILL))
    return f"{say_ms(own)} from another eye, {say_ms(still)} from the same"


_own, _still, _kept = series(OWN), series(STILL), series(KEPT)

MOVING = Workload(
    name="moving",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *IMAGE_COLUMNS,
        *PREPARATION_COLUMNS[:2],
        *TIME_COLUMNS,
        *statistics_columns("still_time{}_s", "one frame from the same eye as the one before", _still),
        *statistics_columns("moving_over_still{}", "a frame from another eye / one from the same", over(_own, _still)),
        *statistics_columns("kept_packets_time{}_s", "the widest packets over a BVH of the world, kept", _kept),
        *statistics_columns("speedup_vs_kept_packets{}", "packets over a BVH of the world / this", over_own(_kept)),
        Column("kept_pixels_wrong", WHOLE, "pixels of packets over a BVH of the world without an excuse", over=max),
        Column("kept_depth_error_p999", REAL, "what 99.9 % of their depths' relative errors stay below"),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, STILL, SINGLE, KEPT)),
    needs=(*RESOURCES, *PIXELS, *PREPARATION[:2]),
    **BESIDE_BASELINES,
)
