"""Companion of figure 7: memory and speed-up of instances against copies, as §4.4 of the paper suggests."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_baseline, draw_series, finish_split_axes
from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.missing import Missing, mark_missing, without_value
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot
from experiments.drawing.style import BLACK, DOTTED
from experiments.drawing.values import numbers
from experiments.methods.naming import FORM_OPTIONS, FORM_STYLES, INSTANCED, aligned_forms, aligned_rows
from experiments.results.settings import say_setting
from experiments.results.table import workload_rows
from experiments.workloads.frame import FRAME
from experiments.workloads.frame_figures import RATIO_LABELS, draw_ratios
from experiments.workloads.memory import MEMORY
from experiments.workloads.memory.shown import baseline_rows, memory_mib
from experiments.workloads.panels import Panel, make_panels

_BASELINE_STYLE = {"color": BLACK, "linestyle": DOTTED}
_MEMORY_BASELINE = "one ray per pixel (memory)"


def draw_instancing_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """Two panels a scene over horizontal splits, all axes logarithmic: Embree's bytes, ratios within rounds.

    table: rows of both workloads. Copies are timed at the packet widths at which instances were timed
    (at all widths if none were); another width or value of any other setting makes another pair of panels.
    """
    table = workload_rows(table, MEMORY.name, FRAME.name)
    memory, time = (table[table["workload"] == workload.name] for workload in (MEMORY, FRAME))
    time = _at_widths_of_instances(aligned_rows(time))
    pairs = _pairs(pd.concat([time, aligned_rows(memory)]))
    figure, axes = make_figure(2 * len(pairs), columns, panel_height=4.1)
    for (title, panel), left, right in zip(pairs, axes[::2], axes[1::2], strict=True):
        of_memory = panel.rows["workload"] == MEMORY.name
        for axis, what in ((left, "memory"), (right, "speed-up")):
            set_panel_title(axis, f"{title}: {what}", panel.stands_for)
        _draw_memory(left, panel.rows[of_memory], baseline_rows(memory, panel.rows))
        draw_ratios(right, panel.rows[~of_memory], "split_x")
    add_legend(figure, axes, [*RATIO_LABELS, _MEMORY_BASELINE])
    write_foot(figure, pd.concat([time, memory]), "memory: Embree's own account, each point one process")
    return figure


def _at_widths_of_instances(time: pd.DataFrame) -> pd.DataFrame:
    widths = aligned_forms(time).get(INSTANCED, time[:0])["packet_width"].dropna().unique()
    return time[time["packet_width"].isin(widths)] if len(widths) else time


def _pairs(rows: pd.DataFrame) -> list[tuple[str, Panel]]:
    """Title and rows of each pair of panels; memory rows stand beside the times of every packet width."""
    pairs = []
    for panel in make_panels(rows, (*FORM_OPTIONS, "split_x", "packet_width")):
        of_memory = panel.rows["workload"] == MEMORY.name
        time, memory = panel.rows[~of_memory], panel.rows[of_memory]
        widths = sorted(time["packet_width"].dropna().unique()) or [None]
        for width in widths:
            of_width = time if width is None else time[time["packet_width"] == width]
            same = memory[memory["packet_width"] == width] if width is not None else memory
            chosen = pd.concat([of_width, same if len(same) else memory])
            title = panel.title if len(widths) == 1 else f"{panel.title}, {say_setting('packet_width', width)}"
            pairs.append((title, Panel(panel.scene, panel.details, chosen)))
    return pairs


def _draw_memory(axis: Axes, rows: pd.DataFrame, baseline: pd.DataFrame) -> None:
    missing: list[Missing] = []
    for form, points in aligned_forms(rows).items():
        style = FORM_STYLES[form]
        value_mib = memory_mib(points, "embree_bytes")
        draw_series(axis, numbers(points, "split_x"), value_mib, style, label=form)
        missing += without_value(points, value_mib, "split_x", form.removeprefix("aligned, "), style["color"])
    baseline_mib = memory_mib(baseline, "embree_bytes")
    draw_baseline(axis, baseline_mib, _BASELINE_STYLE, _MEMORY_BASELINE)
    mark_missing(axis, missing)
    finish_split_axes(axis, rows["split_x"], "split_x", "memory in MiB")


def _instances(table: pd.DataFrame) -> pd.DataFrame:
    memory = workload_rows(table, MEMORY.name)
    return workload_rows(table, MEMORY.name, FRAME.name) if INSTANCED in aligned_forms(memory) else table[:0]


FIGURES = (
    FigureKind(
        "figure7_instancing", "Beside figure 7: instances instead of copies, in memory and in speed", _instances,
        of_table(draw_instancing_figure),
    ),
)  # fmt: skip
