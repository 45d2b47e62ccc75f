"""What is shown of batches of rays: lines, and steps over those from the root, against one setting at a time."""

from __future__ import annotations

from functools import partial
from typing import Any

import pandas as pd

from experiments.classification.workload import CLASSIFICATION
from experiments.classification.workload.claims import CLAIMS as CLAIMS
from experiments.classification.workload.claims import usual
from experiments.drawing.figure import Axis, Figure, Line, Panel
from experiments.drawing.style import BLUE, DASHED, DOTTED, ORANGE, VERMILLION
from experiments.drawing.values import numbers
from experiments.workloads.panels import ONE, figure_of, make_panels, read_panels, workload_figure

CLAIMS_FILE = "classification_claims"

_STYLES: dict[str, dict[str, Any]] = {
    "primary": {"color": BLUE, "marker": "o"},
    "occlusion": {"color": ORANGE, "marker": "s", "linestyle": DASHED},
    "diffuse": {"color": VERMILLION, "marker": "^", "linestyle": DOTTED},
}
"""Line style of each kind of rays."""

_SETTINGS = {
    "shaft_probability": Axis("probability from which a node is opened", "linear"), "shafts": Axis("shafts"),
}  # fmt: skip
_OPTIONS = {"shaft_probability": ("shaft_probability",), "shafts": ("shaft_cells", "shaft_directions")}


def _over(rows: pd.DataFrame, setting: str) -> pd.DataFrame:
    """The rows with default options but for those that make the setting, if it has three values or more."""
    changes = dict.fromkeys(_OPTIONS[setting], any)
    rows = usual(rows, **changes)
    return rows[:0] if rows.empty or rows[setting].nunique() < 3 else rows


def figure(rows: pd.DataFrame, setting: str) -> Figure:
    """A panel a scene: steps over those from the root, a line for each kind of rays, and of each number of
    directions."""
    panels = make_panels(rows, ("ray_kind", *_OPTIONS[setting]))
    return figure_of(
        "lines", read_panels(panels, partial(_panel, setting=setting)), rows, "1: as many steps as from the root",
        x=_SETTINGS[setting], y=Axis("steps / those from the root", "linear"), legend=list(_STYLES),
    )  # fmt: skip


def _panel(rows: pd.DataFrame, setting: str) -> Panel:
    shown = []
    for kind, style in _STYLES.items():
        of_kind = rows[rows["ray_kind"].eq(kind)]
        lines = of_kind.groupby("shaft_directions") if setting == "shafts" else [("", of_kind)]
        shown += [
            Line(kind, numbers(rows_of_line, setting), numbers(rows_of_line, "steps_ratio"), style)
            for _, rows_of_line in lines
            if len(rows_of_line)
        ]
    return Panel(lines=shown, levels=[ONE])


FIGURES = tuple(
    workload_figure(
        f"classification_{name}", f"Steps of classified rays over {caption}", CLASSIFICATION,
        partial(figure, setting=setting), partial(_over, setting=setting),
    )
    for name, caption, setting in (
        ("probability", "the probability from which nodes are opened", "shaft_probability"),
        ("shafts", "the number of shafts; a line for each number of directions", "shafts"),
    )
)  # fmt: skip
