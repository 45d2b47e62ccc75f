"""What is shown of pictures: where their time goes, and what a faster primary visibility saves."""

from __future__ import annotations

from collections.abc import Iterator
from math import nan
from typing import Any

import pandas as pd
from rich.table import Table

from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.style import BLACK
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.light.render import RENDER, STAGES, stage_column
from experiments.methods.naming import best_of
from experiments.workloads.panels import figure_of, make_panels, read_panels, workload_figure
from experiments.workloads.resources import say_ms
from experiments.workloads.series import BestPoint, best_points, say_ratio, say_wrong
from experiments.workloads.tables import best_by_kind, narrow_table, times

_NUMBERS = ("a\nsample", "primary", "outside\nEmbree", "single\nrays", "packets", "by\nAmdahl", "paid back\nafter")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line for each scene, kind of picture and method, at its best split. rows: measured, of this workload."""
    table = narrow_table("pictures: time of a sample, and gain over single rays and packets", "scene, method", _NUMBERS)
    for kind, row, _ in best_by_kind(rows):
        table.add_row(
            kind,
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


def say_break_even(samples: Any) -> str:
    """After how many samples planning and building are paid back, in words."""
    return "never" if pd.isna(samples) else f"{int(samples)} samples" if samples > 1 else "1 sample"


_NAMES = [name.replace("_", " ") for name in STAGES]


def stages_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds of a sample, from zero.

    A bar is a method at its best split, its parts the stages.
    """
    panels = read_panels(make_panels(table, (*best_of(), "packet_width")), _panel)
    headings = ("", "time of a sample, gain over packets and its interval, Amdahl's forecast")
    return figure_of("bars", panels, table, x=Axis("ms of a sample", "linear"), parts=_NAMES, headings=headings)


def _panel(rows: pd.DataFrame) -> Panel:
    found = list(best_points(rows))
    return Panel(
        bars=[_bar(one) for one in found if len(one.best)],
        notes=[line for one in found for line in say_wrong(one.best, one.name)],
    )


def _bar(one: BestPoint) -> Bar:
    row = one.best.iloc[0]
    of_a_sample = MILLISECONDS / float(row["samples"])
    parts = tuple(float(numbers(one.best, stage_column(name))[0]) * of_a_sample for name in STAGES)
    text = f"{say_number(row['render_time_s'] * of_a_sample)} ms, {say_ratio(row)}, {row['speedup_forecast']:.2f}"
    return Bar(one.label, nan, nan, nan, BLACK, text, parts=parts)


FIGURES = (
    workload_figure(
        "stages", "Stages of a sample of a picture, for every method of primary visibility", RENDER, stages_figure
    ),
)
