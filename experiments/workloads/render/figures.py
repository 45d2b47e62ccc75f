"""Figure of pictures: the stages of a sample, stacked, for every method of primary visibility."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import tidy_axis
from experiments.drawing.bars import Stack, draw_stacks
from experiments.drawing.pages import write_notes
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.methods.naming import best_of
from experiments.workloads.panels import bars_height, make_panels, panels_figure, workload_figure
from experiments.workloads.render import RENDER, STAGES, stage_column
from experiments.workloads.series import BestPoint, best_points, count_series, say_ratio

_NAMES = [name.replace("_", " ") for name in STAGES]


def draw_stages_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds of a sample, from zero.

    A bar is a method at its best split, its parts the stages.
    """
    panels = make_panels(table, (*best_of(), "packet_width"))
    foot = "right of a label: time of a sample, gain over packets and its interval, Amdahl's forecast"
    height = bars_height(panels, count_series)
    return panels_figure(panels, _draw_panel, columns, table, foot, legend=_NAMES, height=height)


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    found = list(best_points(rows))
    draw_stacks(axis, [_stack(one) for one in found if len(one.best)], _NAMES)
    axis.set_xlabel("ms of a sample")
    tidy_axis(axis, "x", frame=("bottom",))
    write_notes(axis, [line for one in found for line in one.notes()])


def _stack(one: BestPoint) -> Stack:
    row = one.best.iloc[0]
    of_a_sample = MILLISECONDS / float(row["samples"])
    parts = tuple(float(numbers(one.best, stage_column(name))[0]) * of_a_sample for name in STAGES)
    text = f"{say_number(row['render_time_s'] * of_a_sample)} ms, {say_ratio(row)}"
    return Stack(one.label, parts, f"{text}, {row['speedup_forecast']:.2f}")


FIGURES = (
    workload_figure(
        "stages", "Stages of a sample of a picture, for every method of primary visibility", RENDER, draw_stages_figure
    ),
)
