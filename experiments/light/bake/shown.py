"""What is shown of lightmaps: lines, and figures of errors over time, stages of a round, and rays a second."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from experiments.drawing.figure import Axis, Bar, Figure, Line, Panel
from experiments.drawing.style import BLACK, BLUE, DASHED, GREY, ORANGE, SKY, VERMILLION
from experiments.drawing.values import MILLISECONDS, column, drawable, numbers, row_interval, say_number
from experiments.light.bake import BAKE, STAGES, THRESHOLDS
from experiments.light.bake.claims import CLAIMS as CLAIMS
from experiments.workloads.panels import figure_of, make_panels, read_panels, workload_figure

CLAIMS_FILE = "bake_claims"

_MEGA = 1e-6

_COLOURS = {"none": GREY, "texels": ORANGE, "bounces": BLUE}

_LINES: dict[str, tuple[str, str | None, dict[str, Any]]] = {
    "what the view shows, first": ("visible_", None, {"color": BLUE, "marker": "o", "linewidth": 2.6}),
    "what the view shows, by place": ("visible_", "view_speedup", {"color": SKY, "marker": "s", "linestyle": DASHED}),
    "whole map, the view first": ("", "whole_map_cost", {"color": VERMILLION, "marker": "o", "linewidth": 2.6}),
    "whole map, by place": ("", None, {"color": ORANGE, "marker": "s", "linestyle": DASHED}),
}
"""Lines of errors over time: kind of column, the column it is multiplied by, and style."""


def _measured(rows: pd.DataFrame, against: str) -> pd.DataFrame:
    wanted = column(rows, "against").eq(against) & column(rows, "albedo").eq("own")
    return rows[wanted.fillna(False).astype(bool)]


def _with_a_view(rows: pd.DataFrame) -> pd.DataFrame:
    rows = _measured(rows, "nothing")
    return rows[column(rows, "compaction").eq("bounces") & column(rows, "priority").eq(True)]


def _by_compaction(rows: pd.DataFrame) -> pd.DataFrame:
    rows = _measured(rows, "compaction")
    return rows if rows["compaction"].nunique() > 1 else rows[:0]


def _figure(
    kind: Any, read: Callable[[pd.DataFrame], Panel], settings: tuple[str, ...], note: str, **others: Any
) -> Any:
    """What makes a figure of rows: a panel a scene; the foot says the sizes of the maps and the note."""

    def make(rows: pd.DataFrame) -> Figure:
        sizes = " or ".join(f"{size:,}" for size in sorted(column(rows, "size").dropna().unique()))
        foot = [f"maps of {sizes} texels a side, before room is added"] if sizes else []
        panels, no_image = read_panels(make_panels(rows, settings), read), rows.assign(width=pd.NA, height=pd.NA)
        return figure_of(kind, panels, no_image, *foot, note, **others)

    return make


def _errors(rows: pd.DataFrame) -> Panel:
    lines = []
    for label, (kind, factor, style) in _LINES.items():
        times = [numbers(rows, f"{kind}time_to_rmse_{limit}_s") for limit in THRESHOLDS]
        seconds = np.array([np.nanmedian(one) if np.isfinite(one).any() else np.nan for one in times])
        seconds *= 1.0 if factor is None else np.nanmedian(numbers(rows, factor))
        known = drawable(seconds)
        if known.any():
            lines.append(Line(label, seconds[known], np.array(THRESHOLDS, np.float64)[known], style))
    return Panel(lines=lines)


def _label(row: pd.Series) -> str:
    return f"{row['compaction']}, {float(row['map_occupancy']):.0%} of the map lit"


def _ordered(rows: pd.DataFrame) -> pd.DataFrame:
    place = column(rows, "compaction").map({name: number for number, name in enumerate(_COLOURS)})
    rows = rows[rows["status"].eq("ok")].assign(_place=place)
    return rows.sort_values(["_place", "map_occupancy"], kind="stable")


def _stages(rows: pd.DataFrame) -> Panel:
    bars = []
    for _, row in _ordered(rows).iterrows():
        parts = tuple(float(row[f"{stage}_s"]) * MILLISECONDS for stage in STAGES)
        bars.append(Bar(_label(row), np.nan, np.nan, np.nan, BLACK, f"{say_number(sum(parts))} ms", parts=parts))
    return Panel(bars=bars)


def _rays(rows: pd.DataFrame) -> Panel:
    bars = []
    for _, row in _ordered(rows).iterrows():
        value, low, high = row_interval(row, "rays_per_s{}", _MEGA)
        text = f"{say_number(value)} million/s, lanes {float(row['lane_utilisation']):.0%}"
        bars.append(Bar(_label(row), value, low, high, _COLOURS[row["compaction"]], text))
    return Panel(bars=bars)


_SETTINGS = ("compaction", "occupancy", "against")
_FULL = "a map is no fuller than its charts can be packed"

FIGURES = (
    workload_figure(
        "bake_convergence", "Error of a lightmap over time, what the view shows first or by place", BAKE,
        _figure(
            "lines", _errors, ("against", "compaction"),
            "an error is the root mean square over the mean, by the variance of samples",
            x=Axis("seconds"), y=Axis("error of the light", "ticks", "{:g} %".format), legend=list(_LINES),
        ),
        _with_a_view,
    ),
    workload_figure(
        "bake_stages", "Stages of a round of samples, by how full the map is and which lanes move together", BAKE,
        _figure(
            "bars", _stages, _SETTINGS, _FULL,
            x=Axis("ms of a round", "linear"), parts=STAGES, headings=("", "time of a round"),
        ),
        _by_compaction,
    ),
    workload_figure(
        "bake_rays", "Rays that are traced in a second, by how full the map is and which lanes move together", BAKE,
        _figure(
            "bars", _rays, _SETTINGS, _FULL, x=Axis("million rays/s", "linear"),
            headings=("", "rays/s, and of the lanes of all stages that trace, those with a ray"),
        ),
        _by_compaction,
    ),
)  # fmt: skip
