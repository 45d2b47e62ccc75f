"""What a method costs over many frames of one view: plan and build once, a first frame, then frame after frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import floor

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.values import column
from experiments.methods.pixel import PIXEL, SAME
from experiments.workloads.frame import FRAME
from experiments.workloads.ratios import best_rows


@dataclass(frozen=True)
class Cost:
    """Seconds a method takes on one scene, and the bytes of its Embree scenes.

    first_frame_time_s: the very first frame after the build; it finds caches cold.
    frame_time_s: every further frame. embree_bytes: Embree's own account, None where it was not taken.
    packets_frame_time_s: a frame of packets per pixel in the same rounds, None where it was not taken.
    """

    method: str
    plan_time_s: float
    build_time_s: float
    first_frame_time_s: float
    frame_time_s: float
    embree_bytes: int | None = None
    packets_frame_time_s: float | None = None

    @property
    def once_s(self) -> float:
        """What is paid before the first frame: plan and build."""
        return self.plan_time_s + self.build_time_s


def time_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of timed frames, measured or not; a row that does not say what it measured counts as one."""
    if "workload" not in table:
        return table
    return table[table["workload"].fillna(FRAME.name).eq(FRAME.name).astype(bool)]


def cost_of(row: pd.Series) -> Cost | None:
    """The cost of one row of the table, or None where one of its times was not measured.

    One ray per pixel has no plan: a missing plan time of method=pixel is 0.
    """
    names = ("plan_time_s", "build_time_s", "first_frame_time_s", "render_time_s")
    times = {name: row.get(name) for name in names}
    if row["method"] == PIXEL.name and pd.isna(times["plan_time_s"]):
        times["plan_time_s"] = 0.0
    if any(pd.isna(value) for value in times.values()):
        return None
    stored = row.get("embree_bytes")
    plan_s, build_s, first_s, frame_s = (float(times[name]) for name in names)
    embree_bytes = None if pd.isna(stored) else int(stored)
    packets = row.get("packets_render_time_s")
    packets_s = None if pd.isna(packets) else float(packets)
    return Cost(str(row["method"]), plan_s, build_s, first_s, frame_s, embree_bytes, packets_s)


def baseline_costs(rows: pd.DataFrame) -> dict[str, Cost]:
    """What packets per pixel cost on one scene: of each quality of their build the fastest, the usual quality ("same")
    first. Whoever traces few frames builds cheaply, and whoever traces many does not."""
    chosen = rows["method"].eq(PIXEL.name) & rows["packet_width"].gt(1)
    packets = rows[chosen.fillna(False).astype(bool)]
    qualities = column(packets, "own_build_quality").fillna(SAME).astype(str)
    found: dict[str, Cost] = {}
    for quality in sorted(qualities.unique(), key=lambda one: (one != SAME, one)):
        costs = [cost_of(row) for _, row in best_rows(packets[(qualities == quality).to_numpy(bool)]).iterrows()]
        known = [cost for cost in costs if cost is not None]
        if known:
            found[quality] = min(known, key=lambda one: one.frame_time_s)
    return found


def cumulative_time_s(cost: Cost, frames: NDArray[np.integer]) -> NDArray[np.float64]:
    """Seconds from the start of the plan to the end of the n-th frame.

    frames: (N,) whole numbers from 1. Returns (N,) float64.
    """
    return cost.once_s + cost.first_frame_time_s + (np.asarray(frames, np.float64) - 1) * cost.frame_time_s


def break_even_frames(cost: Cost, baselines: Iterable[Cost]) -> int | None:
    """The smallest number of frames from which on `cost` has taken less time in all than each of the baselines, of
    which there is at least one.

    1 = ahead from the first frame on; None = never, which includes a lead that further frames use up.
    """
    frames = [_ahead_of(cost, baseline) for baseline in baselines]
    return None if None in frames else max(one for one in frames if one is not None)


def _ahead_of(cost: Cost, baseline: Cost) -> int | None:
    """As `break_even_frames`, of one baseline."""
    # The two were measured in processes of their own, perhaps an hour apart; each was timed in rounds with the same
    # packets, which carry the baseline's frame over.
    baseline_frame_s = baseline.frame_time_s
    if cost.packets_frame_time_s and baseline.packets_frame_time_s:
        baseline_frame_s *= cost.packets_frame_time_s / baseline.packets_frame_time_s
    # After n frames it is behind by `behind_s` - (n - 1) * `gain_s`.
    behind_s = cost.once_s + cost.first_frame_time_s - baseline.once_s - baseline.first_frame_time_s
    gain_s = baseline_frame_s - cost.frame_time_s
    if gain_s < 0 or (gain_s == 0 and behind_s >= 0):
        return None
    if behind_s < 0:
        return 1
    return floor(behind_s / gain_s) + 2
