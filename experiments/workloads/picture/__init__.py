"""Workload `picture`: shaded pictures of the method's hits and of rtcIntersect1's, and their difference."""

from __future__ import annotations

from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.workloads.columns import IMAGE_COLUMNS, PIXELS, RESOURCE_COLUMNS, RESOURCES, say_memory

PICTURE = Workload(
    name="picture",
    options=NoOptions,
    columns=(*RESOURCE_COLUMNS, *IMAGE_COLUMNS),
    headline=say_memory,
    room=__name__,
    needs=(*RESOURCES, *PIXELS, "pictures"),
)
