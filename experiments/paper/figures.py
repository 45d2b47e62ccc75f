"""Companion of figure 7: memory and speed-up of instances against copies, as §4.4 of the paper suggests."""

from __future__ import annotations

import pandas as pd

from experiments.drawing.figure import Axis, Figure, FigureKind, Line, Panel, median_level, of_table
from experiments.drawing.missing import Missing, without_value
from experiments.drawing.style import BLACK, DOTTED
from experiments.drawing.values import numbers
from experiments.methods.naming import FORM_OPTIONS, FORM_STYLES, INSTANCED, aligned_forms, aligned_rows
from experiments.results.settings import say_setting
from experiments.results.table import workload_rows
from experiments.workloads.frame import FRAME
from experiments.workloads.frame_figures import RATIO_LABELS, SPLIT_AXES, splits_panel
from experiments.workloads.memory import MEMORY
from experiments.workloads.memory.shown import baseline_rows, memory_mib
from experiments.workloads.panels import PanelRows, figure_of, make_panels

_BASELINE_STYLE = {"color": BLACK, "linestyle": DOTTED}
_MEMORY_BASELINE = "one ray per pixel (memory)"


def instancing_figure(table: pd.DataFrame) -> Figure:
    """Two panels a scene over horizontal splits, all axes logarithmic: Embree's bytes, ratios within rounds.

    table: rows of both workloads. Copies are timed at the packet widths at which instances were timed
    (at all widths if none were); another width or value of any other setting makes another pair of panels.
    """
    table = workload_rows(table, MEMORY.name, FRAME.name)
    memory, time = (table[table["workload"] == workload.name] for workload in (MEMORY, FRAME))
    time = _at_widths_of_instances(aligned_rows(time))
    panels = []
    for pair in _pairs(pd.concat([time, aligned_rows(memory)])):
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


def _at_widths_of_instances(time: pd.DataFrame) -> pd.DataFrame:
    widths = aligned_forms(time).get(INSTANCED, time[:0])["packet_width"].dropna().unique()
    return time[time["packet_width"].isin(widths)] if len(widths) else time


def _pairs(rows: pd.DataFrame) -> list[PanelRows]:
    """Rows of each pair of panels; memory rows stand beside the times of every packet width."""
    pairs = []
    for panel in make_panels(rows, (*FORM_OPTIONS, "split_x", "packet_width")):
        of_memory = panel.rows["workload"] == MEMORY.name
        time, memory = panel.rows[~of_memory], panel.rows[of_memory]
        widths = sorted(time["packet_width"].dropna().unique()) or [None]
        for width in widths:
            of_width = time if width is None else time[time["packet_width"] == width]
            same = memory[memory["packet_width"] == width] if width is not None else memory
            words = [panel.details, *([] if len(widths) == 1 else [say_setting("packet_width", width)])]
            chosen = pd.concat([of_width, same if len(same) else memory])
            pairs.append(PanelRows(panel.scene, ", ".join(filter(None, words)), chosen))
    return pairs


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
