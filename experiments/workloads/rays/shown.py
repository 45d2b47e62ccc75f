"""What is shown of questions of rays: a line a point."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.drawing.values import MILLISECONDS
from experiments.methods.naming import say_kind
from experiments.workloads.tables import cell, points_table

_ASKED = ("question", "ray_batch")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "questions of rays: the method, atra.RayScene, and hits lost and extra of those judged"
    yield points_table(title, rows, _COLUMNS, "scene, question, method", _words, _ASKED)


def _words(row: pd.Series) -> list[str]:
    return [_say_question(row), say_kind(row)]


_COLUMNS = {
    "this": cell("answer_time_s", "{:,.1f} ms", MILLISECONDS),
    "atra": cell("answer_library_time_s", "{:,.1f} ms", MILLISECONDS),
    "gain": cell("answer_gain"),
    "judged": cell("judged_hits", "{:,}"),
    "lost,\nextra": lambda row: f"{row['lost']}, {row['extra']}",
    "atra\n": lambda row: f"{row['library_lost']}, {row['library_extra']}",
}


def _say_question(row: pd.Series) -> str:
    asked = row["question"]
    return "contains, points" if asked == "contains" else f"{asked}, {row['ray_batch']}"
