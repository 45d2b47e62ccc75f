"""What is shown of lightmaps: lines, and figures of errors over time, stages of a round, and rays a second."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from rich.table import Table

from experiments.drawing.axes import say_nothing_measured, tidy_axis
from experiments.drawing.bars import Bar, Stack, draw_bars, draw_stacks, finish_bar_axes
from experiments.drawing.pages import add_legend, write_foot
from experiments.drawing.style import BLUE, DASHED, GREY, ORANGE, SKY, VERMILLION
from experiments.drawing.values import MILLISECONDS, column, numbers, say_number
from experiments.workloads.bake import BAKE, STAGES, THRESHOLDS, Against
from experiments.workloads.bake.claims import CLAIMS as CLAIMS
from experiments.workloads.panels import DrawPanel, bars_height, draw_panels, make_panels, workload_figure
from experiments.workloads.tables import points_table

CLAIMS_FILE = "bake_claims"

_COLUMNS = {
    "rays/s": ("rays_per_s", "{:.3g}"),
    "lanes\nused": ("lane_utilisation", "{:.0%}"),
    "vs\nother": ("speedup_vs_other", "{:.2f}x"),
    "time to\nerror": ("quality_vs_other", "{:.2f}x"),
    "seen\nsooner": ("view_speedup", "{:.2f}x"),
    "whole\nmap": ("whole_map_cost", "{:.2f}x"),
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


def _measured(rows: pd.DataFrame, *against: Against) -> pd.DataFrame:
    wanted = column(rows, "against").isin([one.value for one in against]) & column(rows, "albedo").eq("own")
    return rows[wanted.fillna(False).astype(bool)]


def _with_a_view(rows: pd.DataFrame) -> pd.DataFrame:
    rows = _measured(rows, Against.nothing)
    return rows[column(rows, "compaction").eq("bounces") & column(rows, "priority").eq(True)]


def _by_compaction(rows: pd.DataFrame) -> pd.DataFrame:
    rows = _measured(rows, Against.compaction)
    return rows if rows["compaction"].nunique() > 1 else rows[:0]


def _write_foot(figure: Figure, rows: pd.DataFrame, *lines: str) -> None:
    """A foot with the size of the maps in place of that of the view's image."""
    sizes = " or ".join(f"{size:,}" for size in sorted(column(rows, "size").dropna().unique()))
    about = [f"maps of {sizes} texels a side, before room is added"] if sizes else []
    write_foot(figure, rows.assign(width=pd.NA, height=pd.NA), *about, *lines)


def draw_convergence(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene, both axes logarithmic: the error over the time until it is reached."""
    panels = make_panels(rows, ("against", "compaction"))
    figure, axes = draw_panels(panels, _draw_errors, columns)
    add_legend(figure, axes, list(_LINES))
    _write_foot(figure, rows, "an error is the root mean square over the mean, by the variance of samples")
    return figure


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
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_xlabel("seconds")
    axis.set_ylabel("error of the light")
    tidy_axis(axis)
    if not axis.lines:
        say_nothing_measured(axis)


def draw_stages(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: milliseconds of a round, a bar for each occupancy and compaction, its parts the stages."""
    figure, axes = _bars(rows, columns, _draw_stages, "right of a label: time of a round")
    add_legend(figure, axes, STAGES)
    return figure


def _bars(rows: pd.DataFrame, columns: int, draw: DrawPanel, foot: str) -> tuple[Figure, list[Axes]]:
    panels = make_panels(rows, ("compaction", "occupancy", "against"))
    figure, axes = draw_panels(panels, draw, columns, bars_height(panels, len))
    _write_foot(figure, rows, foot, "a map is no fuller than its charts can be packed")
    return figure, axes


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
    draw_stacks(axis, stacks, STAGES)
    axis.set_xlabel("ms of a round")
    tidy_axis(axis, "x", frame=("bottom",))


def draw_rays(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: millions of rays in a second, with intervals, a bar for each occupancy and compaction."""
    foot = "right of a label: rays/s, and of the lanes of all stages that trace, those with a ray"
    return _bars(rows, columns, _draw_rays, foot)[0]


def _draw_rays(axis: Axes, rows: pd.DataFrame) -> None:
    bars = []
    for _, row in _ordered(rows).iterrows():
        value, low, high = (
            float(pd.to_numeric(row[f"rays_per_s{end}"], errors="coerce")) * _MEGA for end in ("", "_low", "_high")
        )
        text = f"{say_number(value)} million/s, lanes {float(row['lane_utilisation']):.0%}"
        bars.append(Bar(_label(row), value, low, high, _COLOURS[row["compaction"]], text))
    draw_bars(axis, bars)
    finish_bar_axes(axis, bars, "million rays/s")


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
