"""Relative error of a picture over the seconds it takes, a panel for each scene."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from experiments.drawing.axes import tidy_axis
from experiments.drawing.style import BLACK, BLUE, DASHED, GREY, ORANGE, SKY, SMALL
from experiments.light.equal_error.measure import BEFORE, ERRORS, FAST, OURS, SIZES

_LOOKS = {
    OURS: (ORANGE, "-", "o"),
    FAST: (ORANGE, DASHED, "D"),
    BEFORE: (GREY, DASHED, "s"),
    "scalar_rgb": (SKY, "-", "^"),
    "llvm_ad_rgb": (BLUE, "-", "v"),
}
_NAMES = {"scalar_rgb": "Mitsuba 3, scalar", "llvm_ad_rgb": "Mitsuba 3, LLVM"}
_COLUMNS = 4


def draw_errors(table: pd.DataFrame, path: Path) -> None:
    """Write a PNG: for the fewest threads of the table, what was measured of each renderer, and the line on which half
    the error takes four times as long, until the smallest error that is asked for."""
    shown = table[table["threads"] == table["threads"].min()]
    scenes = list(dict.fromkeys(shown["scene"]))
    lines = -(-len(scenes) // _COLUMNS)
    figure, axes = plt.subplots(lines, _COLUMNS, figsize=(15.0, 3.6 * lines + 0.5), squeeze=False, layout="constrained")
    for axis in axes.flat[len(scenes) :]:
        axis.set_axis_off()
    for axis, scene in zip(axes.flat, scenes, strict=False):
        for row in shown[shown["scene"] == scene].to_dict("records"):
            color, dashes, marker = _LOOKS[row["renderer"]]
            seconds, errors = (
                [row[f"{what}_of_{size}{unit}"] for size in SIZES] for what, unit in (("time", "_s"), ("error", ""))
            )
            until = np.geomspace(errors[-1], min(errors[-1], ERRORS[-1]), 2)
            axis.plot(seconds[-1] * (errors[-1] / until) ** 2, until, color=color, linestyle=dashes, linewidth=1.2)
            label = _NAMES.get(row["renderer"], row["renderer"])
            axis.plot(seconds, errors, color=color, marker=marker, linestyle="none", label=label)
        for error in ERRORS:
            axis.axhline(error, color=BLACK, linewidth=0.6)
        axis.set(xscale="log", yscale="log")
        axis.set_title(scene, fontsize=SMALL, color=GREY)
        axis.set_xlabel("seconds", fontsize=SMALL)
        axis.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        tidy_axis(axis, "both")
    axes[0, 0].set_ylabel("relative error", fontsize=SMALL)
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=4, fontsize=SMALL, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)
