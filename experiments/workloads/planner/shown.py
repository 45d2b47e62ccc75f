"""What is shown of plans: how far they, and packets always, stay behind the best of all candidates."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from experiments.drawing.axes import tidy_axis
from experiments.drawing.pages import add_legend, write_foot
from experiments.drawing.style import BLACK, BLUE, DOTTED, GREEN, GREY, SMALL
from experiments.drawing.values import numbers
from experiments.results.settings import settings
from experiments.workloads.panels import draw_panels, make_panels, workload_figure
from experiments.workloads.planner import PLANNER


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Two lines. rows: those of this workload that were measured."""
    regret, frame_regret, ratio = (rows[name].astype(float) for name in ("regret", "frame_regret", "vs_packets"))
    yield (
        f"plans: regret {regret.median():.2f}, at worst {regret.max():.2f}; of the frame alone "
        f"{frame_regret.median():.2f}, {frame_regret.max():.2f}; over packets at worst {ratio.max():.2f}; "
        f"{len(rows)} views"
    )
    with_planning, pays = rows["regret_with_planning"].astype(float), rows["pays_from_frames"].dropna().astype(float)
    if with_planning.notna().any():
        ahead = f"in {len(pays)} of {len(rows)} views"
        when = f", mostly from {pays.median():,.0f} frames on, at worst from {pays.max():,.0f}" if len(pays) else ""
        yield (
            f"planning counted, too: regret {with_planning.median():.2f}, at worst {with_planning.max():.2f}; it pays "
            f"{ahead}{when}"
        )


SERIES: dict[str, tuple[str, dict[str, Any]]] = {
    "plan": ("regret", {"color": BLUE, "marker": "o", "markersize": 5}),
    "packets, always": ("packets_regret", {"color": GREEN, "marker": "x", "markersize": 6}),
}
"""Label -> column and mark; marks of equal values stay apart."""

TARGET = 1.05
TARGET_LABEL = f"target: {TARGET}"


def draw_planner_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene, one line a view and image size; a logarithmic axis from 1, the best of all candidates.

    Regret is the time of plan, build and 64 frames of what was chosen, over that of the best candidate in the same
    rounds.
    """
    rows = table[table["status"] == "ok"]
    panels = make_panels(rows, settings())
    largest = max([1.3, *(value for name, _ in SERIES.values() for value in numbers(rows, name) if value > 0)])
    figure, axes = draw_panels(panels, partial(_draw_panel, largest), columns, height=3.0)
    add_legend(figure, axes, [*SERIES, TARGET_LABEL])
    write_foot(figure, rows, "plan, build and 64 frames of the choice / those of the best candidate, same rounds")
    return figure


def _draw_panel(largest: float, axis: Axes, rows: pd.DataFrame) -> None:
    rows = rows.sort_values(["width", "height", "view"], kind="stable")
    names = [f"{view}, {x} x {y}" for view, x, y in zip(rows["view"], rows["width"], rows["height"], strict=True)]
    places = range(len(rows))
    axis.axvline(TARGET, color=BLACK, linestyle=DOTTED, linewidth=1.0, zorder=1, label=TARGET_LABEL)
    for label, (name, style) in SERIES.items():
        axis.plot(numbers(rows, name), places, linestyle="none", label=label, zorder=3, **style)
    axis.set_xscale("log")
    axis.set_xlim(0.97, largest * 1.1)
    axis.set_xticks([1.0, *(tick for tick in (1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0) if tick < largest * 1.1)])
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.minorticks_off()
    axis.tick_params(axis="x", labelsize=SMALL)
    axis.set_yticks(list(places), names, fontsize=SMALL)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.set_xlabel("regret", color=GREY)
    tidy_axis(axis, "y")


FIGURES = (
    workload_figure("planner", "Regret of plans against the best of all candidates", PLANNER, draw_planner_figure),
)
