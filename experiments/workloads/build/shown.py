"""Figure 6 of the paper: what a view costs once, planning and building the BVH, over horizontal splits."""

from __future__ import annotations

from typing import Any

import pandas as pd

from experiments.drawing.figure import Axis, Figure, Line, Panel, median_level
from experiments.drawing.missing import Missing, missing_points, undrawable_points
from experiments.drawing.style import BLACK, BLUE, DASHED, GREEN, PURPLE, VERMILLION
from experiments.drawing.values import MILLISECONDS, interval, numbers
from experiments.methods.naming import (
    COPIED_OFF,
    COPIED_ON,
    FORM_OPTIONS,
    INSTANCED,
    aligned_forms,
    aligned_rows,
)
from experiments.workloads.build import BUILD
from experiments.workloads.frame_figures import SPLIT_AXES
from experiments.workloads.panels import figure_of, make_panels, read_panels, workload_figure

# Label -> form of the geometry, columns, line. The paper's own form, culling on, comes first.
_SERIES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "BVH build, culling on": (COPIED_ON, "build_time{}_s", {"color": BLUE, "marker": "o"}),
    "plan (culling and shear), culling on": (COPIED_ON, "plan_time{}_s", {"color": GREEN, "marker": "D"}),
    "BVH build, instanced": (INSTANCED, "build_time{}_s", {"color": PURPLE, "marker": "^"}),
    "BVH build, culling off": (COPIED_OFF, "build_time{}_s", {"color": VERMILLION, "marker": "s"}),
}
_BASELINE = "BVH build for per-pixel rays"


def build_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds over splits, both logarithmic.

    Points have bars over their intervals. The baseline is the build of the plain mesh, measured again with every point:
    a line at the median, a band between the quartiles. Series that were not measured are left out.
    """
    panels = make_panels(aligned_rows(table), ("split_x", *FORM_OPTIONS))
    return figure_of(
        "lines", read_panels(panels, _panel), table, mark="paid once a view", x=SPLIT_AXES["split_x"],
        y=Axis("time in ms"), legend=[*_SERIES, _BASELINE],
    )  # fmt: skip


def _panel(rows: pd.DataFrame) -> Panel:
    forms, lines = aligned_forms(rows), []
    missing: list[Missing] = []
    marked: set[str] = set()
    for label, (form, stem, style) in _SERIES.items():
        if form not in forms:
            continue
        points = forms[form]
        time_ms, *ends = interval(points, stem, MILLISECONDS)
        lines.append(Line(label, numbers(points, "split_x"), time_ms, style, (ends[0], ends[1])))
        missing += undrawable_points(points, time_ms, "split_x", label, style["color"])
        # A form skipped once is said once, not for each of its series.
        if form not in marked:
            missing += missing_points(points, "split_x", form.removeprefix("aligned, "), style["color"])
            marked.add(form)
    baseline_ms = numbers(rows, "baseline_build_time_s") * MILLISECONDS
    levels = median_level(_BASELINE, baseline_ms, {"color": BLACK, "linestyle": DASHED})
    return Panel(lines=lines, levels=levels, crosses=missing)


FIGURES = (
    workload_figure("figure6", "Figure 6: plan and BVH build over horizontal splits, culling on", BUILD, build_figure),
)
