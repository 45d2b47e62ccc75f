"""Figures of a table: every one that the sweep names, or that has something to show."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from atra.errors import InputError
from experiments.drawing.figure import DrawnFigure, FigureKind, draw_figure
from experiments.paper.figures import FIGURES as PAPER_FIGURES
from experiments.results.table import rows_of, workload_rows
from experiments.workloads import WORKLOADS


def figure_kinds() -> tuple[FigureKind, ...]:
    """Those of every workload, and the paper's that draw several workloads."""
    rooms = (workload.part("shown") for workload in WORKLOADS)
    return (*(kind for room in rooms for kind in getattr(room, "FIGURES", ())), *PAPER_FIGURES)


def check_figures(figures: Mapping[str, Sequence[str]], grids: Collection[str]) -> None:
    """Raise InputError, naming those there are, for a figure that is unknown or drawn of a grid the sweep lacks."""
    known = [kind.name for kind in figure_kinds()]
    for name, drawn in figures.items():
        if name not in known:
            raise InputError(f"sweep.figures names {name!r}, expected one of {', '.join(known)}")
        for grid in drawn:
            if grid not in grids:
                raise InputError(f"sweep.figures.{name} names {grid!r}, expected one of {', '.join(grids)}")


def draw_figures(
    table: pd.DataFrame, records: Path, grids: Mapping[str, Sequence[str]] | None = None
) -> Iterator[DrawnFigure]:
    """Every figure that the table allows; one none of whose points was measured is left out.

    records: the folder of the records. grids: by name of the figure, the grids whose points it draws; without any,
    every figure draws what it can of the table.
    """
    for kind in figure_kinds():
        if grids and kind.name not in grids:
            continue
        rows = _of_grids(table, grids[kind.name]) if grids else kind.rows(table)
        if len(rows):
            yield from draw_figure(kind, rows, records)


def _of_grids(table: pd.DataFrame, grids: Sequence[str]) -> pd.DataFrame:
    """The rows of these grids, in the columns of their workloads."""
    rows = rows_of(table, *grids)
    return workload_rows(rows, *rows["workload"].unique())
