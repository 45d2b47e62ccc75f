"""What the terminal says of frame times."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.drawing.values import column
from experiments.methods.naming import say_point
from experiments.results.settings import settings
from experiments.workloads.frame.best_baseline import baseline_lines
from experiments.workloads.frame.growth import growth_lines
from experiments.workloads.tables import best_split_table


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """The best splits, how times grow, where triangles or pixels do, and the price of Embree's robust setting, where
    both were measured. rows: those of this workload that were measured."""
    yield best_split_table(rows, "pixels_wrong")
    yield from growth_lines(rows)
    yield from price_lines(rows)


def process_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Which packets per pixel are the fastest, where several were tried. rows: of every process that measured."""
    yield from baseline_lines(rows)


_POINT = ("scene", "method", "packet_width", "split_x", "split_y")


def price_lines(rows: pd.DataFrame) -> Iterator[str]:
    """One line for each point that was measured in both settings: how many times as long a frame takes when no ray
    slips through between triangles.

    Each time is taken as a multiple of the fastest packets of its own rounds, in the fast setting, so that what slows
    down both settings cancels. rows: measured, of one workload; those without the column have the fast setting.
    """
    robust = column(rows, "robust").fillna(False).astype(bool)
    if not robust.any():
        return
    names = [name for name in dict.fromkeys([*_POINT, *settings()]) if name in rows and name != "robust"]
    key = rows[names].astype(object).where(rows[names].notna(), "none").apply(tuple, axis=1)
    fast = rows[~robust].groupby(key[~robust], sort=False)["speedup_vs_packets"].median()
    for place in rows.index[robust]:
        before, row = fast.get(key[place]), rows.loc[place]
        if before is not None and pd.notna(before) and pd.notna(row["speedup_vs_packets"]):
            price = float(before) / float(row["speedup_vs_packets"])
            yield f"{row['scene']}: {say_point(row)}: {price:.2f} times as long as in Embree's fast setting"
