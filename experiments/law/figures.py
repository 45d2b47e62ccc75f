"""Figures of the law: predicted over measured, the map of where alignment pays, and figure 5 with predicted curves.

    python -m experiments.law.figures reports/reference/law docs/images --figure5

Figure 5 needs the paper's scenes (ATRA_SCENES) and reports/reference/paper once, when --figure5 predicts it anew; what
it shows is kept as figure5.parquet.
"""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.transforms import Bbox

import atra
from experiments.drawing.style import BLACK, BLUE, GREY, ORANGE, VERMILLION
from experiments.law.fit import gather
from experiments.law.model.choice import Choice
from experiments.law.model.formulas import family, fit, frame_terms
from experiments.law.model.looking import look_at
from scenes.loading import SceneSource, load_scene

PAPER = ("cornell_box", "mitsuba", "fireplace_room", "sponza")
SIZE = 1024
ISA = "avx512"


def draw_predictions(table: pd.DataFrame, path: Path) -> None:
    """Predicted over measured milliseconds, a panel a method."""
    rows = table[table["instruction_set"] == ISA]
    methods = list(rows["method"].unique())
    figure, axes = plt.subplots(2, 4, figsize=(13, 6.8), sharex=True, sharey=True)
    for axis, method in zip(axes.flat, methods, strict=False):
        of = rows[rows["method"] == method]
        for want, say, color, marker in (("nearest", "nearest hit", BLUE, "o"), ("count", "all hits", ORANGE, "^")):
            one = of[of["want"] == want]
            axis.plot(one["measured_time_s"] * 1e3, one["predicted_time_s"] * 1e3, marker, color=color, markersize=4,
                      alpha=0.7, label=say, linestyle="none")  # fmt: skip
        ends = np.array([0.2, 3000.0])
        for factor, dashes in ((1.0, "-"), (1.4, ":"), (1 / 1.4, ":")):
            axis.plot(ends, ends * factor, dashes, color=GREY, linewidth=0.8)
        error = (of["predicted_time_s"] / of["measured_time_s"] - 1).abs().median()
        axis.set_title(f"{method.replace('_', '-')}: median error {error:.0%}", fontsize=10)
        axis.set_xscale("log")
        axis.set_yscale("log")
    for axis in axes[-1]:
        axis.set_xlabel("measured, ms a frame")
    for axis in axes[:, 0]:
        axis.set_ylabel("predicted, ms a frame")
    axes.flat[0].legend(fontsize=9, loc="upper left")
    _save(figure, path)


def map_points(table: pd.DataFrame) -> pd.DataFrame:
    """A row a view: what packets meet up to what they see, what aligned packets meet along the whole ray, and how many
    times as fast the best aligned packets are."""
    rows = table[(table["instruction_set"] == ISA) & (table["want"] == "nearest") & (table["packet_width"] == 16)]
    points = []
    for (scene, view), of in rows.groupby(["scene", "view"]):
        packets = of[of["method"] == "pixel"].iloc[0]
        aligned = of[(of["method"] == "aligned")]
        best = aligned.loc[aligned["measured_time_s"].idxmin()]
        points.append({
            "scene": scene, "view": view, "before": packets["upper"] + packets["lower"], "met": best["met"],
            "below": best["lower"], "gain": packets["measured_time_s"] / best["measured_time_s"],
            "predicted_gain": packets["predicted_time_s"] / aligned["predicted_time_s"].min(),
            "split": f"{best['split_x']} x {best['split_y']}",
        })  # fmt: skip
    return pd.DataFrame(points)


def draw_map(points: pd.DataFrame, path: Path) -> None:
    """Where alignment pays."""
    figure, axis = plt.subplots(figsize=(9, 6.4))
    limit = np.log2(max(points["gain"].max(), 1 / points["gain"].min()))
    shown = axis.scatter(
        points["before"], points["below"] + points["met"], c=np.log2(points["gain"]), cmap="RdBu",
        norm=TwoSlopeNorm(0.0, -limit, limit), s=70, edgecolors=BLACK, linewidths=0.7, zorder=3,
    )  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("work of a packet per pixel: boxes entered up to what it sees")
    axis.set_ylabel("work alignment keeps: boxes below the shared levels\nand triangles hit, along the whole packet")
    bar = figure.colorbar(shown, ax=axis)
    ticks = np.array([0.25, 0.5, 1, 2, 4])
    ticks = ticks[np.abs(np.log2(ticks)) <= limit]
    bar.set_ticks(np.log2(ticks), labels=[f"{one:g}" for one in ticks])
    bar.set_label("best aligned packets, times as fast as packets per pixel, measured")
    figure.tight_layout()
    _label(axis, points)
    _save(figure, path)


def _label(axis: Axes, points: pd.DataFrame) -> None:
    """Name every view at the nearest place around its point that no other label or point takes."""
    dots = axis.transData.transform(np.stack([points["before"], points["below"] + points["met"]], axis=1))
    taken = [Bbox.from_extents(x - 6, y - 6, x + 6, y + 6) for x, y in dots]
    around = [(r * np.cos(turn), r * np.sin(turn)) for r in range(9, 160, 6) for turn in np.arange(0, 2 * np.pi, 0.26)]
    to_points = 72.0 / axis.figure.dpi
    for (x, y), one in zip(dots, points.itertuples(), strict=True):
        own = one.view == "own"
        words = str(one.scene).replace("_", " ") + ("" if own else f", {one.view}")
        style: dict[str, Any] = {"fontsize": 7.5, "color": BLACK if own else GREY,
                 "fontweight": "bold" if one.scene in PAPER and own else "normal"}  # fmt: skip
        measured = axis.text(one.before, one.below + one.met, words, **style)
        size = measured.get_window_extent()
        measured.remove()
        for right, up in around:
            left, low = x + right - size.width * (right < 0), y + up - size.height / 2
            box = Bbox.from_bounds(left - 1, low - 1, size.width + 2, size.height + 2)
            inside = axis.bbox.contains(box.x0, box.y0) and axis.bbox.contains(box.x1, box.y1)
            if inside and not any(box.overlaps(other) for other in taken):
                axis.annotate(
                    words, (one.before, one.below + one.met), textcoords="offset points",
                    xytext=((left - x) * to_points, (low - y) * to_points),
                    arrowprops={"arrowstyle": "-", "linewidth": 0.4, "color": GREY, "shrinkA": 0, "shrinkB": 4,
                                "relpos": (float(right < 0), 0.5)}, **style,
                )  # fmt: skip
                taken.append(box)
                break


def figure5_points(kept_law: Path, paper: Path) -> pd.DataFrame:
    """Times of the kept figure 5, and what the model says: constants fitted here without the scene, times one factor a
    packet width, the median over the three other scenes."""
    law = gather(kept_law)
    law = law[law["instruction_set"] == ISA]
    kept = pd.read_parquet(paper / "table.parquet")
    kept = kept[(kept["workload"] == "frame") & (kept["method"] == "aligned") & (kept["status"] == "ok")
                & (kept["split_y"] == 1) & kept["culling"].eq(True) & kept["packet_width"].isin([1, 16])]  # fmt: skip
    points = []
    for scene in PAPER:
        loaded = load_scene(SceneSource.directory, scene, None)
        look = look_at(loaded.mesh, atra.Camera(**loaded.camera, width=SIZE, height=SIZE))
        names = {1: "baseline_render_time_s", 16: "packets_render_time_s"}
        for row in kept[kept["scene"] == scene].drop_duplicates(["packet_width", "split_x"]).to_dict("records"):
            choice = Choice("aligned", (int(row["split_x"]), 1), int(row["packet_width"]))
            others = law[(law["scene"] != scene) & (law["family"] == family(choice, "nearest"))]
            constants = fit(np.stack(list(others["frame_terms"])), others["measured_time_s"].to_numpy())
            points.append({
                "scene": scene, "packet_width": choice.packet_width, "split_x": choice.split[0],
                "measured_time_s": row["render_time_s"],
                "packets_time_s": row[names[choice.packet_width]],
                "unscaled_s": float(frame_terms(look, choice, "nearest") @ constants),
            })  # fmt: skip
    table = pd.DataFrame(points)
    for scene in PAPER:
        for width in (1, 16):
            own = (table["scene"] == scene) & (table["packet_width"] == width)
            others = table[(table["scene"] != scene) & (table["packet_width"] == width)]
            factor = (others["measured_time_s"] / others["unscaled_s"]).median()
            table.loc[own, "predicted_time_s"] = factor * table.loc[own, "unscaled_s"]
    return table.drop(columns="unscaled_s")


def draw_figure5(points: pd.DataFrame, path: Path) -> None:
    """Milliseconds over horizontal splits, measured and predicted."""
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.9), sharex=True)
    for axis, scene in zip(axes, PAPER, strict=True):
        for width, color, label in ((1, VERMILLION, "single rays"), (16, BLUE, "packets of 16")):
            of = points[(points["scene"] == scene) & (points["packet_width"] == width)].sort_values("split_x")
            _curves(axis, of, color, label)
        axis.set_title(scene.replace("_", " "), fontsize=10)
        axis.set_xscale("log", base=2)
        axis.set_yscale("log")
        axis.set_xlabel("horizontal splits")
    axes[0].set_ylabel("ms a frame, 1,024 x 1,024")
    axes[0].legend(fontsize=8)
    _save(figure, path)


def _curves(axis: Axes, of: pd.DataFrame, color: str, label: str) -> None:
    axis.plot(of["split_x"], of["measured_time_s"] * 1e3, "o", color=color, markersize=4, label=f"{label}, measured")
    axis.plot(of["split_x"], of["predicted_time_s"] * 1e3, "-", color=color, label=f"{label}, predicted")
    axis.axhline(of["packets_time_s"].median() * 1e3, color=color, linewidth=0.8, linestyle=":")


def _save(figure: plt.Figure, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Draw all."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("kept", type=Path)
    parser.add_argument("images", type=Path)
    parser.add_argument("--figure5", action="store_true", help="look at the paper's scenes and predict figure 5 anew")
    given = parser.parse_args()
    table = pd.read_parquet(given.kept / "table.parquet")
    if given.figure5:
        points = figure5_points(given.kept, given.kept.parent / "paper")
        points.to_parquet(given.kept / "figure5.parquet", index=False)
    draw_predictions(table, given.images / "law.png")
    draw_map(map_points(table), given.images / "law_map.png")
    if (given.kept / "figure5.parquet").exists():
        draw_figure5(pd.read_parquet(given.kept / "figure5.parquet"), given.images / "figure5_predicted.png")


if __name__ == "__main__":
    main()
