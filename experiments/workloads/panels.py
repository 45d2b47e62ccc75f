"""Panels: the rows of a table that belong into one picture, and figures made of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import pandas as pd

from experiments.drawing.figure import Figure, FigureKind, Level, Panel, of_table
from experiments.drawing.provenance import how_measured, provenance
from experiments.drawing.style import BLACK
from experiments.drawing.values import column, varies
from experiments.harness.point import Workload
from experiments.results.settings import say_setting, settings_that_vary
from experiments.results.table import workload_rows

Read = Callable[[pd.DataFrame], Panel]
"""The rows of a panel -> what it shows, but for its title."""

ONE = Level("_one", 1.0, {"color": BLACK})
"""A line where a ratio is 1."""


@dataclass(frozen=True)
class PanelRows:
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

    def panel(self, shown: Panel, words: str = "") -> Panel:
        """It with a title. words: behind the title."""
        return replace(shown, title=f"{self.title}{words}", stands_for=self.stands_for)


def make_panels(table: pd.DataFrame, shown: Collection[str]) -> list[PanelRows]:
    """One panel for each scene, in the table's order, and for each value of a setting that varies, ascending.

    shown: settings that make no panels, because the figure tells them apart or shows the best of them.
    """
    varying = settings_that_vary(table, shown)
    order, _ = pd.factorize(table["scene"])
    panels = []
    for (_, *key), rows in table.groupby([order, *(table[name] for name in varying)], dropna=False):
        words = [say_setting(name, value) for name, value in zip(varying, key, strict=True)]
        panels.append(PanelRows(str(rows["scene"].iloc[0]), ", ".join(words), rows))
    return panels


def figure_of(
    kind: Literal["lines", "bars", "cells", "pictures"], panels: Sequence[Panel], rows: pd.DataFrame, *notes: str,
    mark: str = "", **fields: Any,
) -> Figure:  # fmt: skip
    """A figure that says how `rows` were measured. fields: of `Figure`. mark: as of `how_measured`."""
    told = list(filter(None, [how_measured(rows, mark), *notes]))
    return Figure(kind, panels, provenance=provenance(rows), notes=told, **fields)


def read_panels(panels: Sequence[PanelRows], read: Read) -> list[Panel]:
    """What each shows, with its title."""
    return [panel.panel(read(panel.rows)) for panel in panels]


def workload_figure(
    name: str, caption: str, workload: Workload, make: Callable[[pd.DataFrame], Figure],
    where: Callable[[pd.DataFrame], pd.DataFrame] = lambda rows: rows, per_packet_width: bool = False,
) -> FigureKind:  # fmt: skip
    """A figure of a workload's rows. where: all of these -> those that it can draw, by default all."""

    def rows(table: pd.DataFrame) -> pd.DataFrame:
        return where(workload_rows(table, workload.name))

    return FigureKind(name, caption, rows, of_table(make), per_packet_width)


def where_varies(name: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """All rows, if this column varies."""
    return lambda rows: rows if varies(rows, name) else rows[:0]
