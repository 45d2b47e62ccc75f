"""Figures as pages of panels: titles, legend, notes and foot."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments.drawing.style import GREY
from experiments.drawing.values import TIMES, column, varies


def stand_in_note(stands_for: str | None) -> str:
    """What must stand at every picture and panel of a stand-in; "" for any other scene."""
    return f"stand-in for {stands_for}, not that scene" if stands_for else ""


def make_figure(panel_count: int, columns: int | None = None, panel_height: float = 4.1) -> tuple[Figure, list[Axes]]:
    """An empty figure for files only, and its panels; two columns unless told otherwise or there is only one panel."""
    columns = columns or (1 if panel_count <= 1 else 2)
    rows = max(1, -(-panel_count // columns))
    figure = Figure(figsize=(7.2 if columns == 1 else 11.5, panel_height * rows + 1.1), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axis in axes[panel_count:]:
        axis.set_visible(False)
    if panel_count == 0:
        figure.text(0.5, 0.5, "no points", ha="center", va="center", color=GREY)
    return figure, axes[:panel_count]


def set_panel_title(axis: Axes, title: str, stands_for: str | None) -> None:
    """The title, and below it, smaller, whose stand-in the scene is."""
    note = stand_in_note(stands_for)
    axis.set_title(title, fontsize=11, loc="left", pad=18 if note else 6)
    if note:
        axis.annotate(
            note, (0, 1), xytext=(0, 4), xycoords="axes fraction", textcoords="offset points", ha="left", va="bottom",
            fontsize=8.5, color=GREY,
        )  # fmt: skip


def add_legend(figure: Figure, axes: Sequence[Axes], order: Sequence[str]) -> None:
    """One legend above all panels, of the labels that occur, in this order."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    labels = [label for label in order if label in handles]
    if not labels:
        figure.suptitle("", fontsize=12)
        return
    wide = figure.get_figwidth() > 8
    per_row = (len(labels) if len(labels) <= 5 else -(-len(labels) // 2)) if wide else 2
    shown = [handles[label] for label in labels]
    figure.legend(shown, labels, loc="outside upper center", ncols=per_row, frameon=False)


def write_below(axis: Axes, text: str, drop: float, start: float = 0.0, **style: Any) -> None:
    """Text whose top is `drop` points under the lower edge of a panel, from `start`, a fraction of its width."""
    axis.annotate(
        text, (start, 0), xytext=(0, -drop), xycoords="axes fraction", textcoords="offset points", ha="left", va="top",
        **style,
    )  # fmt: skip


def write_table(axis: Axes, lines: Sequence[tuple[str, Sequence[str]]], starts: Sequence[float], line_points: float,
                font_points: float) -> None:  # fmt: skip
    """Lines of cells below a panel, each line in its colour; starts: of the columns, fractions of its width."""
    for place, (color, cells) in enumerate(lines):
        for start, text in zip(starts, cells, strict=True):
            write_below(axis, text, 36 + line_points * place, start, fontsize=font_points, color=color)


def write_notes(axis: Axes, notes: Sequence[str], drop: float = 36) -> None:
    """Lines below a panel, from `drop` points under its lower edge, folded to its width."""
    if notes:
        # A line wider than its panel would make the layout shrink all of them.
        text = "\n".join(fill(note, 80, subsequent_indent="   ") for note in notes)
        write_below(axis, text, drop, fontsize=7.5, color=GREY)


def write_foot(figure: Figure, rows: pd.DataFrame, *lines: str, mark: str = "") -> None:
    """`describe_measurement` below all panels, and lines of the figure's own under it."""
    text = "\n".join(filter(None, [describe_measurement(rows, mark), *lines]))
    figure.supxlabel(text, fontsize=8, color=GREY)


def describe_measurement(table: pd.DataFrame, mark: str = "") -> str:
    """Two lines for the foot of a figure: what is common to its points, the machine, the day, the doubts.

    mark: what the figure sets apart, in words. Whatever the table does not tell is left out.
    """
    measured = table[table["status"] == "ok"]
    size = _common(measured, ("width", "height"), f"{{}} {TIMES} {{}} pixels")
    threads = _common(measured, ("threads",), "threads {}")
    packets = _common(measured, ("packet_width",), "packet width {}")
    widths = sorted({int(width) for width in column(measured, "packets_width").dropna()})
    fastest = f"fastest packets per pixel: of {' or '.join(map(str, widths))}" if widths else ""
    counts = column(measured, "rounds").dropna()
    rounds = ""
    if len(counts):
        fewest, most = int(counts.min()), int(counts.max())
        rounds = f"median and quartiles of {fewest if fewest == most else f'{fewest} to {most}'} rounds"
    cpus = " / ".join(sorted(str(cpu) for cpu in column(measured, "cpu").dropna().unique()))
    days = sorted({str(moment)[:10] for moment in column(measured, "measured_at").dropna()})
    date = " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""
    doubtful = int(column(measured, "doubts").notna().sum())
    doubts = f"{doubtful} of {len(measured)} points carry doubts (see table)" if doubtful else ""
    first = ", ".join(filter(None, [size, threads, packets, fastest, rounds]))
    second = ", ".join(filter(None, [cpus, date, mark, doubts]))
    return "\n".join(filter(None, [first, second]))


def _common(table: pd.DataFrame, names: Sequence[str], form: str) -> str:
    """`form` with the values of `names`, or "" if one of them varies or is missing."""
    if len(table) == 0 or any(column(table, name).isna().any() or varies(table, name) for name in names):
        return ""
    return form.format(*(table[name].iloc[0] for name in names))
