"""What is shown of pictures: where their time goes, and what a faster primary visibility saves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from experiments.drawing.bars import Stack, draw_stacks
from experiments.drawing.pages import write_notes
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.light.render import RENDER, STAGES, stage_column
from experiments.methods.naming import best_of, say_kind
from experiments.workloads.panels import bars_height, make_panels, panels_figure, workload_figure
from experiments.workloads.resources import say_ms
from experiments.workloads.series import BestPoint, best_points, count_series, say_ratio
from experiments.workloads.tables import best_by_kind, narrow_table, plain, times

_NUMBERS = ("a\nsample", "primary", "outside\nEmbree", "single\nrays", "packets", "by\nAmdahl", "paid back\nafter")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line for each scene, kind of picture and method, at its best split. rows: measured, of this workload."""
    table = narrow_table("pictures: time of a sample, and gain over single rays and packets", "scene, method", _NUMBERS)
    for kind, row, _ in best_by_kind(rows):
        table.add_row(
            plain(row["scene"], kind),
            say_ms(row["render_time_s"] / row["samples"]),
            f"{row['primary_time_s'] / row['render_time_s']:.0%}",
            "" if pd.isna(row["outside_embree"]) else f"{row['outside_embree']:.0%}",
            *times(row, "speedup", "speedup_vs_packets", "speedup_forecast"),
            say_break_even(row["break_even_subframes"]),
        )
    yield table
    still = rows[rows["jitter"].eq("off")]
    if len(still):
        gains = still["speedup_vs_packets"]
        yield (
            "camera still, no jitter: what is seen is found once and kept, so that no method is faster than one that "
            f"is kept: gains over packets {gains.min():.2f}x to {gains.max():.2f}x"
        )
    for _, row in rows[rows["samples_vs_mitsuba"].notna()].iterrows():
        yield f"{row['scene']}, {say_kind(row)}: {row['samples_vs_mitsuba']:.2f} samples for each of Mitsuba 3's"


def say_break_even(samples: Any) -> str:
    """After how many samples planning and building are paid back, in words."""
    return "never" if pd.isna(samples) else f"{int(samples)} samples" if samples > 1 else "1 sample"


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
    draw_stacks(axis, [_stack(one) for one in found if len(one.best)], _NAMES, "ms of a sample")
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
