"""Workload `moving`: frames of a camera that moves, each seen from another eye; whatever a method has to do for that is
part of its frame, and so it is of single rays and packets beside it."""

from __future__ import annotations

from statistics import median
from typing import Any

from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.results.statistics import Series, statistics_columns
from experiments.workloads.baselines import OWN, PACKETS, SINGLE, TIME_COLUMNS, over_own, series, single_over_packets
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_ms

STILL, KEPT = "own_still", "packets_kept"
"""Names in the samples: the point's own method once more from the same eye; the widest packets over a BVH of the world,
built once, for whoever can do with images that are not quite as exact."""


def _headline(record: Record) -> str:
    own, still = (median(record.samples[name]) for name in (OWN, STILL))
    return f"{say_ms(own)} from another eye, {say_ms(still)} from the same"


def _over_still(record: Record) -> Any:
    own, still = series(OWN)(record), series(STILL)(record)
    return None if own is None or still is None else own / still


_kept: Series = series(KEPT)

MOVING = Workload(
    name="moving",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *IMAGE_COLUMNS,
        Column("plan_time_s", REAL, "plan: culling and shear"),
        Column("build_time_s", REAL, "BVH build"),
        *TIME_COLUMNS,
        *statistics_columns("still_time{}_s", "one frame from the same eye as the one before", series(STILL)),
        *statistics_columns("moving_over_still{}", "a frame from another eye / one from the same", _over_still),
        *statistics_columns("kept_packets_time{}_s", "the widest packets over a BVH of the world, kept", _kept),
        *statistics_columns("speedup_vs_kept_packets{}", "packets over a BVH of the world / this", over_own(_kept)),
        Column("kept_pixels_wrong", WHOLE, "pixels of packets over a BVH of the world without an excuse", over=max),
        Column("kept_depth_error_p999", REAL, "what 99.9 % of their depths' relative errors stay below"),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, STILL, SINGLE, KEPT)),
    optional=frozenset(PACKETS.values()),
    judged=OWN,
    canary=single_over_packets,
    needs=(*RESOURCES, *PIXELS, "plan_time_s", "build_time_s"),
)
