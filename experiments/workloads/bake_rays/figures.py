"""Figure of rays that share their directions: how much faster they are aligned than in packets."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes
from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.style import BLACK, BLUE, GREEN, ORANGE, TIMES
from experiments.drawing.values import say_number
from experiments.results.table import workload_rows
from experiments.workloads.bake_rays import BAKE_RAYS, Use
from experiments.workloads.panels import bars_height, make_panels, panels_figure

_COLOURS = {Use.sun.value: ORANGE, Use.sky.value: BLUE, Use.bundle.value: GREEN}
_SETTINGS = ("use", "map_size", "directions", "positions")


def _rows(table: pd.DataFrame) -> pd.DataFrame:
    rows = workload_rows(table, BAKE_RAYS.name)
    return rows[rows["use"].isin(_COLOURS)] if "use" in rows else rows


def draw_alignment(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: packets over aligned rays, with intervals, a bar for each use and number of positions."""
    panels = make_panels(rows, _SETTINGS)
    rows = rows.assign(width=pd.NA, height=pd.NA)  # no image is shown
    foot = "right of a label: aligned rays' time, plan and build included, and packets / aligned"
    return panels_figure(panels, _draw_ratios, columns, rows, foot, height=bars_height(panels, len))


def _draw_ratios(axis: Axes, rows: pd.DataFrame) -> None:
    place = rows["use"].map({use: number for number, use in enumerate(_COLOURS)})
    ordered = rows[rows["status"].eq("ok")].assign(_place=place).sort_values(["_place", *_SETTINGS[1:]], kind="stable")
    bars = []
    for _, row in ordered.iterrows():
        value, low, high = (
            float(pd.to_numeric(row[f"packets_over_aligned{end}"], errors="coerce")) for end in ("", "_low", "_high")
        )
        text = f"{say_number(1e3 * float(row['aligned_time_s']))} ms, {value:.2g}{TIMES}"
        bars.append(Bar(_label(row), value, low, high, _COLOURS[row["use"]], text))
    draw_bars(axis, bars)
    axis.axvline(1.0, color=BLACK, linewidth=1.0, zorder=1)
    finish_bar_axes(axis, bars, "coherent packets / aligned rays", 1.0)


def _label(row: pd.Series) -> str:
    ways = "" if row["use"] == Use.sun.value else f", {_counted(row['directions'], 'direction')}"
    positions = _counted(row["positions"], "position")
    return f"{row['use']}{ways}, {positions}, {row['map_size']}\N{SUPERSCRIPT TWO}"


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}" + "s" * (count != 1)


FIGURES = (
    FigureKind(
        "bake_alignment", "Rays of a bake of shared directions: packets over aligned rays, plan and build included",
        _rows, of_table(draw_alignment),
    ),
)  # fmt: skip
