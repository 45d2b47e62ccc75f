"""Panels: the rows of a table that belong into one picture."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.pages import make_figure, set_panel_title
from experiments.drawing.values import column
from experiments.results.settings import say_setting, settings_that_vary


@dataclass(frozen=True)
class Panel:
    """The rows of one panel; `details` says in words what tells it from other panels of its scene."""

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
    """One panel a scene, in the order of the table, and a value of every setting that varies, ascending.

    shown: the settings that the figure itself tells apart, or takes the best of: they make no panels.
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


def draw_panels(
    panels: Sequence[Panel], draw: Callable[[Axes, pd.DataFrame], object], columns: int, height: float = 4.1
) -> tuple[Figure, list[Axes]]:  # fmt: skip
    """A figure of titled panels and their axes; `draw` is given each panel's axis and rows."""
    figure, axes = make_figure(len(panels), columns, height)
    for axis, panel in zip(axes, panels, strict=True):
        set_panel_title(axis, panel.title, panel.stands_for)
        draw(axis, panel.rows)
    return figure, axes
