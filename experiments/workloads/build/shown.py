"""Figure 6 of the paper: what a view costs once, planning and building the BVH, over horizontal splits."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_baseline, draw_series, finish_split_axes
from experiments.drawing.missing import Missing, mark_missing, missing_points, undrawable_points
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
from experiments.workloads.panels import make_panels, panels_figure, workload_figure

# Label -> form of the geometry, columns, line. The paper's own form, culling on, comes first.
_SERIES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "BVH build, culling on": (COPIED_ON, "build_time{}_s", {"color": BLUE, "marker": "o"}),
    "plan (culling and shear), culling on": (COPIED_ON, "plan_time{}_s", {"color": GREEN, "marker": "D"}),
    "BVH build, instanced": (INSTANCED, "build_time{}_s", {"color": PURPLE, "marker": "^"}),
    "BVH build, culling off": (COPIED_OFF, "build_time{}_s", {"color": VERMILLION, "marker": "s"}),
}
_BASELINE = "BVH build for per-pixel rays"


def draw_build_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds over splits, both logarithmic.

    Points have bars over their intervals. The baseline is the build of the plain mesh, measured again with every point:
    a line at the median, a band between the quartiles. Series that were not measured are left out.
    """
    panels = make_panels(aligned_rows(table), ("split_x", *FORM_OPTIONS))
    legend = [*_SERIES, _BASELINE]
    return panels_figure(panels, _draw_panel, columns, table, legend=legend, mark="paid once a view")


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    forms = aligned_forms(rows)
    missing: list[Missing] = []
    marked: set[str] = set()
    for label, (form, stem, style) in _SERIES.items():
        if form not in forms:
            continue
        points = forms[form]
        time_ms, *ends = interval(points, stem, MILLISECONDS)
        draw_series(axis, numbers(points, "split_x"), time_ms, style, ends, label)
        missing += undrawable_points(points, time_ms, "split_x", label, style["color"])
        # A form skipped once is said once, not for each of its series.
        if form not in marked:
            missing += missing_points(points, "split_x", form.removeprefix("aligned, "), style["color"])
            marked.add(form)
    baseline_ms = numbers(rows, "baseline_build_time_s") * MILLISECONDS
    draw_baseline(axis, baseline_ms, {"color": BLACK, "linestyle": DASHED}, _BASELINE)
    mark_missing(axis, missing)
    finish_split_axes(axis, rows["split_x"], "split_x", "time in ms")


FIGURES = (
    workload_figure(
        "figure6", "Figure 6: plan and BVH build over horizontal splits, culling on", BUILD, draw_build_figure
    ),
)
