"""When each process of a sweep measured, and how much of the machine others took meanwhile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from experiments.drawing.figure import Axis, Figure, FigureKind, Level, Line, NamedFigure, Panel, make_figures, of_table
from experiments.drawing.provenance import provenance
from experiments.drawing.style import BLUE, DASHED, GREY, ORANGE
from experiments.drawing.values import numbers
from experiments.harness.processes.idle import BUSY_SHARE_OF_ALL_CORES

_OTHERS, _STOLEN = "other processes", "other machines on this hardware"
_LIMIT = f"{BUSY_SHARE_OF_ALL_CORES:.0%}: a warning where both together are above it"
_SERIES = ((_OTHERS, "others_share", "o", BLUE), (_STOLEN, "stolen_share", "x", ORANGE))
_DAY_S = 86_400.0


def load_figure(processes: pd.DataFrame) -> NamedFigure | None:
    """A dot for each process whose time and load are known; None without any. processes: as of `make_tables`."""
    if not {"measured_at", "others_share"} <= set(processes):
        return None
    return next(make_figures(_LOAD, _LOAD.rows(processes), Path()), None)


def _known(processes: pd.DataFrame) -> pd.DataFrame:
    return processes[_moments(processes).notna() & processes["others_share"].notna()]


def _moments(processes: pd.DataFrame) -> pd.Series:
    return pd.to_datetime(processes["measured_at"], utc=True, errors="coerce", format="ISO8601")


def _figure(rows: pd.DataFrame) -> Figure:
    days = np.array([moment.timestamp() / _DAY_S for moment in _moments(rows)])
    lines = []
    for label, column, marker, color in _SERIES:
        looks = {"color": color, "marker": marker, "linestyle": "none", "alpha": 0.7}
        lines.append(Line(label, days, 100.0 * numbers(rows, column), looks))
    levels = [Level(_LIMIT, 100.0 * BUSY_SHARE_OF_ALL_CORES, {"color": GREY, "linestyle": DASHED})]
    share = Axis("taken of the cores, %", "linear", low=-0.5)
    legend = (_OTHERS, _STOLEN, _LIMIT)
    panels = [Panel(lines=lines, levels=levels)]
    return Figure("lines", panels, Axis("UTC", "days"), share, legend=legend, provenance=provenance(rows))


_LOAD = FigureKind(
    "load",
    "When each process measured, and the part of the cores that others took meanwhile.",
    rows=_known,
    make=of_table(_figure),
)
