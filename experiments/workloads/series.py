"""Series of methods in figures: ratios of times over baselines, best points, and styles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Level, median_level
from experiments.drawing.style import BLACK, TIMES
from experiments.drawing.values import MILLISECONDS, column, numbers, say_things
from experiments.methods import METHODS, find_method
from experiments.methods.naming import say_series, say_split
from experiments.methods.pixel import PIXEL
from experiments.results.statistics import REST
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.images import say_holes

OVER_SINGLE, OVER_PACKETS = "speedup", "speedup_vs_packets"
"""Beginnings of columns: over rtcIntersect1 per pixel, over the fastest ray packets."""

_BASELINES = dict(zip((OVER_SINGLE, OVER_PACKETS), TIME_BASELINES, strict=True))

POINTS = ("scene", "mesh_sha256", "width", "height", "method", "packet_width", "threads", "build_quality")
"""Columns whose values tell groups of rows apart; each group has a best row."""


def own_ratio(rows: pd.DataFrame) -> str:
    """The ratio of rows of one kind of rays: single rays are held against single rays, all else against packets."""
    widths = column(rows, "packet_width").dropna()
    return OVER_SINGLE if len(widths) and widths.eq(1).all() else OVER_PACKETS


def say_baseline(ratio: str) -> str:
    """What a ratio is over, in words."""
    return _BASELINES[ratio]


def choosing(rows: pd.DataFrame, ratio: str) -> NDArray[np.float64]:
    """(N,) float64, the ratio that the best row is chosen by: over the half of the processes that choose in the claims
    (`experiments.results.statistics.best_of`), in older tables over all."""
    half, whole = numbers(rows, f"{ratio}_half"), numbers(rows, ratio)
    return np.where(np.isfinite(half), half, whole)


def best_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """The best split of every scene, method, packet width and thread count (and image size and build quality).

    Best is the largest ratio over its own kind of rays, which drift of the machine does not change. Points without a
    ratio are left out. Rows keep their order; the first of equals is taken. Of several, the ratios are those of the
    processes that did not choose (`experiments.results.statistics.REST`).
    """
    single = column(rows, "packet_width").eq(1).fillna(False).to_numpy(bool)
    ratios = np.where(single, choosing(rows, OVER_SINGLE), choosing(rows, OVER_PACKETS))
    known = rows["status"].eq("ok").fillna(False).to_numpy(bool) & np.isfinite(ratios)
    ordered = [place for place in np.argsort(-ratios, kind="stable") if known[place]]
    keys = [name for name in POINTS if name in rows]
    first = ~rows.iloc[ordered].duplicated(keys).to_numpy(bool)
    chosen = rows.iloc[np.sort(np.array(ordered, np.intp)[first])]
    return chosen if len(chosen) == len(rows) else _as_reported(chosen)


def _as_reported(rows: pd.DataFrame) -> pd.DataFrame:
    for ratio in (OVER_SINGLE, OVER_PACKETS):
        if f"{ratio}{REST}" in rows:
            known = rows[f"{ratio}{REST}"].notna()
            ends = [end for end in ("", "_low", "_high") if f"{ratio}{end}" in rows]
            rows = rows.assign(**{
                f"{ratio}{end}": rows[f"{ratio}{end}"].mask(known, rows[f"{ratio}{REST}{end}"]) for end in ends
            })  # fmt: skip
    return rows


def of_files(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of methods of files, packages and programs: neither ours nor those of other people's libraries."""
    names = [method.name for method in METHODS if not method.is_ours and not method.is_peer]
    return rows[rows["method"].isin(names).to_numpy(bool)]


_BESIDE = ("workload", "scene", "mesh_sha256", "view", "width", "height", "threads", "build_quality", "ties")


def beside(rows: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """The rows of methods of files in the table that measured what some rows measured: the same views and settings."""
    others = of_files(table)
    for name in _BESIDE:
        if name in others and name in rows:
            others = others[others[name].isin(rows[name]).to_numpy(bool)]
    return others


def baseline_levels(rows: pd.DataFrame, ratio: str | None) -> list[Level]:
    """A level at each baseline's ratio, one of which is 1. ratio: beginning of its column, None = milliseconds."""
    over_s = None if ratio is None else numbers(rows, TIME_BASELINES[_BASELINES[ratio]][0])
    levels = []
    for label, (name, style) in TIME_BASELINES.items():
        time_s = numbers(rows, name)
        levels += median_level(label, time_s * MILLISECONDS if over_s is None else over_s / time_s, style)
    return levels


@dataclass(frozen=True, eq=False)
class BestPoint:
    """A series at its best split. name: in words. points: its rows. best: the best of them, or none."""

    method: str
    packet_width: int | None
    name: str
    points: pd.DataFrame
    best: pd.DataFrame

    @property
    def label(self) -> str:
        """The name, and the split of the best row."""
        return ", ".join(filter(None, [self.name, say_split(self.best.iloc[0])]))

    @property
    def is_single(self) -> bool:
        """It shoots single rays, by choice."""
        return self.packet_width == 1 and find_method(self.method).has_packets

    @property
    def color(self) -> str:
        is_baseline = self.method == PIXEL.name and self.packet_width == 1
        return BLACK if is_baseline else find_method(self.method).style.color


def best_points(rows: pd.DataFrame) -> Iterator[BestPoint]:
    """One for each series, in the order of `METHODS`: a method and, where that is ours to choose, a width of packets.

    A point without a packet width was not measured; it belongs to the method's first series.
    """
    for method in METHODS:
        of_method = rows[rows["method"].eq(method.name).fillna(False).astype(bool)]
        known = column(of_method, "packet_width").dropna().unique()
        widths: list[int | None] = [*sorted((int(width) for width in known), reverse=True)] or [None]
        for width in widths if method.has_packets else widths[:1]:
            points = of_method
            if method.has_packets and len(widths) > 1:
                points = of_method[of_method["packet_width"].eq(width).fillna(width == widths[0]).astype(bool)]
            if len(points):
                yield BestPoint(method.name, width, say_series(method.name, width), points, best_rows(points))


def say_ratio(row: pd.Series) -> str:
    """The speed-up over packets with its interval, "" where it is missing."""
    value, low, high = (row.get(f"{OVER_PACKETS}{end}") for end in ("", "_low", "_high"))
    # A peer may be a hundred times slower.
    digits = 2 if pd.isna(value) or value >= 0.095 else 3
    text = "" if pd.isna(value) else f"{value:.{digits}f}{TIMES}"
    if text and not (pd.isna(low) or pd.isna(high)):
        text += f" [{low:.{digits}f}, {high:.{digits}f}]"
    return text


def say_wrong(rows: pd.DataFrame, name: str) -> list[str]:
    """A line for each measured row with pixels that are wrong; the page lists wrong images by themselves."""
    rows = rows[rows["status"].eq("ok").fillna(False).astype(bool)]
    wrong = rows[column(rows, "pixels_wrong").gt(0).fillna(False).astype(bool)]
    return [
        f"{', '.join(filter(None, [name, say_split(row)]))}: "
        f"{say_things(row['pixels_wrong'], 'pixel')} wrong{say_holes(row)}"
        for _, row in wrong.iterrows()
    ]
