"""Companion of figure 7: memory and speed-up of instances against copies, as §4.4 of the paper suggests."""

from __future__ import annotations

import pandas as pd

from experiments.drawing.figure import Axis, Figure, FigureKind, Line, Panel, median_level, of_table
from experiments.drawing.missing import Missing, without_value
from experiments.drawing.style import BLACK, DOTTED
from experiments.drawing.values import numbers
from experiments.methods.naming import FORM_OPTIONS, FORM_STYLES, INSTANCED, aligned_forms, aligned_rows
from experiments.results.table import workload_rows
from experiments.workloads.frame import FRAME
from experiments.workloads.frame_figures import RATIO_LABELS, SPLIT_AXES, splits_panel
from experiments.workloads.memory import MEMORY
from experiments.workloads.memory.shown import baseline_rows, memory_mib
from experiments.workloads.panels import figure_of, make_panels

_BASELINE_STYLE = {"color": BLACK, "linestyle": DOTTED}
_MEMORY_BASELINE = "one ray per pixel (memory)"


def instancing_figure(table: pd.DataFrame) -> Figure:
    """Two panels a scene over horizontal splits, all axes logarithmic: Embree's bytes, ratios within rounds.

    table: rows of both workloads. Copies are timed at the packet widths at which instances were timed
    (at all widths if none were); another width or value of any other setting makes another pair of panels.
    """
    table = workload_rows(table, MEMORY.name, FRAME.name)
    memory, time = (table[table["workload"] == workload.name] for workload in (MEMORY, FRAME))
    widths = aligned_forms(time).get(INSTANCED, time[:0])["packet_width"].dropna().unique()
    time = aligned_rows(time)[lambda rows: rows["packet_width"].isin(widths) | (len(widths) == 0)]
    rows, panels = pd.concat([time, _beside_times(aligned_rows(memory), time)]), []
    for pair in make_panels(rows, (*FORM_OPTIONS, "split_x")):
        of_memory = pair.rows["workload"] == MEMORY.name
        shown = _memory(pair.rows[of_memory], baseline_rows(memory, pair.rows))
        panels += [
            pair.panel(shown, ": memory"),
            pair.panel(splits_panel(pair.rows[~of_memory], "split_x", in_ratios=True), ": speed-up"),
        ]
    return figure_of(
        "lines", panels, pd.concat([time, memory]), "memory: Embree's own account, each point one process",
        x=SPLIT_AXES["split_x"], legend=[*RATIO_LABELS, _MEMORY_BASELINE],
    )  # fmt: skip


def _beside_times(memory: pd.DataFrame, time: pd.DataFrame) -> pd.DataFrame:
    """Rows of memory for each packet width that was timed: those of that width, or else all."""
    parts = [memory]
    if len(widths := time["packet_width"].dropna().unique()):
        chosen = [(width, memory[memory["packet_width"].eq(width)]) for width in widths]
        parts = [(same if len(same) else memory).assign(packet_width=width) for width, same in chosen]
    return pd.concat(parts)


def _memory(rows: pd.DataFrame, baseline: pd.DataFrame) -> Panel:
    missing: list[Missing] = []
    lines = []
    for form, points in aligned_forms(rows).items():
        value_mib, style = memory_mib(points, "embree_bytes"), FORM_STYLES[form]
        lines.append(Line(form, numbers(points, "split_x"), value_mib, style))
        missing += without_value(points, value_mib, "split_x", form.removeprefix("aligned, "), style["color"])
    levels = median_level(_MEMORY_BASELINE, memory_mib(baseline, "embree_bytes"), _BASELINE_STYLE)
    return Panel(lines=lines, levels=levels, crosses=missing, y=Axis("memory in MiB"))


def _instances(table: pd.DataFrame) -> pd.DataFrame:
    memory = workload_rows(table, MEMORY.name)
    return workload_rows(table, MEMORY.name, FRAME.name) if INSTANCED in aligned_forms(memory) else table[:0]


FIGURES = (
    FigureKind(
        "figure7_instancing", "Beside figure 7: instances instead of copies, in memory and in speed", _instances,
        of_table(instancing_figure),
    ),
)  # fmt: skip
