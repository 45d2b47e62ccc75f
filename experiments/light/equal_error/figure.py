"""Relative error of a picture over the seconds it takes, a panel for each scene."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.drawing.figure import Axis, Figure, Level, Line, Panel
from experiments.drawing.style import BLACK, BLUE, DASHED, GREY, ORANGE, SKY
from experiments.light.equal_error.measure import BEFORE, ERRORS, FAST, OURS, SIZES

_LOOKS = {
    OURS: (ORANGE, "-", "o"),
    FAST: (ORANGE, DASHED, "D"),
    BEFORE: (GREY, DASHED, "s"),
    "scalar_rgb": (SKY, "-", "^"),
    "llvm_ad_rgb": (BLUE, "-", "v"),
}
_NAMES = {"scalar_rgb": "Mitsuba 3, scalar", "llvm_ad_rgb": "Mitsuba 3, LLVM"}


def errors_figure(table: pd.DataFrame) -> Figure:
    """For the fewest threads of the table, what was measured of each renderer, and the line on which half the error
    takes four times as long, until the smallest error that is asked for."""
    shown = table[table["threads"] == table["threads"].min()]
    panels = [_panel(str(scene), rows) for scene, rows in shown.groupby("scene", sort=False)]
    legend = [_NAMES.get(name, name) for name in _LOOKS]
    errors = Axis("relative error", say="{:.3g} %".format)
    return Figure("lines", panels, Axis("seconds"), errors, legend=legend, columns=4)


def _panel(scene: str, rows: pd.DataFrame) -> Panel:
    lines = []
    for row in rows.to_dict("records"):
        color, dashes, marker = _LOOKS[row["renderer"]]
        seconds, errors = (
            np.array([row[f"{what}_of_{size}{unit}"] for size in SIZES], np.float64)
            for what, unit in (("time", "_s"), ("error", ""))
        )
        until = np.geomspace(errors[-1], min(errors[-1], ERRORS[-1]), 2)
        slope = {"color": color, "linestyle": dashes}
        lines.append(Line("_slope", seconds[-1] * (errors[-1] / until) ** 2, 100 * until, slope, thin=True))
        label, looks = _NAMES.get(row["renderer"], row["renderer"]), {"color": color, "marker": marker}
        lines.append(Line(label, seconds, 100 * errors, {**looks, "linestyle": "none"}))
    levels = [Level("_asked", 100 * error, {"color": BLACK, "linewidth": 0.6}) for error in ERRORS]
    return Panel(scene, lines=lines, levels=levels)
