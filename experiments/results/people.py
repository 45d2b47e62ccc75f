"""Which columns of a table people read: `table.csv` has these, in this order; `table.parquet` has all."""

from __future__ import annotations

import re

import pandas as pd

from experiments.results.settings import settings, settings_that_vary

MOST_COLUMNS = 30

_POINT = ("scene", "triangles", "width", "height", "workload", "method", "packet_width", "split_x", "split_y")

_OUTCOME = ("status", "error", "warnings", "processes", "cpu", "measured_at", "point_id")

_MOST_SETTINGS = 8

_MEASURED = (
    "render_time_s", "render_time_low_s", "render_time_high_s",
    "speedup_vs_packets", "speedup_vs_packets_low", "speedup_vs_packets_high", "speedup",
    "packets_render_time_s", "baseline_render_time_s", "plan_time_s", "build_time_s", "first_frame_time_s",
    "pixels_wrong", "pixels_hole", "pixels_tied", "pixels_edge", "depth_error_max",
    "peak_rss_bytes", "embree_bytes", "threads", "rounds",
)  # fmt: skip
"""What most workloads measure, the most asked for first."""

_DETAIL = re.compile(r"_(low|high|half|rest|spread|p999)(_s)?$|^baseline_pixels|^grids$")
"""Ends of intervals and the like, which are left to the other file but where `_MEASURED` names them."""


def csv_columns(table: pd.DataFrame) -> list[str]:
    """At most `MOST_COLUMNS`: what was measured where, the settings that vary, what came of it, and how far to trust
    it. Columns without any value are left out."""
    told = [name for name in table if table[name].notna().any()]
    vary = settings_that_vary(table, _POINT)[:_MOST_SETTINGS]
    first = [name for name in (*_POINT, *vary) if name in told or name in ("scene", "workload", "method")]
    status, *last = [name for name in _OUTCOME if name in told or name == "status"]
    shown = {*first, status, *last}
    numbers = list(table.columns)[list(table.columns).index("method") :]
    alike = set(settings())  # those that vary are shown
    others = [name for name in numbers if name in told and name not in alike and not _DETAIL.search(name)]
    others.sort(key=lambda name: table[name].nunique(dropna=False) <= 1)  # what is the same in all rows tells less
    measured = [name for name in dict.fromkeys([*_MEASURED, *others]) if name in told and name not in shown]
    return [*first, status, *measured[: MOST_COLUMNS - len(shown)], *last]
