"""Bars of the time of each stage, beside what it would take with warm caches and learned branches."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.style import BLUE, ORANGE

_MEASURED, _WARM = "measured", "caches warm"


def stages_figure(rows: Sequence[dict[str, str]]) -> Figure:
    """A panel for each instruction set and scene. rows: of the table."""
    of_panel: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        of_panel.setdefault(f"{row['scene']}, {row['instruction_set']}", []).append(row)
    panels = [Panel(title, bars=_bars(some)) for title, some in of_panel.items()]
    return Figure("bars", panels, x=Axis("ms a frame", "linear"), legend=(_MEASURED, _WARM), columns=4)


def _bars(rows: Sequence[dict[str, str]]) -> list[Bar]:
    bars = []
    for row in rows:
        bars.append(Bar(row["stage"], float(row["ms"]), nan, nan, ORANGE, "", series=_MEASURED))
        if row["hot_ms"]:
            bars.append(Bar("", float(row["hot_ms"]), nan, nan, BLUE, "", series=_WARM))
    return bars
