"""Workload `frame`: time of a frame, beside single rays and packets in the same rounds."""

from __future__ import annotations

from functools import partial

from experiments.workloads.baselines import BESIDE_BASELINES, SINGLE, say_gains
from experiments.workloads.images import Images
from experiments.workloads.resources import Preparation, Resources
from experiments.workloads.typed import workload

FRAME = workload(
    "frame", __name__, partial(say_gains, rtcIntersect1=SINGLE), Resources, Images, Preparation, BESIDE_BASELINES,
    rays=lambda row: "primary", told=("render_time_s", "speedup", "speedup_vs_packets", "pixels_wrong"),
)  # fmt: skip
