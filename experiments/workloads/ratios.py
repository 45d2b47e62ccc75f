"""Ratios of frame times: their baselines, and the best splits by them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from experiments.drawing.axes import draw_baseline
from experiments.drawing.values import column, numbers
from experiments.workloads.baselines import TIME_BASELINES

OVER_SINGLE, OVER_PACKETS = "speedup", "speedup_vs_packets"
"""Beginnings of columns: over rtcIntersect1 per pixel, over the fastest packets per pixel."""

_BASELINES = dict(zip((OVER_SINGLE, OVER_PACKETS), TIME_BASELINES, strict=True))

_POINTS = ("scene", "mesh_sha256", "width", "height", "method", "packet_width", "threads", "build_quality")
"""Of each value of these there is a best row."""


def own_ratio(rows: pd.DataFrame) -> str:
    """The ratio of rows of one kind of rays: single rays are held against single rays, all else against packets."""
    widths = column(rows, "packet_width").dropna()
    return OVER_SINGLE if len(widths) and widths.eq(1).all() else OVER_PACKETS


def say_baseline(ratio: str) -> str:
    """What a ratio is over, in words."""
    return _BASELINES[ratio]


def choosing(rows: pd.DataFrame, ratio: str) -> NDArray[np.float64]:
    """(N,) float64, the ratio that the best row is chosen by: over the half of the processes that choose in the claims
    (`experiments.results.estimates.best_of`), in older tables over all."""
    half, whole = numbers(rows, f"{ratio}_half"), numbers(rows, ratio)
    return np.where(np.isfinite(half), half, whole)


def best_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """The best split of every scene, method, packet width and thread count (and image size and build quality).

    Best is the largest ratio over its own kind of rays, which drift of the machine does not change. Points without a
    ratio are left out. Rows keep their order; the first of equals is taken.
    """
    single = column(rows, "packet_width").eq(1).fillna(False).to_numpy(bool)
    ratios = np.where(single, choosing(rows, OVER_SINGLE), choosing(rows, OVER_PACKETS))
    known = rows["status"].eq("ok").fillna(False).to_numpy(bool) & np.isfinite(ratios)
    ordered = [place for place in np.argsort(-ratios, kind="stable") if known[place]]
    keys = [name for name in _POINTS if name in rows]
    first = ~rows.iloc[ordered].duplicated(keys).to_numpy(bool)
    return rows.iloc[np.sort(np.array(ordered, np.intp)[first])]


def draw_ratio_baselines(axis: Axes, rows: pd.DataFrame, ratio: str, upright: bool = False) -> float:
    """Draw a line at each baseline's ratio; one of the two is 1. Returns the end of the farther line's band."""
    own_s = numbers(rows, TIME_BASELINES[_BASELINES[ratio]][0])
    return max(
        draw_baseline(axis, own_s / numbers(rows, name), style, label, upright)
        for label, (name, style) in TIME_BASELINES.items()
    )
