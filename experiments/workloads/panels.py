"""Panels: the rows of a table that belong into one picture, and figures made of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.bars import Bar, draw_bars, panel_height
from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes
from experiments.drawing.style import BLACK
from experiments.drawing.values import column, varies
from experiments.harness.point import Workload
from experiments.results.settings import say_setting, settings_that_vary
from experiments.results.table import workload_rows

DrawPanel = Callable[[Axes, pd.DataFrame], object]


@dataclass(frozen=True)
class Panel:
    """The rows of one panel. details: what tells it from other panels of its scene, in words."""

    scene: str
    details: str
    rows: pd.DataFrame

    @property
    def title(self) -> str:
        """The scene, its triangle count, the details."""
        triangles = self.rows["triangles"].dropna()
        counted = f"{self.scene} ({triangles.iloc[0]:,} triangles)" if len(triangles) else self.scene
        return ", ".join(filter(None, [counted, self.details]))

    @property
    def stands_for(self) -> str | None:
        """The scene of the paper that this one replaces, if it is a stand-in."""
        names = column(self.rows, "stands_for").dropna()
        return str(names.iloc[0]) if len(names) else None


def make_panels(table: pd.DataFrame, shown: Collection[str]) -> list[Panel]:
    """One panel for each scene, in the table's order, and for each value of a setting that varies, ascending.

    shown: settings that make no panels, because the figure tells them apart or shows the best of them.
    """
    varying = settings_that_vary(table, shown)
    panels = []
    for scene in table["scene"].unique():
        of_scene = table[table["scene"] == scene]
        if not varying:
            panels.append(Panel(str(scene), "", of_scene))
            continue
        for key, rows in of_scene.groupby(varying, sort=True, dropna=False):
            words = [say_setting(name, value) for name, value in zip(varying, key, strict=True)]
            panels.append(Panel(str(scene), ", ".join(words), rows))
    return panels


def bars_height(panels: Sequence[Panel], count: Callable[[pd.DataFrame], int] = len) -> float:
    """Inches that suit the panel with the most bars. count: rows -> bars."""
    return panel_height(max((count(panel.rows) for panel in panels), default=0))


Bars = tuple[Sequence[Bar], Sequence[str]]
"""What a panel of bars shows: bars from the top down, and lines of text below them."""


def draw_one(axis: Axes, rows: pd.DataFrame) -> float:
    """A line where a ratio is 1; returns 1."""
    axis.axvline(1.0, color=BLACK, linewidth=1.0, zorder=1)
    return 1.0


def draw_panels(
    panels: Sequence[Panel], draw: DrawPanel, columns: int, height: float = 4.1
) -> tuple[Figure, list[Axes]]:  # fmt: skip
    """A figure of titled panels, and their axes. draw: is given each panel's axis and rows."""
    figure, axes = make_figure(len(panels), columns, height)
    for axis, panel in zip(axes, panels, strict=True):
        set_panel_title(axis, panel.title, panel.stands_for)
        draw(axis, panel.rows)
    return figure, axes


def panels_figure(
    panels: Sequence[Panel], draw: DrawPanel, columns: int, rows: pd.DataFrame, *foot: str,
    legend: Sequence[str] | None = None, height: float = 4.1, mark: str = "",
) -> Figure:  # fmt: skip
    """`draw_panels` with a legend of these labels, and a foot that describes how `rows` were measured."""
    figure, axes = draw_panels(panels, draw, columns, height)
    if legend is not None:
        add_legend(figure, axes, legend)
    write_foot(figure, rows, *foot, mark=mark)
    return figure


def bars_figure(
    panels: Sequence[Panel], read: Callable[[pd.DataFrame], Bars], quantity: str, columns: int, rows: pd.DataFrame,
    *foot: str, draw_lines: Callable[[Axes, pd.DataFrame], float] = lambda axis, rows: 0.0,
    legend: Sequence[str] | None = None, count: Callable[[pd.DataFrame], int] = len,
) -> Figure:  # fmt: skip
    """`panels_figure` of bars. read: a panel's rows -> what it shows. quantity: along the abscissa.

    draw_lines: draws upright lines into a panel, and returns where the farthest of them ends. count: rows -> bars.
    """

    def draw(axis: Axes, of_panel: pd.DataFrame) -> None:
        bars, notes = read(of_panel)
        draw_bars(axis, bars, quantity, lambda: draw_lines(axis, of_panel))
        write_notes(axis, notes)

    return panels_figure(panels, draw, columns, rows, *foot, legend=legend, height=bars_height(panels, count))


def workload_figure(
    name: str, caption: str, workload: Workload, draw: Callable[[pd.DataFrame, int], Figure],
    where: Callable[[pd.DataFrame], pd.DataFrame] = lambda rows: rows, per_packet_width: bool = False,
) -> FigureKind:  # fmt: skip
    """A figure of a workload's rows. where: all of these -> those that it can draw, by default all."""

    def rows(table: pd.DataFrame) -> pd.DataFrame:
        return where(workload_rows(table, workload.name))

    return FigureKind(name, caption, rows, of_table(draw), per_packet_width)


def where_varies(name: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """All rows, if this column varies."""
    return lambda rows: rows if varies(rows, name) else rows[:0]
