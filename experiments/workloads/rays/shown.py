"""What is shown of questions of rays: a line a point, and how many times as fast `atra.RayScene` answers."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes
from experiments.drawing.style import BLACK, BLUE, GREEN, ORANGE, TIMES
from experiments.drawing.values import say_number
from experiments.harness.method import Method
from experiments.methods.naming import say_kind
from experiments.methods.peers.open3d_scene import OPEN3D
from experiments.methods.peers.questions import Question
from experiments.methods.peers.trimesh_ray import TRIMESH
from experiments.results.settings import settings_that_vary
from experiments.workloads.panels import bars_height, make_panels, panels_figure, workload_figure
from experiments.workloads.rays import RAYS, Batch
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import narrow_table, plain, varying_words

_ASKED = ("question", "ray_batch")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "questions of rays: the method, atra.RayScene and its stand-in, and hits lost and extra of those judged"
    headings = ("this", "atra", "gain", "stand-in", "judged", "lost,\nextra", "atra")
    table = narrow_table(title, "scene, question, method", headings)
    varying = settings_that_vary(rows, _ASKED)
    for _, row in rows.iterrows():
        table.add_row(
            plain(row["scene"], _say_question(row), say_kind(row), *varying_words(row, varying)),
            say_ms(row["answer_time_s"]),
            say_ms(row["answer_library_time_s"]),
            *("" if pd.isna(row[name]) else f"{row[name]:.2f}x" for name in ("answer_gain", "stand_in_gain")),
            f"{row['judged_hits']:,}",
            *(f"{row[f'{prefix}lost']}, {row[f'{prefix}extra']}" for prefix in ("", "library_")),
        )
    yield table


_COLOURS = {Batch.coherent.value: BLUE, Batch.parallel.value: GREEN, Batch.incoherent.value: ORANGE}


def _say_question(row: pd.Series) -> str:
    asked = row["question"]
    return "contains, points" if asked == Question.contains.value else f"{asked}, {row['ray_batch']}"


def draw(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: the method's time over ours, a bar for each question and kind of rays."""
    panels = make_panels(rows, _ASKED)
    rows = rows.assign(width=pd.NA, height=pd.NA)  # no image is shown
    foot = "right of a label: our time, the gain, and hits lost by the other and by us of those judged"
    return panels_figure(panels, _draw_gains, columns, rows, foot, height=bars_height(panels, len))


def _draw_gains(axis: Axes, rows: pd.DataFrame) -> None:
    questions = {one.value: place for place, one in enumerate(Question)}
    batches = {one.value: place for place, one in enumerate(Batch)}
    places = rows["question"].map(questions) * len(batches) + rows["ray_batch"].map(batches)
    bars = []
    for _, row in rows.assign(_place=places).sort_values("_place", kind="stable").iterrows():
        value, low, high = (
            float(pd.to_numeric(row[f"answer_gain{end}"], errors="coerce")) for end in ("", "_low", "_high")
        )
        text = f"{say_number(1e3 * float(row['answer_library_time_s']))} ms, {value:.2g}{TIMES}"
        text += f", lost {row['lost']} and {row['library_lost']} of {row['judged_hits']:,}"
        bars.append(Bar(_say_question(row), value, low, high, _COLOURS[row["ray_batch"]], text))
    draw_bars(axis, bars)
    axis.axvline(1.0, color=BLACK, linewidth=1.0, zorder=1)
    finish_bar_axes(axis, bars, "its time / atra.RayScene's", 1.0)


def _of(rows: pd.DataFrame, method: Method) -> pd.DataFrame:
    return rows[rows["method"].eq(method.name) & rows["answer_gain"].notna()] if "answer_gain" in rows else rows[:0]


FIGURES = tuple(
    workload_figure(
        f"rays_{peer.name}", f"Questions of rays: {peer.label} beside atra.RayScene", RAYS, draw,
        partial(_of, method=peer),
    )
    for peer in (TRIMESH, OPEN3D)
)  # fmt: skip
"""One for each library that is asked."""
