"""What is shown of lightmaps: lines, and figures of errors over time, stages of a round, and rays a second."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from rich.table import Table

from experiments.drawing.axes import label_axes, say_nothing_measured, write_plainly
from experiments.drawing.bars import Bar, Stack, draw_stacks
from experiments.drawing.style import BLUE, DASHED, GREY, ORANGE, SKY, VERMILLION
from experiments.drawing.values import MILLISECONDS, column, numbers, row_interval, say_number
from experiments.light.bake import BAKE, STAGES, THRESHOLDS
from experiments.light.bake.claims import CLAIMS as CLAIMS
from experiments.workloads.panels import Bars, bars_figure, bars_height, make_panels, panels_figure, workload_figure
from experiments.workloads.tables import cell, points_table

CLAIMS_FILE = "bake_claims"

_COLUMNS = {
    "rays/s": cell("rays_per_s", "{:.3g}"),
    "lanes\nused": cell("lane_utilisation", "{:.0%}"),
    "vs\nother": cell("speedup_vs_other"),
    "time to\nerror": cell("quality_vs_other"),
    "seen\nsooner": cell("view_speedup"),
    "whole\nmap": cell("whole_map_cost"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    yield points_table("lightmaps", rows, _COLUMNS)


_MEGA = 1e-6

_COLOURS = {"none": GREY, "texels": ORANGE, "bounces": BLUE}

_LINES: dict[str, tuple[str, str | None, dict[str, Any]]] = {
    "what the view shows, first": ("visible_", None, {"color": BLUE, "marker": "o"}),
    "what the view shows, by place": ("visible_", "view_speedup", {"color": SKY, "marker": "s", "linestyle": DASHED}),
    "whole map, the view first": ("", "whole_map_cost", {"color": VERMILLION, "marker": "o"}),
    "whole map, by place": ("", None, {"color": ORANGE, "marker": "s", "linestyle": DASHED}),
}
"""Lines of errors over time: kind of column, the column it is multiplied by, and style, the widest first."""


def _measured(rows: pd.DataFrame, against: str) -> pd.DataFrame:
    wanted = column(rows, "against").eq(against) & column(rows, "albedo").eq("own")
    return rows[wanted.fillna(False).astype(bool)]


def _with_a_view(rows: pd.DataFrame) -> pd.DataFrame:
    rows = _measured(rows, "nothing")
    return rows[column(rows, "compaction").eq("bounces") & column(rows, "priority").eq(True)]


def _by_compaction(rows: pd.DataFrame) -> pd.DataFrame:
    rows = _measured(rows, "compaction")
    return rows if rows["compaction"].nunique() > 1 else rows[:0]


def _without_image(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows without the size of the view's image, which no lightmap has."""
    return rows.assign(width=pd.NA, height=pd.NA)


def _sizes(rows: pd.DataFrame) -> list[str]:
    """A line for the foot with the sizes of the maps."""
    sizes = " or ".join(f"{size:,}" for size in sorted(column(rows, "size").dropna().unique()))
    return [f"maps of {sizes} texels a side, before room is added"] if sizes else []


def draw_convergence(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene, both axes logarithmic: the error over the time until it is reached."""
    panels = make_panels(rows, ("against", "compaction"))
    foot = "an error is the root mean square over the mean, by the variance of samples"
    shown = _without_image(rows)
    return panels_figure(panels, _draw_errors, columns, shown, *_sizes(rows), foot, legend=list(_LINES))


def _draw_errors(axis: Axes, rows: pd.DataFrame) -> None:
    for place, (label, (kind, factor, style)) in enumerate(_LINES.items()):
        times = [numbers(rows, f"{kind}time_to_rmse_{limit}_s") for limit in THRESHOLDS]
        seconds = np.array([np.nanmedian(one) if np.isfinite(one).any() else np.nan for one in times])
        seconds *= 1.0 if factor is None else np.nanmedian(numbers(rows, factor))
        if np.isfinite(seconds).any():
            width = 3.4 - 0.8 * place
            axis.plot(seconds, THRESHOLDS, linewidth=width, markersize=3 + 1.5 * width, label=label, **style)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_yticks(THRESHOLDS, [f"{limit} %" for limit in THRESHOLDS])
    axis.yaxis.set_minor_formatter(NullFormatter())
    write_plainly(axis.xaxis)
    label_axes(axis, "seconds", "error of the light")
    if not axis.lines:
        say_nothing_measured(axis)


def draw_stages(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: milliseconds of a round, a bar for each occupancy and compaction, its parts the stages."""
    panels = make_panels(rows, _SETTINGS)
    return panels_figure(
        panels, _draw_stages, columns, _without_image(rows), *_sizes(rows), "right of a label: time of a round", _FULL,
        legend=STAGES, height=bars_height(panels),
    )  # fmt: skip


_SETTINGS = ("compaction", "occupancy", "against")
_FULL = "a map is no fuller than its charts can be packed"


def _label(row: pd.Series) -> str:
    return f"{row['compaction']}, {float(row['map_occupancy']):.0%} of the map lit"


def _ordered(rows: pd.DataFrame) -> pd.DataFrame:
    place = column(rows, "compaction").map({name: number for number, name in enumerate(_COLOURS)})
    rows = rows[rows["status"].eq("ok")].assign(_place=place)
    return rows.sort_values(["_place", "map_occupancy"], kind="stable")


def _draw_stages(axis: Axes, rows: pd.DataFrame) -> None:
    stacks = []
    for _, row in _ordered(rows).iterrows():
        parts = tuple(float(row[f"{stage}_s"]) * MILLISECONDS for stage in STAGES)
        stacks.append(Stack(_label(row), parts, f"{say_number(sum(parts))} ms"))
    draw_stacks(axis, stacks, STAGES, "ms of a round")


def draw_rays(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: millions of rays in a second, with intervals, a bar for each occupancy and compaction."""
    foot = "right of a label: rays/s, and of the lanes of all stages that trace, those with a ray"
    panels, shown = make_panels(rows, _SETTINGS), _without_image(rows)
    return bars_figure(panels, _rays, "million rays/s", columns, shown, *_sizes(rows), foot, _FULL)


def _rays(rows: pd.DataFrame) -> Bars:
    bars = []
    for _, row in _ordered(rows).iterrows():
        value, low, high = row_interval(row, "rays_per_s{}", _MEGA)
        text = f"{say_number(value)} million/s, lanes {float(row['lane_utilisation']):.0%}"
        bars.append(Bar(_label(row), value, low, high, _COLOURS[row["compaction"]], text))
    return bars, ()


FIGURES = (
    workload_figure(
        "bake_convergence", "Error of a lightmap over time, what the view shows first or by place", BAKE,
        draw_convergence, _with_a_view,
    ),
    workload_figure(
        "bake_stages", "Stages of a round of samples, by how full the map is and which lanes move together", BAKE,
        draw_stages, _by_compaction,
    ),
    workload_figure(
        "bake_rays", "Rays that are traced in a second, by how full the map is and which lanes move together", BAKE,
        draw_rays, _by_compaction,
    ),
)  # fmt: skip
