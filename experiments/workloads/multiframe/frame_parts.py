"""What the figures of several frames share: the ways to trace them, by their columns, and each way's best split."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.style import BLACK, BLUE, GREEN, ORANGE, TIMES, VERMILLION
from experiments.drawing.values import drawable, numbers
from experiments.workloads.ratios import OVER_PACKETS, choosing


@dataclass(frozen=True, eq=False)
class Way:
    """time: beginning of the columns of its time. over: beginning of the columns that say how many times as fast all
    frames together are in the same rounds, "" for that way itself."""

    label: str
    time: str
    over: str
    style: dict[str, Any]

    def times_s(self, rows: pd.DataFrame, end: str = "") -> NDArray[np.float64]:
        """(N,) float64 seconds of all frames, NaN where missing; end: "_low" and so on."""
        return numbers(rows, f"{self.time}{end}_s")


TOGETHER = Way("all frames together", "render_time", "", {"color": BLUE, "marker": "o"})
SEPARATE_FRAMES = Way(
    "aligned, frame by frame", "separate_render_time", "speedup_vs_separate", {"color": ORANGE, "marker": "s"}
)
VISIBLE_FRAMES = Way(
    "visible-first, frame by frame", "visible_first_render_time", "speedup_vs_visible_first",
    {"color": VERMILLION, "marker": "D"},
)  # fmt: skip
RASTER_FRAMES = Way(
    "rasteriser, frame by frame", "rasteriser_render_time", "speedup_vs_rasteriser", {"color": BLACK, "marker": "*"}
)
PACKETS = Way(
    "fastest packets per pixel, frame by frame",
    "packets_render_time",
    "speedup_vs_packets",
    {"color": GREEN, "marker": "v"},
)
WAYS = (TOGETHER, SEPARATE_FRAMES, VISIBLE_FRAMES, RASTER_FRAMES, PACKETS)
"""In the order of the legends."""


def best_place(rows: pd.DataFrame, way: Way) -> int | None:
    """The place of the row whose split suits `way` best: the largest ratio of packets to it, from the same rounds.

    None where nothing was measured. Packets and the rasteriser have no split: for them it is any row.
    """
    measured = rows["status"].eq("ok").to_numpy(bool) & drawable(way.times_s(rows))
    if not measured.any():
        return None
    ratios = choosing(rows, OVER_PACKETS) if way is TOGETHER else PACKETS.times_s(rows) / way.times_s(rows)
    return int(np.flatnonzero(measured)[np.argmax(ratios[measured])])


def say_speedup(row: pd.Series, way: Way) -> str:
    """How many times as fast as `way` all frames together are at this row's split, with its interval; "" if unknown."""
    value, low, high = (row.get(f"{way.over}{end}") for end in ("", "_low", "_high"))
    if pd.isna(value):
        return ""
    return f"{value:.2f}{TIMES}" + ("" if pd.isna(low) or pd.isna(high) else f" [{low:.2f}, {high:.2f}]")
