"""What is shown of batches of rays: lines, and steps over those from the root, against one setting at a time."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from experiments.classification.workload import CLASSIFICATION
from experiments.classification.workload.claims import CLAIMS as CLAIMS
from experiments.classification.workload.claims import usual
from experiments.drawing.style import BLUE, DASHED, DOTTED, GREY, ORANGE, VERMILLION
from experiments.drawing.values import numbers, say_number
from experiments.methods.naming import best_of, say_kind
from experiments.results.settings import settings_that_vary
from experiments.workloads.panels import make_panels, panels_figure, workload_figure
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import narrow_table, plain, varying_words

CLAIMS_FILE = "classification_claims"

_NUMBERS = {
    "steps_ratio": "steps /\nfrom root",
    "speedup_vs_bvh": "from\nroot",
    "speedup": "single\nrays",
    "speedup_vs_packets": "packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "steps, and speed-up over the same rays from the root, and over single rays and packets of Embree"
    table = narrow_table(title, "scene, rays, method", ("batch", *_NUMBERS.values()))
    varying = settings_that_vary(rows, (*best_of(), "packet_width", "ray_kind"))
    for _, row in rows.iterrows():
        name = plain(row["scene"], row["ray_kind"], say_kind(row), *varying_words(row, varying))
        numbers = ("" if pd.isna(row[column]) else say_number(row[column]) for column in _NUMBERS)
        table.add_row(name, say_ms(row["render_time_s"]), *numbers)
    yield table


_STYLES = {
    "primary": (BLUE, "o", "solid"),
    "occlusion": (ORANGE, "s", DASHED),
    "diffuse": (VERMILLION, "^", DOTTED),
}
"""Colour, marker and dash of each kind of rays."""

_SETTINGS = {"shaft_probability": "probability from which a node is opened", "shafts": "shafts"}
_OPTIONS = {"shaft_probability": ("shaft_probability",), "shafts": ("shaft_cells", "shaft_directions")}


def _over(rows: pd.DataFrame, setting: str) -> pd.DataFrame:
    """The rows with default options but for those that make the setting, if it has three values or more."""
    changes = dict.fromkeys(_OPTIONS[setting], any)
    rows = usual(rows, **changes)
    return rows[:0] if rows.empty or rows[setting].nunique() < 3 else rows


def draw(rows: pd.DataFrame, columns: int, setting: str) -> Figure:
    """A panel a scene: steps over those from the root, a line for each kind of rays, and of each number of
    directions."""
    panels = make_panels(rows, ("ray_kind", *_OPTIONS[setting]))
    draw_panel = partial(_draw_panel, setting=setting)
    return panels_figure(panels, draw_panel, columns, rows, "1: as many steps as from the root", legend=list(_STYLES))


def _draw_panel(axis: Axes, rows: pd.DataFrame, setting: str) -> None:
    for kind, (color, marker, dash) in _STYLES.items():
        of_kind = rows[rows["ray_kind"].eq(kind)]
        if of_kind.empty:
            continue
        lines = of_kind.groupby("shaft_directions") if setting == "shafts" else [("", of_kind)]
        for place, (_, line) in enumerate(lines):
            x, y = numbers(line, setting), numbers(line, "steps_ratio")
            order = np.argsort(x)
            label = kind if place == 0 else "_nolegend_"
            axis.plot(x[order], y[order], color=color, marker=marker, linestyle=dash, label=label)
    axis.axhline(1.0, color=GREY, linewidth=1)
    axis.set_xlabel(_SETTINGS[setting])
    axis.set_ylabel("steps / those from the root")
    axis.set_ylim(bottom=0)
    if setting == "shafts":
        axis.set_xscale("log")


FIGURES = tuple(
    workload_figure(
        f"classification_{name}", f"Steps of classified rays over {caption}", CLASSIFICATION,
        partial(draw, setting=setting), partial(_over, setting=setting),
    )
    for name, caption, setting in (
        ("probability", "the probability from which nodes are opened", "shaft_probability"),
        ("shafts", "the number of shafts; a line for each number of directions", "shafts"),
    )
)  # fmt: skip
