"""When each process of a sweep measured, and how much of the machine others took meanwhile."""

from __future__ import annotations

from pathlib import Path

import matplotlib.dates as dates
import pandas as pd
from matplotlib.figure import Figure

from experiments.drawing.axes import label_axes
from experiments.drawing.figure import DrawnFigure, FigureKind, draw_figure, of_table
from experiments.drawing.pages import add_legend, make_figure
from experiments.drawing.style import BLUE, DASHED, GREY, ORANGE
from experiments.harness.environment import BUSY_SHARE_OF_ALL_CORES

_OTHERS, _STOLEN = "other processes", "other machines on this hardware"
_LIMIT = f"{BUSY_SHARE_OF_ALL_CORES:.0%}: a doubt where both together are above it"
_SERIES = ((_OTHERS, "others_share", "o", BLUE), (_STOLEN, "stolen_share", "x", ORANGE))


def draw_load(processes: pd.DataFrame) -> DrawnFigure | None:
    """A dot for each process whose time and load are known; None without any. processes: as of `make_tables`."""
    if not {"measured_at", "others_share"} <= set(processes):
        return None
    return next(draw_figure(_LOAD, _LOAD.rows(processes), Path()), None)


def _known(processes: pd.DataFrame) -> pd.DataFrame:
    return processes[_moments(processes).notna() & processes["others_share"].notna()]


def _moments(processes: pd.DataFrame) -> pd.Series:
    return pd.to_datetime(processes["measured_at"], utc=True, errors="coerce", format="ISO8601")


def _draw(rows: pd.DataFrame, columns: int) -> Figure:
    figure, (axis,) = make_figure(1, columns, panel_height=2.6)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width * columns, height)
    moments = _moments(rows)
    for label, column, marker, color in _SERIES:
        shares = 100.0 * pd.to_numeric(rows[column]).to_numpy(float, na_value=float("nan"))
        axis.plot(moments, shares, marker, color=color, markersize=4, linestyle="none", alpha=0.7, label=label)
    axis.axhline(100.0 * BUSY_SHARE_OF_ALL_CORES, color=GREY, linestyle=DASHED, linewidth=1.2, label=_LIMIT)
    axis.set_ylim(bottom=-0.5)
    places = dates.AutoDateLocator(minticks=2, maxticks=4 * columns)
    axis.xaxis.set_major_locator(places)
    axis.xaxis.set_major_formatter(dates.ConciseDateFormatter(places))
    label_axes(axis, "UTC", "taken of the cores, %")
    add_legend(figure, [axis], (_OTHERS, _STOLEN, _LIMIT))
    return figure


_LOAD = FigureKind(
    "load",
    "When each process measured, and the part of the cores that others took meanwhile.",
    rows=_known,
    draw=of_table(_draw),
)
