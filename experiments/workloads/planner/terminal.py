"""Regrets of plans over all points, as a line for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Two lines. rows: those of this workload that were measured."""
    regret, frame_regret, ratio = (rows[name].astype(float) for name in ("regret", "frame_regret", "vs_packets"))
    yield (
        f"plans: regret {regret.median():.2f}, at worst {regret.max():.2f}; of the frame alone "
        f"{frame_regret.median():.2f}, {frame_regret.max():.2f}; over packets at worst {ratio.max():.2f}; "
        f"{len(rows)} views"
    )
    with_planning, pays = rows["regret_with_planning"].astype(float), rows["pays_from_frames"].dropna().astype(float)
    if with_planning.notna().any():
        ahead = f"in {len(pays)} of {len(rows)} views"
        when = f", mostly from {pays.median():,.0f} frames on, at worst from {pays.max():,.0f}" if len(pays) else ""
        yield (
            f"planning counted, too: regret {with_planning.median():.2f}, at worst {with_planning.max():.2f}; it pays "
            f"{ahead}{when}"
        )
