"""Bars of the time of each stage, beside what it would take with warm caches and learned branches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt

from experiments.drawing.axes import tidy_axis
from experiments.drawing.style import BLUE, GREY, ORANGE, SMALL


def draw_stages(rows: Sequence[dict[str, str]], path: Path) -> None:
    """Write a PNG: a row of panels for each instruction set, a panel for each scene. rows: of the table."""
    sets = list(dict.fromkeys(row["instruction_set"] for row in rows))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    size = 3.2 * len(scenes) + 1.6, 3.6 * len(sets) + 0.6
    figure, axes = plt.subplots(len(sets), len(scenes), figsize=size, squeeze=False, layout="constrained")
    for line, instruction_set in zip(axes, sets, strict=True):
        for axis, scene in zip(line, scenes, strict=True):
            shown = [row for row in rows if (row["scene"], row["instruction_set"]) == (scene, instruction_set)]
            for place, row in enumerate(shown):
                axis.barh(place, float(row["ms"]), height=0.75, color=ORANGE, label="measured")
                if row["hot_ms"]:
                    axis.barh(place, float(row["hot_ms"]), height=0.35, color=BLUE, label="caches warm")
            axis.set_yticks(
                range(len(shown)), [row["stage"] for row in shown] if axis is line[0] else [], fontsize=SMALL
            )
            axis.invert_yaxis()
            axis.set_title(f"{scene}, {instruction_set}", fontsize=SMALL, color=GREY)
            axis.set_xlabel("ms a frame", fontsize=SMALL)
            tidy_axis(axis, "x", frame=("bottom",))
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=2, fontsize=SMALL, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)
