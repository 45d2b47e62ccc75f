"""Figure of pictures: the stages of a sample, stacked, for every method of primary visibility."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import tidy_axis
from experiments.drawing.bars import Stack, draw_stacks, panel_height
from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.pages import add_legend, write_foot, write_notes
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.methods.naming import best_of, say_series, say_split
from experiments.results.table import workload_rows
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.ratios import best_rows
from experiments.workloads.render import RENDER, STAGES, stage_column
from experiments.workloads.series import say_ratio, say_unmeasured, say_wrong, series_of


def draw_stages_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds of a sample, from zero.

    A bar is a method at its best split, its parts the stages.
    """
    panels = make_panels(table, (*best_of(), "packet_width"))
    tallest = max((len(list(series_of(panel.rows))) for panel in panels), default=0)
    figure, axes = draw_panels(panels, _draw_panel, columns, panel_height(tallest))
    add_legend(figure, axes, [_say_stage(name) for name in STAGES])
    write_foot(
        figure, table, "right of a label: time of a sample, gain over packets and its interval, Amdahl's forecast"
    )
    return figure


def _say_stage(name: str) -> str:
    return name.replace("_", " ")


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    stacks, notes = [], []
    for method, width, points in series_of(rows):
        name, best = say_series(method, width), best_rows(points)
        notes += [*say_unmeasured(points, name), *say_wrong(best, name)]
        if len(best):
            label = ", ".join(filter(None, [name, say_split(best.iloc[0])]))
            stacks.append(_stack(best, label))
    draw_stacks(axis, stacks, [_say_stage(name) for name in STAGES])
    axis.set_xlabel("ms of a sample")
    tidy_axis(axis, "x", frame=("bottom",))
    write_notes(axis, notes)


def _stack(best: pd.DataFrame, label: str) -> Stack:
    row = best.iloc[0]
    of_a_sample = MILLISECONDS / float(row["samples"])
    parts = tuple(float(numbers(best, stage_column(name))[0]) * of_a_sample for name in STAGES)
    text = f"{say_number(row['render_time_s'] * of_a_sample)} ms, {say_ratio(row)}"
    return Stack(label, parts, f"{text}, {row['speedup_forecast']:.2f}")


FIGURES = (
    FigureKind(
        "stages", "Stages of a sample of a picture, for every method of primary visibility",
        lambda table: workload_rows(table, RENDER.name), of_table(draw_stages_figure),
    ),
)  # fmt: skip
