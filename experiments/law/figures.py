"""Figures of the law: predicted over measured, where alignment pays, and figure 5 with predicted curves.

    python -m experiments.law.figures reports/reference/law docs/images

Figure 5 shows figure5.parquet, which was predicted from looks at the paper's scenes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from atra.files.paths import write_atomically
from experiments.drawing.figure import Axis, Figure, Level, Line, Panel
from experiments.drawing.render import render
from experiments.drawing.style import BLUE, DASHED, DOTTED, GREY, ORANGE, VERMILLION

ISA = "avx512"


def predictions(table: pd.DataFrame) -> Figure:
    """Predicted over measured milliseconds, a panel a method."""
    rows, panels = table[table["instruction_set"] == ISA], []
    ends = np.array([0.2, 3000.0])
    guides = [
        Line("_guide", ends, ends * factor, {"color": GREY, "linestyle": dashes}, thin=True)
        for factor, dashes in ((1.0, "-"), (1.4, DOTTED), (1 / 1.4, DOTTED))
    ]
    for method, of_method in rows.groupby("method", sort=False):
        error = (of_method["predicted_time_s"] / of_method["measured_time_s"] - 1).abs().median()
        points = [
            _points(name, of_want["measured_time_s"] * 1e3, of_want["predicted_time_s"] * 1e3, color, marker)
            for want, name, color, marker in (("nearest", "nearest hit", BLUE, "o"), ("count", "all hits", ORANGE, "^"))
            if len(of_want := of_method[of_method["want"] == want])
        ]
        title = f"{str(method).replace('_', '-')}: median error {error:.0%}"
        panels.append(Panel(title, lines=[*guides, *points]))
    axes = Axis("measured, ms a frame"), Axis("predicted, ms a frame")
    return Figure("lines", panels, *axes, legend=["nearest hit", "all hits"], columns=4)


def where_alignment_pays(table: pd.DataFrame) -> Figure:
    """Views, by what packets meet up to what they see, and by what the best aligned packets meet along the ray."""
    rows = table[(table["instruction_set"] == ISA) & (table["want"] == "nearest") & (table["packet_width"] == 16)]
    views = []
    for _, of_view in rows.groupby(["scene", "view"]):
        packets, aligned = (of_view[of_view["method"] == name] for name in ("pixel", "aligned"))
        best, packets = aligned.loc[aligned["measured_time_s"].idxmin()], packets.iloc[0]
        is_faster = best["measured_time_s"] < packets["measured_time_s"]
        views.append((packets["upper"] + packets["lower"], best["lower"] + best["met"], is_faster))
    x, y, is_faster = (np.array(column) for column in zip(*views, strict=True))
    names = {True: ("aligned packets faster", BLUE, "o"), False: ("ray packets faster", VERMILLION, "s")}
    lines = [
        _points(name, x[is_faster == which], y[is_faster == which], color, marker)
        for which, (name, color, marker) in names.items()
    ]
    axes = Axis("boxes up to what is seen"), Axis("boxes and hits that alignment keeps")
    return Figure("lines", [Panel(lines=lines)], *axes, legend=[name for name, *_ in names.values()])


def figure5(points: pd.DataFrame) -> Figure:
    """Milliseconds over horizontal splits, measured and predicted; ray packets as levels."""
    series, panels = {1: ("single rays", VERMILLION), 16: ("packets of 16", BLUE)}, []
    for scene, of_scene in points.groupby("scene", sort=False):
        lines, levels = list[Line](), list[Level]()
        for width, (name, color) in series.items():
            rows = of_scene[of_scene["packet_width"] == width].sort_values("split_x")
            splits = rows["split_x"].to_numpy(float)
            lines.append(_points(f"{name}, measured", splits, rows["measured_time_s"] * 1e3, color, "o"))
            predicted = rows["predicted_time_s"].to_numpy(float) * 1e3
            lines.append(Line(f"{name}, predicted", splits, predicted, {"color": color}))
            per_pixel_ms = float(rows["packets_time_s"].median()) * 1e3
            levels.append(Level(f"_{name}", per_pixel_ms, {"color": color, "linestyle": DASHED}))
        panels.append(Panel(str(scene), lines=lines, levels=levels))
    legend = [f"{name}, {what}" for name, _ in series.values() for what in ("measured", "predicted")]
    axes = Axis("horizontal splits"), Axis("ms a frame, 1,024 x 1,024")
    return Figure("lines", panels, *axes, legend=legend, columns=4)


def _points(name: str, x: pd.Series, y: pd.Series, color: str, marker: str) -> Line:
    looks = {"color": color, "marker": marker, "linestyle": "none"}
    return Line(name, np.asarray(x, np.float64), np.asarray(y, np.float64), looks)


def main(kept: Path, images: Path) -> None:
    """Draw all."""
    table = pd.read_parquet(kept / "table.parquet")
    drawn = {
        "law": predictions(table),
        "law_map": where_alignment_pays(table),
        "figure5_predicted": figure5(pd.read_parquet(kept / "figure5.parquet")),
    }
    for name, figure in drawn.items():
        write_atomically(images / f"{name}.png", render(figure, "png"))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
