"""Workload `frame`: time of a frame, beside single rays and packets in the same rounds."""

from __future__ import annotations

import numpy as np

from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, TIME_COLUMNS
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS
from experiments.workloads.resources import PREPARATION, PREPARATION_COLUMNS, RESOURCE_COLUMNS, RESOURCES


def _headline(record: Record) -> str:
    own, single = np.asarray(record.samples[OWN]), np.asarray(record.samples[SINGLE])
    return f"{np.median(own) * 1e3:.1f} ms, {np.median(single / own):.2f}x rtcIntersect1"


FRAME = Workload(
    name="frame",
    options=NoOptions,
    columns=(*RESOURCE_COLUMNS, *IMAGE_COLUMNS, *PREPARATION_COLUMNS, *TIME_COLUMNS),
    headline=_headline,
    package=__name__,
    samples=lambda point: frozenset((OWN, SINGLE)),
    needs=(*RESOURCES, *PIXELS, *PREPARATION),
    rays=lambda row: "primary",
    want="nearest",
    **BESIDE_BASELINES,
)
