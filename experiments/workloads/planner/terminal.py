"""Regrets of plans over all points, as lines for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.workloads.planner import EFFORTS


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """A line for each effort. rows: those of this workload that were measured."""
    for effort in EFFORTS:
        regret, frame_regret, ratio = (
            rows[f"{effort}_{name}"].astype(float) for name in ("regret", "frame_regret", "vs_packets")
        )
        yield (
            f"{effort}: regret {regret.median():.2f}, at worst {regret.max():.2f}; of the frame alone "
            f"{frame_regret.median():.2f}, {frame_regret.max():.2f}; over packets at worst {ratio.max():.2f}; "
            f"{len(rows)} views"
        )
