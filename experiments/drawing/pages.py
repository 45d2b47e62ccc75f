"""Figures as pages of panels: titles, legend, notes and foot."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill, wrap
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments.drawing.style import BLACK, GREY, PANEL_INCHES, SMALL, TIMES
from experiments.drawing.values import column, varies


def stand_in_note(stands_for: str | None) -> str:
    """What must stand at every picture and panel of a stand-in; "" for any other scene."""
    return f"stand-in for {stands_for}, not that scene" if stands_for else ""


_CHARACTERS_PER_INCH = 13.5
"""Characters of small text that fit an inch."""

_FOOT_SHARE = 0.35
"""Share of a figure's height that its foot may take before the figure grows."""

_LINE_HEIGHT = 1.2
"""Distance of lines of text over their size."""

_BELOW, _LINE = 36.0, 11.5
"""Points from the lower edge of a panel to what is written below its axis, and from line to line there."""


def make_figure(panel_count: int, columns: int, panel_height: float = 4.1) -> tuple[Figure, list[Axes]]:
    """An empty figure for files only, and its panels, in no more columns than there are panels."""
    columns = max(1, min(columns, panel_count))
    rows = max(1, -(-panel_count // columns))
    figure = Figure(figsize=(PANEL_INCHES * columns, panel_height * rows + 1.4), layout="constrained")
    # What stands below a panel would touch the next one's title.
    figure.set_layout_engine("constrained", h_pad=0.12)
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
    axis.set_title(fill(title, 48), fontsize=11, loc="left", pad=18 if note else 6)
    if note:
        axis.annotate(
            note, (0, 1), xytext=(0, 4), xycoords="axes fraction", textcoords="offset points", ha="left", va="bottom",
            fontsize=SMALL, color=GREY,
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
    room = figure.get_figwidth() * _CHARACTERS_PER_INCH / (max(map(len, labels)) + 8)
    rows = -(-len(labels) // max(1, int(room)))
    shown = [handles[label] for label in labels]
    columns = -(-len(labels) // rows)
    figure.legend(shown, labels, loc="outside upper center", ncols=columns, frameon=False, fontsize=SMALL)


def write_lines(axis: Axes, lines: Sequence[tuple[str, Sequence[str]]], above: int = 0) -> int:
    """Lines of cells below a panel, each in its colour, the cells evenly over its width; returns how many there are.

    above: lines that were written there before.
    """
    for place, (color, cells) in enumerate(lines, above):
        for cell, text in enumerate(cells):
            axis.annotate(
                text, (cell / len(cells), 0), xytext=(0, -_BELOW - _LINE * place), xycoords="axes fraction",
                textcoords="offset points", ha="left", va="top", fontsize=SMALL, color=color,
            )  # fmt: skip
    return above + len(lines)


def write_table(axis: Axes, headings: Sequence[str], entries: Sequence[tuple[str, str, Sequence[str]]]) -> int:
    """A small table below a panel: of each entry its name and, beneath it, its cells, in its colour. Returns its
    lines."""
    if not entries:
        return 0
    lines = [line for color, name, cells in entries for line in ((color, [name]), (color, cells))]
    return write_lines(axis, [(BLACK, headings), *lines])


def write_notes(axis: Axes, notes: Sequence[str], above: int = 0, characters: int = 62) -> None:
    """Lines below a panel, folded to its width. above: lines that were written there before. characters: that fit
    below it, fewer where a colour bar stands beside."""
    # A line wider than its panel would make the layout shrink all of them.
    folded = [line for note in notes for line in wrap(note, characters, subsequent_indent="   ")]
    write_lines(axis, [(GREY, [line]) for line in folded], above)


def write_foot(figure: Figure, rows: pd.DataFrame, *lines: str, mark: str = "") -> None:
    """`describe_measurement` below all panels, and lines of the figure's own under it. Where these are many, the figure
    grows by what they take, so that the panels keep their height."""
    width = int(figure.get_figwidth() * _CHARACTERS_PER_INCH)
    said = filter(None, [*describe_measurement(rows, mark).splitlines(), *lines])
    text = "\n".join(fill(line, width) for line in said)
    figure.supxlabel(text, fontsize=SMALL, color=GREY)
    inches = (text.count("\n") + 1) * SMALL * _LINE_HEIGHT / 72
    figure.set_figheight(figure.get_figheight() + max(0.0, inches - _FOOT_SHARE * figure.get_figheight()))


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
    repeats = ", ".join(filter(None, [_say_repeats(measured), _say_left_out(table)]))
    cpus = " / ".join(sorted(str(cpu) for cpu in column(measured, "cpu").dropna().unique()))
    days = sorted({str(moment)[:10] for moment in column(measured, "measured_at").dropna()})
    date = " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""
    doubtful = int(column(measured, "doubts").notna().sum())
    doubts = f"{doubtful} of {len(measured)} points carry doubts (see table)" if doubtful else ""
    first = ", ".join(filter(None, [size, threads, packets, fastest, repeats]))
    held = " and ".join(sorted(set(column(measured, "instruction_set").dropna()) - {"none"}))
    machine = [cpus, f"held to {held}" if held else "", date]
    second = ", ".join(filter(None, [*machine, _say_setting(measured), mark, doubts]))
    return "\n".join(filter(None, [first, second]))


def _say_setting(measured: pd.DataFrame) -> str:
    """Which setting of Embree's own methods were measured in; baselines have the fast one, as have older tables."""
    given = set(column(measured, "robust").dropna().astype(bool))
    words = [word for word, value in (("fast", False), ("robust", True)) if value in given]
    return f"Embree {' and '.join(words)}" if words else ""


def _say_repeats(measured: pd.DataFrame) -> str:
    """What a value stands for, and its bars; "" where nothing was timed."""
    rounds, processes = (_range(column(measured, name)) for name in ("rounds", "processes"))
    if not rounds:
        return ""
    ends = [name for name in measured if name.endswith(("_low", "_low_s"))]
    has_bars = any(measured[name].notna().any() for name in ends)
    bars = "bars: 95 % confidence intervals over processes" if has_bars else "no intervals"
    of_processes = (
        f"geometric mean of {processes} {'process' if processes == '1' else 'processes'}" if processes else "processes"
    )
    return f"{of_processes}, of each the median of {rounds} rounds; {bars}"


def _range(counts: pd.Series) -> str:
    """ "3", "3 to 5", "" where nothing is counted."""
    found = sorted({int(count) for count in counts.dropna()})
    return " to ".join(str(count) for count in dict.fromkeys([found[0], found[-1]])) if found else ""


def _say_left_out(table: pd.DataFrame) -> str:
    count = int(column(table, "processes_left_out").fillna(0).sum())
    return f"{count} {'process' if count == 1 else 'processes'} left out as unsteady" if count else ""


def _common(table: pd.DataFrame, names: Sequence[str], form: str) -> str:
    """`form` with the values of `names`, or "" if one of them varies or is missing."""
    if len(table) == 0 or any(column(table, name).isna().any() or varies(table, name) for name in names):
        return ""
    return form.format(*(table[name].iloc[0] for name in names))
