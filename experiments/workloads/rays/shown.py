"""What is shown of questions of rays: a line a point, and how many times as fast `atra.RayScene` answers."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pandas as pd
from rich.table import Table

from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.style import BLUE, GREEN, ORANGE, TIMES
from experiments.drawing.values import MILLISECONDS, row_interval, say_number
from experiments.harness.method import Method
from experiments.methods.naming import say_kind
from experiments.methods.peers.open3d_scene import OPEN3D
from experiments.methods.peers.questions import QUESTIONS
from experiments.methods.peers.trimesh_ray import TRIMESH
from experiments.workloads.panels import ONE, figure_of, make_panels, read_panels, workload_figure
from experiments.workloads.rays import BATCHES, RAYS
from experiments.workloads.tables import cell, points_table

_ASKED = ("question", "ray_batch")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "questions of rays: the method, atra.RayScene and its stand-in, and hits lost and extra of those judged"
    yield points_table(title, rows, _COLUMNS, "scene, question, method", _words, _ASKED)


def _words(row: pd.Series) -> list[str]:
    return [_say_question(row), say_kind(row)]


_COLUMNS = {
    "this": cell("answer_time_s", "{:,.1f} ms", MILLISECONDS),
    "atra": cell("answer_library_time_s", "{:,.1f} ms", MILLISECONDS),
    "gain": cell("answer_gain"),
    "stand-in": cell("stand_in_gain"),
    "judged": cell("judged_hits", "{:,}"),
    "lost,\nextra": lambda row: f"{row['lost']}, {row['extra']}",
    "atra\n": lambda row: f"{row['library_lost']}, {row['library_extra']}",
}

_COLOURS = {"coherent": BLUE, "parallel": GREEN, "incoherent": ORANGE}


def _say_question(row: pd.Series) -> str:
    asked = row["question"]
    return "contains, points" if asked == "contains" else f"{asked}, {row['ray_batch']}"


def figure(rows: pd.DataFrame) -> Figure:
    """A panel a scene: the method's time over ours, a bar for each question and kind of rays."""
    panels = read_panels(make_panels(rows, _ASKED), _gains)
    rows = rows.assign(width=pd.NA, height=pd.NA)  # no image is shown
    told = ("", "our time, the gain, and hits lost by the other and by us of those judged")
    return figure_of("bars", panels, rows, x=Axis("its time / atra.RayScene's", "linear"), headings=told)


def _gains(rows: pd.DataFrame) -> Panel:
    places = rows["question"].map(QUESTIONS.index) * len(BATCHES) + rows["ray_batch"].map(BATCHES.index)
    bars = []
    for _, row in rows.assign(_place=places).sort_values("_place", kind="stable").iterrows():
        value, low, high = row_interval(row, "answer_gain{}")
        text = f"{say_number(1e3 * float(row['answer_library_time_s']))} ms, {value:.2g}{TIMES}"
        text += f", lost {row['lost']} and {row['library_lost']} of {row['judged_hits']:,}"
        bars.append(Bar(_say_question(row), value, low, high, _COLOURS[row["ray_batch"]], text))
    return Panel(bars=bars, levels=[ONE])


def _of(rows: pd.DataFrame, method: Method) -> pd.DataFrame:
    return rows[rows["method"].eq(method.name) & rows["answer_gain"].notna()] if "answer_gain" in rows else rows[:0]


FIGURES = tuple(
    workload_figure(
        f"rays_{peer.name}", f"Questions of rays: {peer.label} beside atra.RayScene", RAYS, figure,
        partial(_of, method=peer),
    )
    for peer in (TRIMESH, OPEN3D)
)  # fmt: skip
"""One for each library that is asked."""
