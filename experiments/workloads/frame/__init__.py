"""Workload `frame`: time of a frame, beside single rays and packets in the same rounds."""

from __future__ import annotations

import numpy as np

from experiments.harness.column import REAL, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.workloads.baselines import OWN, PACKETS, SINGLE, TIME_COLUMNS, single_over_packets
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES


def _headline(record: Record) -> str:
    own, single = np.asarray(record.samples[OWN]), np.asarray(record.samples[SINGLE])
    return f"{np.median(own) * 1e3:.1f} ms, {np.median(single / own):.2f}x rtcIntersect1"


FRAME = Workload(
    name="frame",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *IMAGE_COLUMNS,
        Column("plan_time_s", REAL, "plan: culling and shear"),
        Column("build_time_s", REAL, "BVH build"),
        Column("baseline_build_time_s", REAL, "BVH build of the plain mesh"),
        *TIME_COLUMNS,
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, SINGLE)),
    optional=frozenset(PACKETS.values()),
    judged=OWN,
    canary=single_over_packets,
    needs=(*RESOURCES, *PIXELS, "plan_time_s", "build_time_s", "baseline_build_time_s"),
)
