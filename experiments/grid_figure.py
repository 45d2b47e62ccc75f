"""Figure 4 of the paper: render time over both axes' splits, one heat map a scene."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from experiments.split_figure import describe_measurement

_MILLISECONDS = 1e3


def draw_grid_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of culling, if both were measured): milliseconds in each cell, the best framed.

    A split without a time stays empty, marked with its status. Colours are per scene: compare within a panel.
    """
    keys = ["scene"] + [name for name in ("culling", "packet_width", "threads") if table[name].nunique() > 1]
    # A panel without any time would be empty; its points are in the table with their reasons.
    with_times = table.groupby(keys, sort=False, dropna=False).filter(lambda points: (points["status"] == "ok").any())
    panels = list(with_times.groupby(keys, sort=False, dropna=False))
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(max(6.6, 5.8 * columns), 4.9 * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, (key, points) in zip(axes, panels, strict=False):
        scene, *values = key if isinstance(key, tuple) else (key,)
        details = [f"{name} {value}" for name, value in zip(keys[1:], values, strict=True)]
        _draw_panel(figure, axis, ", ".join([f"{scene} ({points['triangles'].iloc[0]:,} triangles)", *details]), points)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    figure.supxlabel(describe_measurement(table, "shortest time framed"), fontsize=8, color="#555555")
    return figure


def _draw_panel(figure: Figure, axis: Axes, title: str, points: pd.DataFrame) -> None:
    splits_x = sorted(int(split) for split in points["split_x"].unique())
    splits_y = sorted(int(split) for split in points["split_y"].unique())
    time_ms = np.full((len(splits_y), len(splits_x)), np.nan)
    for _, point in points.iterrows():
        row, column = splits_y.index(int(point["split_y"])), splits_x.index(int(point["split_x"]))
        if point["status"] == "ok":
            time_ms[row, column] = float(point["render_time_s"]) * _MILLISECONDS
        else:
            axis.text(column, row, point["status"], ha="center", va="center", fontsize=7, color="#555555")
    low, high = np.nanmin(time_ms), np.nanmax(time_ms)
    picture = axis.imshow(time_ms, origin="lower", cmap="cividis_r", norm=LogNorm(low, max(high, low * 1.01)))
    middle = np.sqrt(low * high)
    for row, column in np.argwhere(np.isfinite(time_ms)):
        value = time_ms[row, column]
        color = "white" if value > middle else "black"
        axis.text(column, row, _short(value), ha="center", va="center", fontsize=9, color=color)
    best_row, best_column = np.unravel_index(np.nanargmin(time_ms), time_ms.shape)
    corner = (float(best_column) - 0.5, float(best_row) - 0.5)
    axis.add_patch(Rectangle(corner, 1, 1, fill=False, edgecolor="#D55E00", linewidth=2.5))
    axis.set_title(title, fontsize=11, loc="left")
    axis.set_xticks(range(len(splits_x)), [str(split) for split in splits_x])
    axis.set_yticks(range(len(splits_y)), [str(split) for split in splits_y])
    axis.set_xlabel("horizontal splits")
    axis.set_ylabel("vertical splits")
    ticks = np.geomspace(low, max(high, low * 1.01), 4)
    bar = figure.colorbar(picture, ax=axis, shrink=0.85, label="time per frame in ms")
    bar.set_ticks(ticks.tolist(), labels=[_short(tick) for tick in ticks])
    bar.minorticks_off()


def _short(time_ms: float) -> str:
    return f"{time_ms:.0f}" if time_ms >= 100 else f"{time_ms:.3g}"
