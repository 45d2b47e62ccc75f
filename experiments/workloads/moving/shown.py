"""What is shown of a moving camera: methods at their best splits, and packets that build anew or keep their BVH."""

from __future__ import annotations

from collections.abc import Iterator
from math import nan

import numpy as np
import pandas as pd
from rich.table import Table

from experiments.drawing.figure import Bar, Figure, Panel
from experiments.drawing.style import GREEN
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.methods.naming import best_of, say_split
from experiments.workloads.frame_figures import over_packets_figure, ratio_bar
from experiments.workloads.moving import MOVING
from experiments.workloads.panels import make_panels, workload_figure
from experiments.workloads.resources import say_ms
from experiments.workloads.series import best_points, best_rows
from experiments.workloads.tables import best_by_kind, best_table, cell

_COLUMNS = {
    "frame": lambda row: say_ms(row["render_time_s"]),
    "over the\nsame eye": cell("moving_over_still"),
    "packets": cell("speedup_vs_packets"),
    "packets,\nkept": cell("speedup_vs_kept_packets"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The best split of each scene and kind of method. rows: measured, of this workload."""
    best = ((list(filter(None, [kind, say_split(row)])), row, some) for kind, row, some in best_by_kind(rows))
    title = "a camera that moves: best split of each scene, and ratios"
    yield best_table(title, "scene, method", best, _COLUMNS, "pixels_wrong")


def moving_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); ratios within rounds, from zero.

    A bar is a method at its best split, its whisker the interval; a frame includes what a new eye requires. The two
    lines are single rays and the fastest packets per pixel, which pay for it, too. The packets of the last bar do not.
    """
    panels = make_panels(table, (*best_of(), "packet_width"))
    return over_packets_figure(
        panels, _bars, table, "time of a frame from another eye, packets / method and its interval",
        "packets that keep a BVH of the world are not as exact",
    )  # fmt: skip


def _bars(rows: pd.DataFrame) -> Panel:
    points = list(best_points(rows))
    bars = [ratio_bar(point) for point in points if len(point.best)] + _kept_bars(best_rows(rows))
    return Panel(bars=bars, notes=[line for point in points for line in point.notes()])


def _kept_bars(rows: pd.DataFrame) -> list[Bar]:
    """One bar of the medians over all points, which has no interval; none where nothing was measured."""
    kept_s, packets_s = (_median(rows, name) for name in ("kept_packets_time_s", "packets_render_time_s"))
    if not kept_s > 0:
        return []
    text = f"{say_number(kept_s * MILLISECONDS)} ms"
    return [Bar("packets, BVH of the world kept", packets_s / kept_s, nan, nan, GREEN, text, faint=True)]


def _median(rows: pd.DataFrame, name: str) -> float:
    values = numbers(rows, name)
    return float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else nan


FIGURES = (
    workload_figure("moving", "Speed-up over packets of every method while the camera moves", MOVING, moving_figure),
)
