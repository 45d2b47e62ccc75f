"""Figure 7 of the paper: memory over horizontal splits, copied geometry with culling."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Figure, Line, Panel, median_level
from experiments.drawing.missing import Missing, missing_points, undrawable_points
from experiments.drawing.style import BLUE, DASHED, GREEN, ORANGE
from experiments.drawing.values import MEBIBYTES, column, numbers
from experiments.methods.naming import COPIED_ON, FORM_OPTIONS, aligned_forms, aligned_rows, best_of
from experiments.methods.pixel import PIXEL
from experiments.results.settings import settings
from experiments.workloads.frame_figures import SPLIT_AXES
from experiments.workloads.memory import MEMORY
from experiments.workloads.panels import figure_of, make_panels, read_panels, workload_figure

PAGE_NOISE_MIB = 1.0
"""Growth of RSS below which it is noise."""
_FROM = f" (from {PAGE_NOISE_MIB:.0f} MiB on)"
_BASELINE = "dashed: one ray per pixel"

# Label -> the column, and whether the process's size with only the mesh loaded is taken off it.
_SERIES: dict[str, tuple[str, bool, dict[str, Any]]] = {
    "Embree's own account": ("embree_bytes", False, {"color": BLUE, "marker": "o"}),
    f"RSS over the mesh, after the build{_FROM}": ("rss_bytes", True, {"color": GREEN, "marker": "D"}),
    f"peak of RSS over the mesh{_FROM}": ("peak_rss_bytes", True, {"color": ORANGE, "marker": "v"}),
}


def memory_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); MiB over splits, both logarithmic.

    Every point is one process. Beside Embree's own account stands how much the process has grown since the mesh was
    loaded, where that exceeds the noise of pages. Dashed lines are the same quantities of one ray per pixel. Only
    copies with culling are drawn.
    """
    panels = make_panels(aligned_rows(table), ("split_x", *FORM_OPTIONS))
    panels = [panel for panel in panels if COPIED_ON in aligned_forms(panel.rows)]
    return figure_of(
        "lines", read_panels(panels, partial(_panel, table)), table, "each point is one process",
        x=SPLIT_AXES["split_x"], y=Axis("memory in MiB"), legend=[*_SERIES, _BASELINE],
    )  # fmt: skip


def memory_mib(rows: pd.DataFrame, name: str, over_mesh: bool = False) -> NDArray[np.float64]:
    """(N,) float64 MiB of a column in bytes, less `rss_mesh_bytes` if `over_mesh`; NaN where missing."""
    value_bytes = numbers(rows, name)
    return (value_bytes - numbers(rows, "rss_mesh_bytes") if over_mesh else value_bytes) * MEBIBYTES


def baseline_rows(table: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """The measured rows of one ray per pixel of the same scene, image and build as the panel's `rows`."""
    chosen = table["method"].eq(PIXEL.name) & table["status"].eq("ok")
    decisive = ("scene", "mesh_sha256", "width", "height", "build_quality")
    for name in decisive:
        chosen &= column(table, name).isin(column(rows, name))
    # Memory hardly depends on the others: a baseline that was measured with one value serves the rest.
    for name in settings():
        if name not in (*decisive, *best_of()):
            same = chosen & column(table, name).isin(column(rows, name))
            chosen = same if same.any() else chosen
    return table[chosen]


def _panel(table: pd.DataFrame, rows: pd.DataFrame) -> Panel:
    points, baseline = aligned_forms(rows)[COPIED_ON], baseline_rows(table, rows)
    missing: list[Missing] = missing_points(points, "split_x", "culling on", BLUE)
    lines, levels = [], []
    for label, (name, over_mesh, style) in _SERIES.items():
        value_mib, baseline_mib = (memory_mib(some, name, over_mesh) for some in (points, baseline))
        shown = value_mib >= PAGE_NOISE_MIB if over_mesh else np.full(len(points), True)
        lines.append(Line(label, numbers(points[shown], "split_x"), value_mib[shown], style))
        missing += undrawable_points(points[shown], value_mib[shown], "split_x", label, style["color"])
        baseline_mib = baseline_mib[baseline_mib >= PAGE_NOISE_MIB] if over_mesh else baseline_mib
        # The first, of Embree's bytes, stands in the legend for the dashed lines of all colours.
        dashed = {"color": style["color"], "linestyle": DASHED}
        levels += median_level("_baseline" if over_mesh else _BASELINE, baseline_mib, dashed)
    return Panel(lines=lines, levels=levels, crosses=missing)


FIGURES = (workload_figure("figure7", "Figure 7: memory over horizontal splits, culling on", MEMORY, memory_figure),)
