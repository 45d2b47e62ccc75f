"""Figures of frame times."""

from __future__ import annotations

from functools import partial

import pandas as pd

from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.values import varies
from experiments.methods import METHODS
from experiments.methods.aligned_forms import aligned_rows
from experiments.results.table import workload_rows
from experiments.workloads.frame import FRAME
from experiments.workloads.frame.break_even_figure import draw_break_even_figure
from experiments.workloads.frame.grid_figure import draw_grid_figure
from experiments.workloads.frame.growth import growing_rows
from experiments.workloads.frame.growth_figure import draw_growth_figure
from experiments.workloads.frame.peers_figure import draw_peers_figure
from experiments.workloads.frame.threads_figure import draw_threads_figure
from experiments.workloads.methods_figure import draw_methods_figure
from experiments.workloads.split_figure import draw_split_figure


def _rows(table: pd.DataFrame) -> pd.DataFrame:
    return workload_rows(table, FRAME.name)


def _over(table: pd.DataFrame, *axes: str) -> pd.DataFrame:
    """Aligned rows, if exactly these of the splits' axes vary."""
    rows = aligned_rows(_rows(table))
    return rows if {axis for axis in ("split_x", "split_y") if varies(rows, axis)} == set(axes) else rows[:0]


def _over_all(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """All rows, if this column varies."""
    rows = _rows(table)
    return rows if varies(rows, name) else rows[:0]


def _peers(table: pd.DataFrame) -> pd.DataFrame:
    rows = _rows(table)
    others = [method.name for method in METHODS if not method.is_ours]
    return rows if rows["method"].isin(others).any() else rows[:0]


_TELLING = (
    FigureKind(
        "figure4", "Figure 4: speed-up over the splits of both axes, culling on",
        lambda table: _over(table, "split_x", "split_y"),
        of_table(draw_grid_figure), per_packet_width=True,
    ),
    FigureKind(
        "figure5", "Figure 5: speed-up over horizontal splits, culling off and on",
        lambda table: _over(table, "split_x"), of_table(draw_split_figure), per_packet_width=True,
    ),
    FigureKind(
        "figure5_vertical", "As figure 5, over vertical splits", lambda table: _over(table, "split_y"),
        of_table(partial(draw_split_figure, axis_name="split_y")), per_packet_width=True,
    ),
    FigureKind(
        "methods", "Speed-up over packets of every method at its best split", partial(_over_all, name="method"),
        of_table(draw_methods_figure),
    ),
    FigureKind(
        "break_even", "What a view costs in all, from frame 1 to frame 1,000", partial(_over_all, name="method"),
        of_table(draw_break_even_figure),
    ),
    FigureKind(
        "threads", "Speed-up over one thread", partial(_over_all, name="threads"), of_table(draw_threads_figure),
    ),
    FigureKind(
        "growth", "Time, preparation and bytes over triangles and pixels",
        lambda table: growing_rows(_rows(table)), of_table(draw_growth_figure),
    ),
    FigureKind("peers", "Rays per second beside other ray tracers", _peers, of_table(draw_peers_figure)),
)  # fmt: skip


def _untold(table: pd.DataFrame) -> pd.DataFrame:
    """All rows, where no other figure has anything to show: a sweep over scenes, views, packets or pixels alone."""
    rows = _rows(table)
    return rows[:0] if len(rows) < 2 or any(len(kind.rows(table)) for kind in _TELLING) else rows


FIGURES = (*_TELLING, FigureKind("rates", "Rays per second", _untold, of_table(draw_peers_figure)))
